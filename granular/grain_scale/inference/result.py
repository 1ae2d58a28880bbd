"""Inferred forces with all that says how far they can be trusted."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granular.grain_scale.inference.linear import determined
from granular.grain_scale.inference.packing import Packing
from granular.grain_scale.inference.problem import Problem, listed

__all__ = ["Flag", "Inference", "InferenceWarning", "report"]

Array = NDArray[np.float64]

CARRIED = 0.5
"""Share of the stresses that the forces must carry: at f = 0, which is always in balance, none."""
MISFIT = 0.3
"""Residual of the stresses over their length from which on they and the contacts disagree."""
AT_LIMIT = 0.15
"""Share of frictional contacts about to slip from which on mu looks too small, at rest."""
BALANCE = 1e-6
"""Residual of a balance that should be exact, over the length of all forces."""


class InferenceWarning(UserWarning):
    """Inferred forces that must not be trusted as they are."""


@dataclass(frozen=True)
class Flag:
    """What is wrong with inferred forces.

    Attributes
    ----------
    name : str
        One of zero_forces, misfit, rank, friction, unbalanced, stressed_rattlers, boundary.
    message : str
        With the numbers behind it and what can be done.
    """

    name: str
    message: str


@dataclass(frozen=True, eq=False)
class Inference:
    """Forces at contacts, inferred.

    Attributes
    ----------
    packing : Packing
    forces : ndarray, shape (c, d)
        On the first body of each contact [N], in the plane [N/m]; the second has the opposite.
    mu : ndarray, shape (c,)
        Friction coefficient of each contact.
    weight : float
        Of the balance against the stresses; infinite where it holds exactly.
    regularization : float
        lambda/R of (2.14), 0 in (2.13).
    scale : float
        By which forces were multiplied to meet a boundary force.
    stress_residual : float
        Length of K_st f - b_st over that of b_st.
    balance_residual : float
        Length of K_eq f - b_m, moments over R, over that of all forces.
    carried : float
        (K_st f).b_st/(b_st.b_st): 1 for forces that carry the measured stresses, 0 for f = 0.
    unknowns, rank : int
        Components of forces to be found, and how many of them the rows determine, inequalities
        aside. Redundant rows, in return, average noise out.
    undetermined : ndarray of bool, shape (c,)
        Contacts whose forces the rows leave open.
    at_limit : ndarray of bool, shape (c,)
        Contacts about to slip: friction is what holds the solution here.
    excess : float
        Largest breach of repulsion or friction, over the mean force; 0 if there is none.
    weight_of_norms : float
        With norms in place of squares the same forces minimise ``|K f - b| + w |f|`` (2.14, w the
        thesis' lambda^2, in metres) or ``|K_s f - b_s| + w |K_m f - b_m|`` (3.18, in metres; its
        moments over R). nan where a norm vanishes or errors are known.
    solver : str
    flags : tuple of Flag
        Empty where nothing speaks against the forces. Each is also raised as a warning.
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
    undetermined: NDArray[np.bool_]
    at_limit: NDArray[np.bool_]
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
        """Whether there are no flags."""
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
    """The inference that a solution stands for; its flags are warned of, after those given."""
    rank, undetermined = determined(problem)
    mean = np.linalg.norm((problem.frame @ x).reshape(-1, problem.dim), axis=1).mean()
    stress, balance = problem.residuals(x)
    found = Inference(
        packing=packing,
        forces=scale * problem.force * (problem.frame @ x).reshape(-1, problem.dim),
        mu=problem.mu,
        weight=problem.weight,
        regularization=problem.regularization,
        scale=scale,
        stress_residual=_over(stress, np.linalg.norm(problem.stress_target)),
        balance_residual=_over(balance, np.linalg.norm(x)),
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
    raised = flags + _flags(found)
    for flag in raised:
        warnings.warn(f"{flag.name}: {flag.message}", InferenceWarning, stacklevel=3)
    return replace(found, flags=raised)


def _over(part: float, whole: float) -> float:
    return float(part / whole) if whole else float(part > 0)


def _carried(problem: Problem, x: Array) -> float:
    target = problem.stress_target
    return float((problem.stress @ x) @ target / (target @ target)) if target.any() else 1.0


def _at_limit(problem: Problem, x: Array, mean: float) -> NDArray[np.bool_]:
    """Loaded contacts within 1e-4 of the friction they have."""
    push, slipping = x[: len(problem.mu)], problem.slipping
    found = np.zeros(len(push), bool)
    slip = np.linalg.norm(problem.tangents(x), axis=1)
    loaded = push[slipping] > 1e-3 * mean
    found[slipping] = loaded & (slip >= (1 - 1e-4) * problem.mu[slipping] * push[slipping])
    return found


def _weight_of_norms(packing: Packing, problem: Problem, x: Array) -> float:
    if packing.stress_errors is not None:
        return float("nan")
    stress, balance = problem.residuals(x)
    R, l2 = problem.length, problem.regularization**2
    # Where one point minimises A^2 + l2 B^2 and A + w B alike, w = l2 B/A. R: rows were over R.
    other, factor = balance, problem.weight
    if np.isinf(factor):
        if not l2:
            return 0.0
        other, factor = float(np.linalg.norm(x)), l2
    return float(factor * other / stress * R) if stress and other else float("nan")


def _flags(found: Inference) -> tuple[Flag, ...]:
    flags = []
    packing, frictional = found.packing, np.isfinite(found.mu) & (found.mu > 0)
    if found.carried < CARRIED:
        flags.append(_zero_forces(found))
    elif found.stress_residual > MISFIT:
        message = f"the forces leave {found.stress_residual:.2g} of the stresses unexplained"
        flags.append(Flag("misfit", f"{message}: contacts, mu or stresses are wrong"))
    if found.rank < found.unknowns:
        which = np.flatnonzero(found.undetermined)
        message = (
            f"rank {found.rank} of {found.unknowns} unknowns; open are contacts {listed(which)}"
        )
        flags.append(Flag("rank", message))
    # In motion many contacts slip in truth.
    if frictional.any() and packing.accelerations is None and found.carried >= CARRIED:
        share = np.count_nonzero(found.at_limit) / np.count_nonzero(frictional)
        if share > AT_LIMIT:
            message = f"{share:.0%} of the frictional contacts are at their limit: is mu too small?"
            flags.append(Flag("friction", message))
    exact = np.isinf(found.weight) and found.carried >= CARRIED
    if exact and found.balance_residual > BALANCE:
        message = f"balance holds only to {found.balance_residual:.1g} of the forces"
        flags.append(Flag("unbalanced", message))
    loose = packing.rattlers()
    size = np.linalg.norm(packing.stresses, axis=(1, 2))
    loose = loose[size[loose] > 1e-3 * size.mean()]
    if len(loose):
        message = f"grains {listed(loose)} have stress but no contact: a contact is missing"
        flags.append(Flag("stressed_rattlers", message))
    return tuple(flags)


def _zero_forces(found: Inference) -> Flag:
    message = f"the forces carry {found.carried:.2g} of the stresses"
    if np.isinf(found.weight):
        message += (
            ": with these contacts hardly any forces but f = 0 are in balance "
            "(positions too rough, mu too small); weigh the balance with infer_dynamic"
        )
    return Flag("zero_forces", message)
