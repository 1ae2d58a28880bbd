"""Mode of flow of a hopper: the speed at its walls over the speed at its axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from granular.measure.averaging_grid import mean_of, require_points, sums_of
from granular.measure.opening import each_state
from granular.measure.result import Result
from granular.model.state import States
from granular.mpm.body_distances import distance_from_bodies
from granular.mpm.scene import Scene
from granular.tools.arrays import Array
from granular.tools.checks import integer, positive, sequence

MASS_FLOW_INDEX = 0.3
"""Index above which the flow counts as mass flow."""


@dataclass(frozen=True, eq=False, kw_only=True)
class HopperFlow(Result, z="m", wall="m/s", axis="m/s"):
    """Speeds at the wall and at the axis of a hopper by elevation; nan where there are no points.

    Attributes
    ----------
    z : ndarray, shape (k,)
        Middles of layers one cell thick, from the opening upwards [m].
    wall, axis : ndarray, shape (k,)
        Mean speeds of the material at the walls and at the axis [m/s], by mass.
    index : ndarray, shape (k,)
        Mass flow index: `wall` over `axis`.
    """

    z: Array
    wall: Array
    axis: Array
    index: Array

    @property
    def mass_flow(self) -> bool:
        """True if the index exceeds 0.3 at each elevation, so that the wall moves everywhere."""
        known = self.index[np.isfinite(self.index)]
        return bool(len(known) and np.all(known > MASS_FLOW_INDEX))


def hopper_flow(
    states: States, *, reach: float = 1.0, walls: Sequence[int] | None = None
) -> HopperFlow:
    """Mass flow index of a hopper about the last axis, by elevation.

    It is the mean speed of the points less than `reach` cells from the walls over that of the
    points less than `reach` cells from the axis. Flow with an index above 0.3 counts as mass flow
    (Johanson & Jenike 1962, Bulletin 116 of the Utah Engineering Experiment Station, as used by
    Ketterhagen et al. 2009, Powder Technol. 195, 1).

    Parameters
    ----------
    states : State or iterable of State
        Of a hopper whose axis is at x = 0 (and y = 0) and whose opening is at elevation 0.
    reach : float
        Distance in cells, > 0.
    walls : sequence of int, optional
        Indices of the bodies of the scene that are the walls; by default all of them. Name the
        walls if there are other bodies, such as an insert.

    Raises
    ------
    TypeError, ValueError
        If there are no states or points, the scene has no such bodies, or `reach` is not positive.
    """
    reach = positive("reach", reach)
    frames = list(each_state(states))
    scene = frames[0].scene
    if not isinstance(scene, Scene) or not scene.bodies:
        raise ValueError(f"scene {scene.name!r} has no bodies, which are the walls of a hopper")
    count = len(scene.bodies)
    chosen = range(count) if walls is None else sequence("walls", walls)
    solids = [scene.bodies[integer("walls", index, 0, count - 1)] for index in chosen]
    from_walls = distance_from_bodies(scene.grid, solids)
    cell, upper = scene.grid.cell, scene.grid.upper[-1]
    count = max(round(upper / cell), 1)
    sums = np.zeros((2, 2, count))
    for state in frames:
        require_points(state)
        x, m = np.asarray(state.x, dtype=float), np.asarray(state.mass, dtype=float)
        speed = np.linalg.norm(state.v, axis=1)
        layer = np.floor(x[:, -1] / cell).astype(np.int64)
        inside = (layer >= 0) & (layer < count)
        near = (from_walls(x)[0], np.linalg.norm(x[:, :-1], axis=1))
        for total, distance in zip(sums, near, strict=True):
            keep = inside & (distance < reach * cell)
            total[0] += sums_of(layer[keep], m[keep], count)
            total[1] += sums_of(layer[keep], (m * speed)[keep], count)
    wall, axis = (mean_of(moment, mass) for mass, moment in sums)
    with np.errstate(divide="ignore", invalid="ignore"):
        index = np.where(axis > 0, wall / axis, np.nan)
    z = np.linspace(0.5, count - 0.5, count) * cell
    return HopperFlow(z=z, wall=wall, axis=axis, index=index)
