"""Forces in packings at rest: the balance holds exactly, the stresses by least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from granular.grain_scale.inference.matrices import friction_of_contacts
from granular.grain_scale.inference.packing import Packing
from granular.grain_scale.inference.problem import Problem, static_problem
from granular.grain_scale.inference.result import Flag, Inference, report
from granular.grain_scale.inference.solvers import InferenceError, solve
from granular.tools.arrays import Array
from granular.tools.checks import finite, integer, non_negative, one_of, positive, vector

LARGEST = 1e3
"""Largest lambda/R of the search."""
FLAT = 0.05
"""Largest deviation of a platen from flat, divided by the mean radius."""


@dataclass(frozen=True, kw_only=True)
class BoundaryForce:
    """Force of one wall, as measured by a load cell.

    Attributes
    ----------
    body : int
        Number of the wall, < 0.
    direction : tuple of float, length d
        Direction of the force, not zero; it is normalised.
    value : float
        Force of the wall on the packing along the direction [N], in 2D [N/m]; > 0.
    opposite : int, optional
        Number of the wall that carries the same force on the other side, for `by="virial"`.
    {raises}.
    """

    body: int
    direction: tuple[float, ...]
    value: float
    opposite: int | None = None

    def __post_init__(self) -> None:
        integer("body", self.body, high=-1)
        given = np.array(vector("direction", self.direction))
        length = float(np.linalg.norm(given))
        if not length:
            raise ValueError(f"direction = {self.direction} must not be zero")
        object.__setattr__(self, "direction", tuple((given / length).tolist()))
        object.__setattr__(self, "value", positive("value", self.value))
        if self.opposite is not None and integer("opposite", self.opposite, high=-1) == self.body:
            raise ValueError(f"opposite = {self.opposite} must differ from body")


def infer_static(
    packing: Packing,
    *,
    mu: ArrayLike,
    mu_wall: float | dict[int, float] | None = None,
    regularization: float = 0.0,
    solver: str = "auto",
) -> Inference:
    """Forces in a packing at rest (Hurley's thesis, eqs 2.13, 2.14; in 3D with cones as in 3.19).

    The forces solve ``min |K_st f - b_st|^2 + lambda^2 |f|^2`` with ``K_eq f = b_m`` and
    ``B f >= 0``, where b_m is zero except for gravity and accelerations of the packing.

    Parameters
    ----------
    packing : Packing
        The packing, or a `Packing.subset` for inference within a window.
    mu : float or array_like, shape (c,)
        Friction coefficient of all contacts or of each; inf for repulsion alone.
    mu_wall : float or dict, optional
        Friction coefficient of the walls where it differs; 0 if the tangential forces there are
        known to be zero, which reduces the effect of noise.
    regularization : float
        lambda/R, >= 0.
    solver : {"auto", "clarabel", "nnls"}
        "auto" solves the least squares without the inequalities, and if these are violated takes
        Clarabel, or non-negative least squares ("nnls", small packings in 2D only) if Clarabel is
        missing.
    {raises}.
    ImportError
        If Clarabel is needed and missing.
    InferenceError
        If no forces meet the constraints, or the solver stops before its tolerance.

    Warns
    -----
    InferenceWarning
        For each flag of the result.
    """
    friction = friction_of_contacts(packing, mu, mu_wall)
    regularization = non_negative("regularization", regularization)
    problem = static_problem(packing, friction, regularization)
    return report(packing, problem, *solve(problem, solver))


def boundary_force(packing: Packing, forces: Array, known: BoundaryForce) -> float:
    """Force of a wall on the packing along a direction [N], eq. 2.17."""
    return float(_at_wall(packing, known).ravel() @ np.asarray(forces).ravel())


def infer_with_boundary(
    packing: Packing,
    known: BoundaryForce,
    *,
    mu: ArrayLike,
    mu_wall: float | dict[int, float] | None = None,
    by: str = "regularization",
    solver: str = "auto",
) -> Inference:
    """Forces that agree with a load cell, if the stresses are wrong by a factor.

    Parameters
    ----------
    packing, mu, mu_wall, solver
        See `infer_static`.
    by : {"regularization", "force", "virial"}
        Method by which the known force is met. "regularization": by the lambda of (2.14), as in the
        thesis, only for overestimated stresses. "force": by scaling the forces of (2.13) until that
        of the wall is correct. "virial": by scaling them so that the measured stresses agree with
        the force between two flat platens, ``sum V d.s.d = -F H``. This averages the noise of all
        grains; it needs `opposite`, no gravity, and no friction along the direction at the other
        walls.

    Raises
    ------
    TypeError, ValueError
        As `infer_static`; for a wall that does not exist, platens that are not flat, or grains
        that have contacts but are not connected to the wall, about which the known force contains
        no information.
    InferenceError
        As `infer_static`, and if the inferred force of the wall is zero or tensile.

    Warns
    -----
    InferenceWarning
        For each flag of the result; "boundary" if no lambda meets the force.
    """
    one_of("by", by, ("regularization", "force", "virial"))
    friction = friction_of_contacts(packing, mu, mu_wall)
    at_wall = _at_wall(packing, known)
    _check_joined(packing, known)
    problem = static_problem(packing, friction, 0.0)
    row = problem.force * (at_wall.ravel() @ problem.frame)
    x, used = solve(problem, solver)
    force = float(row @ x)
    if force <= 1e-6 * problem.force:
        raise InferenceError(
            f"the inferred force of wall {known.body} is {force:.3g}, not along "
            f"direction = {known.direction}"
        )
    if by == "force":
        return report(packing, problem, x, used, scale=known.value / force)
    if by == "virial":
        return report(packing, problem, x, used, scale=_virial_scale(packing, known))
    if force < known.value:
        flag = Flag(
            "boundary",
            f"without regularisation wall {known.body} pushes with {force:.4g}, less than the "
            f'known {known.value:.4g}, and with it less still: scale the forces, by="force"',
        )
        return report(packing, problem, x, used, flags=(flag,))
    chosen = problem.replace(regularization=_regularization(problem, row, known.value, solver))
    return report(packing, chosen, *solve(chosen, solver))


def _regularization(problem: Problem, row: Array, value: float, solver: str) -> float:
    """lambda/R at which the force of the wall is the known one; the force falls with lambda."""

    def off(regularization: float) -> float:
        x, _ = solve(problem.replace(regularization=regularization), solver)
        return float(row @ x) / value - 1

    high = 1.0
    while off(high) > 0:
        high *= 4
        if high > LARGEST:
            raise InferenceError(f"no lambda/R up to {LARGEST:g} brings the force down to {value}")
    return float(brentq(off, 0.0, high, xtol=1e-6, rtol=1e-5))


def _at_wall(packing: Packing, known: BoundaryForce) -> Array:
    """Coefficients of all force components in the force of the wall on the packing, (c, d)."""
    direction = np.array(vector("direction", known.direction, packing.dim))
    rows = np.zeros((len(packing.bodies), packing.dim))
    for side, sign in ((1, 1.0), (0, -1.0)):
        rows[packing.bodies[:, side] == known.body] = sign * direction
    if not rows.any():
        raise ValueError(f"body = {known.body} must be a wall that touches a grain")
    return rows


def _check_joined(packing: Packing, known: BoundaryForce) -> None:
    label = packing.clusters()
    touched = packing.bodies[(packing.bodies == known.body).any(axis=1)].max(axis=1)
    joined = np.isin(label, label[touched])
    joined[packing.rattlers()] = True
    if not joined.all():
        apart = np.flatnonzero(~joined)
        raise ValueError(
            f"grains {apart[:8].tolist()}{' ...' if len(apart) > 8 else ''} are not joined to "
            f"wall {known.body}, of which the force is known: leave them out with subset"
        )


def _virial_scale(packing: Packing, known: BoundaryForce) -> float:
    """Known sum of V d.s.d (-F H for platens at a distance H) divided by the measured one."""
    if known.opposite is None:
        raise ValueError('opposite = None must be the wall opposite to the known one for "virial"')
    if packing.gravity is not None or packing.accelerations is not None:
        raise ValueError('by = "virial" must not be used with gravity or accelerations')
    direction = np.array(known.direction)
    places = []
    for body in (known.body, known.opposite):
        at = packing.positions[(packing.bodies == body).any(axis=1)] @ direction
        if not len(at):
            raise ValueError(f"opposite = {body} must be a wall that touches a grain")
        if np.ptp(at) > FLAT * packing.radius:
            raise ValueError(
                f"wall {body} spreads by {np.ptp(at):.3g} m along direction = {known.direction}, "
                f"must be flat to {FLAT * packing.radius:.3g} m"
            )
        places.append(at.mean())
    height = finite("height", float(places[1] - places[0]))
    measured = packing.volumes @ (packing.stresses @ direction @ direction)
    expected = -known.value * height
    if expected * measured <= 0 or height <= 0:
        raise InferenceError(
            f"the stresses add up to {measured:.3g} along direction = {known.direction}, "
            f"the boundary force requires {expected:.3g}"
        )
    return float(expected / measured)
