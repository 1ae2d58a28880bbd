"""Energy of a state, and the budget of a run from its frames."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granular.measure.averaging_grid import require_points
from granular.measure.profiles import inertial_number
from granular.measure.result import ENERGY, Result
from granular.measure.stress import deviator_squared, pressure
from granular.model.gravity import Gravity
from granular.model.state import State
from granular.tools.arrays import Array


@dataclass(frozen=True)
class Energy(Result, kinetic=ENERGY, gravitational=ENERGY, elastic=ENERGY):
    """Energy of a state [J; in 2D per metre of depth].

    Attributes
    ----------
    kinetic, gravitational, elastic : float
        The three energies. Gravitational energy is zero at the grid's lower corner. Periodic axes
        do not contribute, because a force along them has no potential.
    """

    kinetic: float
    gravitational: float
    elastic: float

    @property
    def total(self) -> float:
        """The sum of the three."""
        return self.kinetic + self.gravitational + self.elastic


@dataclass(frozen=True)
class EnergyBudget(
    Result,
    times="s",
    kinetic=ENERGY,
    elastic=ENERGY,
    gravity_work=ENERGY,
    outflow=ENERGY,
    dissipated=ENERGY,
):
    """Energy budget of a run over its k frames [J; in 2D per metre of depth], each of shape (k,).

    Attributes
    ----------
    times : ndarray
        Times of the frames [s].
    kinetic, elastic : ndarray
        Kinetic and elastic energy of the points.
    gravity_work : ndarray
        Work of gravity on the points since the first frame.
    outflow : ndarray
        Kinetic and elastic energy, at the last frame before, of points that have left the domain
        since the first frame.
    dissipated : ndarray
        The remainder: gravity_work - (change of kinetic + elastic) - outflow. It should never
        decrease beyond the error of the finite differences; otherwise the scheme creates energy.
        The work of moving bodies and walls is not part of it: with them it is the dissipation less
        their work (`body_motion` has that of bodies).
    """

    times: Array
    kinetic: Array
    elastic: Array
    gravity_work: Array
    outflow: Array
    dissipated: Array


def energy(state: State) -> Energy:
    """Kinetic, gravitational and elastic energy of a state.

    The three are ``sum m v.v/2``; ``-sum m g(t).(x - lower)``; and, with the deviator s of the
    stress and the quadrature volume V (`State.quadrature_volume`),
    ``sum V (s:s/(4 G) + p**2/(2 K))``, the stored energy of linear elasticity (Dunatunga & Kamrin
    2015, eq. 2.9). In SPH the elastic energy is that of the equation of state
    (`sph.Viscoplastic.stored_energy`).

    Raises
    ------
    ValueError
        If the state is empty.
    """
    require_points(state)
    grid = state.scene.grid
    g = np.where(grid.periodic, 0.0, np.asarray(state.scene.gravity.at(state.time), dtype=float))
    height = (np.asarray(state.x) - np.asarray(grid.lower)) @ g
    return Energy(
        kinetic=float(kinetic_of(state).sum()),
        gravitational=float(-np.sum(state.mass * height)),
        elastic=float(elastic_of(state).sum()),
    )


def kinetic_of(state: State) -> Array:
    """Kinetic energy of every point [J], shape (n,)."""
    return np.asarray(state.mass) * np.sum(np.asarray(state.v) ** 2, axis=1) / 2


def elastic_of(state: State) -> Array:
    """Elastic energy stored in every point [J], shape (n,)."""
    material = state.scene.material
    if hasattr(material, "stored_energy"):  # by an equation of state
        return np.asarray(state.mass) * material.stored_energy(np.asarray(state.density))
    stress = np.asarray(state.stress, dtype=float)
    K, G = state.of_material("K"), state.of_material("G")
    density = deviator_squared(stress) / (4 * G) + pressure(stress) ** 2 / (2 * K)
    return np.asarray(state.quadrature_volume) * density


def plastic_power(state: State) -> float:
    """``sum V tau gdot`` [W] over the points (eq. 2.15); 0 for a law without a yield criterion.

    Of material that dilates, whose pressure does work, too, it is ``sum V mu(I) p gdot``
    (`granular.DilatantMuI`).
    """
    tau = state.shear_stress.copy()
    number = np.asarray(getattr(state, "material", np.zeros(state.n)))
    for k, material in enumerate(state.scene.materials):
        if getattr(material, "dilates", False):
            of = (number == k) & state.dense
            tau[of] = material.friction(inertial_number(state)[of]) * state.pressure[of]
    yields = state.of_material("granular") > 0
    return float(np.sum((state.quadrature_volume * tau * state.shear_rate)[yields]))


def energy_budget(trajectory: Iterable[State]) -> EnergyBudget:
    """Energy budget of a run from differences between frames.

    The work of gravity is the integral of ``m g(t).v(t)`` over the points present in both frames,
    with the path between the frames that has the positions and velocities of both (a cubic). Along
    periodic axes the displacement is to the image nearest to ``(v0 + v1)/2 dt``. In a closed box
    the work is exact for constant gravity, where it is ``m g.(x1 - x0)``, and otherwise of fourth
    order in the frame interval.

    Parameters
    ----------
    trajectory : iterable of State

    Raises
    ------
    ValueError
        If there are fewer than two frames, or the first frame is empty, or the scene has inflows,
        whose energy frames do not hold (`Simulation.inflows` does).
    """
    frames = iter(trajectory)
    before = next(frames, None)
    if before is None:
        raise ValueError("trajectory has 0 frames, a budget needs at least 2")
    require_points(before)
    if getattr(before.scene, "inflows", ()):
        raise ValueError(
            f"scene {before.scene.name!r} must have no inflows: their energy is unknown"
        )
    rows = [(before.time, kinetic_of(before).sum(), elastic_of(before).sum(), 0.0, 0.0)]
    for state in frames:
        work, lost = between(before, state)
        held = (kinetic_of(state).sum(), elastic_of(state).sum())
        rows.append((state.time, *held, rows[-1][3] + work, rows[-1][4] + lost))
        before = state
    if len(rows) < 2:
        raise ValueError("trajectory has 1 frame, a budget needs at least 2")
    times, kinetic, elastic, work, outflow = np.array(rows, dtype=float).T
    stored = kinetic + elastic
    return EnergyBudget(
        times, kinetic, elastic, work, outflow, work - (stored - stored[0]) - outflow
    )


def between(before: State, after: State) -> tuple[float, float]:
    """Work of gravity on the points in both states, and the energy of those that left."""
    old: slice | NDArray[np.integer]
    new: slice | NDArray[np.integer]
    if np.array_equal(before.id, after.id):
        old = new = slice(None)
    else:
        _, old, new = np.intersect1d(before.id, after.id, assume_unique=True, return_indices=True)
    grid = after.scene.grid
    of_moved, of_old, of_new = _gravity_weights(after.scene.gravity, before.time, after.time)
    moved = np.asarray(after.x)[new] - np.asarray(before.x)[old]
    drift = (np.asarray(after.v)[new] + np.asarray(before.v)[old]) / 2 * (after.time - before.time)
    around = np.where(grid.periodic, grid.cell * np.asarray(grid.shape), np.inf)
    rounds = np.where(grid.periodic, np.round((drift - moved) / around), 0.0)
    moved = moved + rounds * np.where(grid.periodic, around, 0.0)
    held = kinetic_of(before) + elastic_of(before)
    per_mass = moved @ of_moved + before.v[old] @ of_old + after.v[new] @ of_new
    work = np.asarray(before.mass)[old] @ per_mass
    return float(work), float(held.sum() - held[old].sum())


def _gravity_weights(gravity: Gravity, begin: float, end: float) -> tuple[Array, Array, Array]:
    """Vectors whose products with x1 - x0, v0 and v1 add up to the integral of g(t).v(t).

    The path x(t) is the cubic through both states, so that v(t) is quadratic and, between the times
    at which gravity is given, g(t) linear: two Gauss points on each piece are exact.
    """
    times = np.asarray(gravity.times)
    ends = np.concatenate([[begin], times[(times > begin) & (times < end)], [end]])
    half = np.diff(ends)[:, None] / 2
    t = (ends[:-1, None] + half * (1 + np.array([-1, 1]) / np.sqrt(3))).ravel()
    vectors = np.asarray(gravity.vectors)
    g = np.stack([np.interp(t, times, component) for component in vectors.T], axis=1)
    g *= np.repeat(half, 2)[:, None]
    length = max(end - begin, np.finfo(float).tiny)
    s = (t - begin) / length
    return (6 * s * (1 - s) / length) @ g, (1 - s) * (1 - 3 * s) @ g, s * (3 * s - 2) @ g
