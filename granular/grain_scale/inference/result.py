"""Inferred forces, with the diagnostics that show how reliable they are."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from granular.grain_scale.inference.linear import determined
from granular.grain_scale.inference.packing import Packing
from granular.grain_scale.inference.problem import Problem, listed
from granular.tools.arrays import Array, BoolArray

CARRIED = 0.5
"""Share of the stresses that the forces must carry. Forces f = 0, always in balance, carry none."""
MISFIT = 0.3
"""Largest relative residual of the stresses; above it stresses and contacts disagree."""
AT_LIMIT = 0.15
"""Largest share of frictional contacts about to slip at rest; above it mu seems too small."""
BALANCE = 1e-6
"""Largest residual of a balance that should be exact, divided by the norm of all forces."""


class InferenceWarning(UserWarning):
    """Inferred forces that are not reliable."""


@dataclass(frozen=True)
class Flag:
    """A defect of inferred forces.

    Attributes
    ----------
    name : str
        One of zero_forces, misfit, rank, friction, unbalanced, stressed_rattlers, boundary.
    message : str
        Description, with the numbers and possible remedies.
    """

    name: str
    message: str


@dataclass(frozen=True, eq=False)
class Inference:
    """Inferred forces at contacts.

    Attributes
    ----------
    packing : Packing
    forces : ndarray, shape (c, d)
        Forces on the first body of each contact [N], in 2D [N/m]; those on the second body are the
        opposite.
    mu : ndarray, shape (c,)
        Friction coefficient of each contact.
    weight : float
        Weight of the balance relative to the stresses; infinite where the balance holds exactly.
    regularization : float
        lambda/R of (2.14), 0 in (2.13).
    scale : float
        Factor by which the forces were multiplied to meet a boundary force.
    stress_residual : float
        Norm of K_st f - b_st divided by that of b_st.
    balance_residual : float
        Norm of K_eq f - b_m, with moments divided by R, divided by that of all forces.
    carried : float
        (K_st f).b_st/(b_st.b_st): 1 for forces that carry the measured stresses, 0 for f = 0.
    unknowns, rank : int
        Number of unknown force components, and number of them that the rows determine without
        the inequalities. Redundant rows average out noise.
    undetermined : ndarray of bool, shape (c,)
        Contacts whose forces the rows do not determine.
    at_limit : ndarray of bool, shape (c,)
        Contacts about to slip, where the friction inequality is active.
    excess : float
        Largest violation of repulsion or friction, divided by the mean force; 0 if there is none.
    weight_of_norms : float
        With norms instead of squares the same forces minimise ``|K f - b| + w |f|`` (2.14, w the
        thesis' lambda^2, in metres) or ``|K_s f - b_s| + w |K_m f - b_m|`` (3.18, in metres; its
        moments over R). nan where a norm vanishes or errors are known.
    solver : str
    flags : tuple of Flag
        Defects; empty if there is none. Each is also issued as a warning.
    """

    packing: Packing
    forces: Array
    mu: Array
    weight: float
    regularization: float
    scale: float
    stress_residual: float
    balance_residual: float
    carried: float
    unknowns: int
    rank: int
    undetermined: BoolArray
    at_limit: BoolArray
    excess: float
    weight_of_norms: float
    solver: str
    flags: tuple[Flag, ...]

    @property
    def pushes(self) -> Array:
        """Normal forces -e.f [N], >= 0, shape (c,)."""
        return -np.einsum("ka,ka->k", self.forces, self.packing.normals)

    @property
    def slips(self) -> Array:
        """Lengths of the tangential forces [N], shape (c,)."""
        return np.linalg.norm(self.forces + self.pushes[:, None] * self.packing.normals, axis=1)

    @property
    def magnitudes(self) -> Array:
        """Lengths of the forces [N], shape (c,)."""
        return np.linalg.norm(self.forces, axis=1)

    @property
    def trusted(self) -> bool:
        """True if there are no flags."""
        return not self.flags


def report(
    packing: Packing,
    problem: Problem,
    x: Array,
    solver: str,
    *,
    scale: float = 1.0,
    flags: tuple[Flag, ...] = (),
) -> Inference:
    """Make the inference of a solution, and issue warnings for the given and the detected flags."""
    rank, undetermined = determined(problem)
    mean = np.linalg.norm((problem.frame @ x).reshape(-1, problem.dim), axis=1).mean()
    stress, balance = problem.residuals(x)
    inference = Inference(
        packing=packing,
        forces=scale * problem.force * (problem.frame @ x).reshape(-1, problem.dim),
        mu=problem.mu,
        weight=problem.weight,
        regularization=problem.regularization,
        scale=scale,
        stress_residual=_over(stress, float(np.linalg.norm(problem.stress_target))),
        balance_residual=_over(balance, float(np.linalg.norm(x))),
        carried=_carried(problem, x),
        unknowns=len(x),
        rank=rank,
        undetermined=undetermined,
        at_limit=_at_limit(problem, x, mean),
        excess=_over(max(problem.excess(x).max(), 0.0), mean),
        weight_of_norms=_weight_of_norms(packing, problem, x),
        solver=solver,
        flags=flags,
    )
    raised = (*flags, *_flags(inference))
    for flag in raised:
        warnings.warn(f"{flag.name}: {flag.message}", InferenceWarning, stacklevel=3)
    return replace(inference, flags=raised)


def _over(part: float, whole: float) -> float:
    return float(part / whole) if whole else float(part > 0)


def _carried(problem: Problem, x: Array) -> float:
    target = problem.stress_target
    return float((problem.stress @ x) @ target / (target @ target)) if target.any() else 1.0


def _at_limit(problem: Problem, x: Array, mean: float) -> BoolArray:
    """Loaded contacts within 1e-4 of their friction limit."""
    push, slipping = x[: len(problem.mu)], problem.slipping
    mask = np.zeros(len(push), bool)
    slip = np.linalg.norm(problem.tangents(x), axis=1)
    loaded = push[slipping] > 1e-3 * mean
    mask[slipping] = loaded & (slip >= (1 - 1e-4) * problem.mu[slipping] * push[slipping])
    return mask


def _weight_of_norms(packing: Packing, problem: Problem, x: Array) -> float:
    if packing.stress_errors is not None:
        return float("nan")
    stress, balance = problem.residuals(x)
    R, l2 = problem.length, problem.regularization**2
    # A point that minimises both A^2 + l2 B^2 and A + w B has w = l2 B/A. The factor R is there
    # because the rows were divided by R.
    other, factor = balance, problem.weight
    if np.isinf(factor):
        if not l2:
            return 0.0
        other, factor = float(np.linalg.norm(x)), l2
    return float(factor * other / stress * R) if stress and other else float("nan")


def _flags(inference: Inference) -> Iterator[Flag]:
    packing, frictional = inference.packing, np.isfinite(inference.mu) & (inference.mu > 0)
    if inference.carried < CARRIED:
        message = f"the forces carry {inference.carried:.2g} of the stresses"
        if np.isinf(inference.weight):
            message += (
                ": with these contacts hardly any forces but f = 0 are in balance "
                "(positions too rough, mu too small); weigh the balance with infer_dynamic"
            )
        yield Flag("zero_forces", message)
    elif inference.stress_residual > MISFIT:
        message = f"the forces leave {inference.stress_residual:.2g} of the stresses unexplained"
        yield Flag("misfit", f"{message}: contacts, mu or stresses are wrong")
    if inference.rank < inference.unknowns:
        which = listed(np.flatnonzero(inference.undetermined))
        message = (
            f"rank {inference.rank} of {inference.unknowns} unknowns; open are contacts {which}"
        )
        yield Flag("rank", message)
    # In moving packings many contacts really slip.
    if frictional.any() and packing.accelerations is None and inference.carried >= CARRIED:
        share = np.count_nonzero(inference.at_limit) / np.count_nonzero(frictional)
        if share > AT_LIMIT:
            message = f"{share:.0%} of the frictional contacts are at their limit: is mu too small?"
            yield Flag("friction", message)
    exact = np.isinf(inference.weight) and inference.carried >= CARRIED
    if exact and inference.balance_residual > BALANCE:
        message = f"balance holds only to {inference.balance_residual:.1g} of the forces"
        yield Flag("unbalanced", message)
    rattlers = packing.rattlers()
    size = np.linalg.norm(packing.stresses, axis=(1, 2))
    rattlers = rattlers[size[rattlers] > 1e-3 * size.mean()]
    if len(rattlers):
        message = f"grains {listed(rattlers)} have stress but no contact: a contact is missing"
        yield Flag("stressed_rattlers", message)
