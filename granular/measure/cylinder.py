"""Flow about a vertical axis: velocity as a function of the distance from it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from granular.measure.averaging_grid import sums_of
from granular.measure.opening import each_state
from granular.measure.result import MASS, Result
from granular.model.state import State, States
from granular.tools.arrays import Array, IntArray
from granular.tools.checks import finite, vector


@dataclass(frozen=True, eq=False, kw_only=True)
class CylinderProfile(
    Result, r="m", omega="rad/s", speed="m/s", spread="rad/s", radial="m/s", mass=MASS
):
    """Angular velocity of the material in rings about an axis; nan in rings without points.

    Attributes
    ----------
    r : ndarray, shape (k,)
        Mean distance of the points of a ring from the axis [m].
    omega : ndarray, shape (k,)
        Angular velocity, counter-clockwise positive [rad/s].
    speed : ndarray, shape (k,)
        ``r omega`` [m/s].
    spread : ndarray, shape (k,)
        Standard deviation of the angular velocities in a ring [rad/s].
    radial : ndarray, shape (k,)
        Mean outward velocity [m/s]; zero in steady flow.
    mass : ndarray, shape (k,)
        Mass in a ring, averaged over the intervals between frames [kg].
    intervals : int
        Number of intervals between frames.
    """

    r: Array
    omega: Array
    speed: Array
    spread: Array
    radial: Array
    mass: Array
    intervals: int


def cylinder_profile(
    states: States,
    *,
    edges: ArrayLike | None = None,
    above: float | None = None,
    below: float | None = None,
    axis: tuple[float, float] = (0.0, 0.0),
) -> CylinderProfile:
    """Mass-weighted mean angular velocity about a vertical axis in rings.

    Figure 9 of Haeri & Skonieczny 2021 shows the velocity about the axis, divided by that of the
    inner cylinder, at the top surface. Here velocities are displacements from one frame to the
    next divided by the time between them. The velocity that a point stores is not used: it differs
    from that of the grid by the part that the transfer retains, a sixth of it next to a no-slip
    wall.

    Parameters
    ----------
    states : iterable of State
        At least two, in the order of time; no point may turn by half a circle between two.
    edges : array_like, shape (k + 1,), optional
        Radii of the edges of the rings [m], ascending, >= 0; by default rings about one cell wide
        between the scene's parameters ``inner`` and ``outer``.
    above, below : float, optional
        Use the points between these elevations [m] at the later frame; in 3D only.
    axis : (x, y)
        Position of the axis [m].

    Raises
    ------
    ValueError
        If there are fewer than two states, the times do not ascend, no point is in a ring, or the
        edges do not ascend.
    """
    states = list(each_state(states))
    if len(states) < 2:
        raise ValueError("states has 1 frame, at least 2 are needed")
    bounds = _edges(states[0], edges)
    centre = np.array(vector("axis", axis, 2))
    low = -np.inf if above is None else finite("above", above)
    high = np.inf if below is None else finite("below", below)
    sums = np.zeros((5, len(bounds) - 1))
    for before, after in pairwise(states):
        r, omega, outward, rows = _turned(before, after, centre)
        keep = (r >= bounds[0]) & (r < bounds[-1]) & (r > 0)
        if after.x.shape[1] == 3:
            up = np.asarray(after.x)[rows, 2]
            keep &= (up >= low) & (up < high)
        m = np.asarray(after.mass, dtype=float)[rows][keep]
        r, omega, outward = r[keep], omega[keep], outward[keep]
        ring = np.searchsorted(bounds, r, side="right") - 1
        parts = (m, m * r, m * omega, m * omega**2, m * outward)
        for total, part in zip(sums, parts, strict=True):
            total += sums_of(ring, part, len(total))
    if not sums[0].any():
        raise ValueError(f"no point from {bounds[0]} to {bounds[-1]} m of the axis {axis}")
    return _profile(sums, len(states) - 1)


def _turned(before: State, after: State, centre: Array) -> tuple[Array, Array, Array, IntArray]:
    """Radius, angular and radial velocity of the points that are in both states, and their
    indices in the later one."""
    span = after.time - before.time
    if not span > 0:
        raise ValueError(f"states at {before.time} and {after.time} s: times must ascend")
    _, here, there = np.intersect1d(before.id, after.id, return_indices=True)
    (x0, y0), (x1, y1) = (
        (np.asarray(state.x, dtype=float)[places, :2] - centre).T
        for state, places in ((before, here), (after, there))
    )
    angle = np.arctan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)
    r = np.hypot(x1, y1)
    return r, angle / span, (r - np.hypot(x0, y0)) / span, there


def _profile(sums: Array, intervals: int) -> CylinderProfile:
    mass = np.where(sums[0] > 0, sums[0], np.nan)
    r, omega, square, outward = sums[1:] / mass
    return CylinderProfile(
        r=r,
        omega=omega,
        speed=r * omega,
        spread=np.sqrt(np.maximum(square - omega**2, 0.0)),
        radial=outward,
        mass=sums[0] / intervals,
        intervals=intervals,
    )


def _edges(state: State, edges: ArrayLike | None) -> Array:
    if edges is not None:
        bounds = np.asarray(edges, dtype=float)
        rising = bounds.ndim == 1 and len(bounds) > 1 and np.all(np.diff(bounds) > 0)
        if not (rising and bounds[0] >= 0):
            raise ValueError(f"edges = {edges!r} must be ascending radii >= 0, at least 2 of them")
        return bounds
    known = state.scene.parameters
    if "inner" not in known or "outer" not in known:
        raise ValueError("edges = None: the scene has no parameters inner and outer, give radii")
    inner, outer = known["inner"], known["outer"]
    rings = max(round((outer - inner) / state.scene.grid.cell), 1)
    return np.linspace(inner, outer, rings + 1)
