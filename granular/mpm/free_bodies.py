"""Watch over bodies that move freely: ends of the domain without a wall do not hold them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from granular import _core
from granular.model.grid import AXES, combined
from granular.mpm.blocks import solid_cells
from granular.mpm.body_distances import distance_at
from granular.shapes.measures import extents, reach
from granular.tools.arrays import Array, BoolArray

if TYPE_CHECKING:
    from granular.mpm.bodies import Body, BodyState
    from granular.mpm.scene import Scene


INTERVAL = 50
"""Steps between two checks of the bodies, in which a body moves by a few cells at most if its speed
is a tenth of that of elastic waves."""

MARGIN = 0.5
"""Overlap [cells] that is no collision yet: the resolution of a surface on the grid."""

THE_END = "the end of the domain"

ACROSS = 24
"""Largest number of sample points of a body along the edge of a cube of its volume."""


class Places(NamedTuple):
    """Sample points in and on a body in its coordinates, shape (n, dim), and their depths in it."""

    local: Array
    depth: Array


class FreeBodies:
    """The bodies of a scene that move freely, and the obstacles that each of them must not enter.

    These are the ends of the domain that are not open, and the walls, blocks and other bodies that
    they touch by contact, which fails where prescribed motions press them together. A body may
    overlap them as far as it does at the start, such as a wheel that a symmetry plane cuts (see
    `body_overlaps`), and begin beyond an end, such as a ball that falls into the domain. Unless it
    turns freely, it may reach ends and walls that are normal to an axis along which it follows its
    motion.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        free = (i for i, body in enumerate(scene.bodies) if body.free or body.inertia is not None)
        self._places = {i: places_of(scene, scene.bodies[i], scene.grid.cell) for i in free}
        self._solid = None
        if self._places and any(wall.is_block for wall in scene.walls):
            self._solid = solid_cells(scene.grid, scene.walls)
        self._allowed: dict[tuple[int, str], float] = {}
        start = [body.at_start() for body in scene.bodies]
        for i, what, depth in self._overlaps(start, 0.0):
            # Beyond a side there is more of an endless body than its sample points show.
            endless = not np.isfinite(_half_extents(scene.bodies[i])).all()
            self._allowed[i, what] = math.inf if endless and _is_flat(what) else depth

    def __bool__(self) -> bool:
        return bool(self._places)

    def check(self, states: Sequence[BodyState], time: float, step: int) -> None:
        """Raise a `SimulationError` if a free body is at a position where contact does not hold
        it."""
        for i, what, depth in self._overlaps(states, time):
            excess = depth - max(self._allowed.get((i, what), 0.0), 0.0)
            if excess > MARGIN * self._scene.grid.cell:
                reason = (
                    "no wall holds it there; put one, open the side, or end the run before"
                    if what.startswith(THE_END)
                    else "contact fails where bodies are pressed together by prescribed motions"
                )
                error = _core.SimulationError(
                    f"bodies[{i}] has met {what}, {excess:.3g} m deep by step {step} "
                    f"(t = {time:.9g} s): {reason}"
                )
                error.body, error.step = i, step
                raise error

    def _overlaps(
        self, states: Sequence[BodyState], time: float
    ) -> Iterator[tuple[int, str, float]]:
        """Yield free bodies, the obstacles near them, and their overlaps [m]."""
        for i, places in self._places.items():
            body, pose = self._scene.bodies[i], states[i]
            x = pose.position + places.local @ pose.rotation.T
            grid = self._scene.grid
            lower, size = np.array(grid.lower), grid.cell * np.array(grid.shape)
            x = np.where(grid.periodic, lower + (x - lower) % size, x)
            yield from ((i, *overlap) for overlap in self._flat(body, x, time))
            if self._solid is not None:
                within = self._in_blocks(x)
                if within.any():
                    yield i, "a Solid", float(places.depth[within].max())
            for j, other in enumerate(self._scene.bodies):
                if j == i:
                    continue
                far = distance_at(self._scene.grid, other, pose.position[None], states[j])[0]
                if far > reach(body.shape):
                    continue
                phi = distance_at(self._scene.grid, other, x, states[j])
                within = phi <= 0
                if within.any():
                    yield i, f"bodies[{j}]", float((places.depth - phi)[within].max())

    def _flat(self, body: Body, x: Array, time: float) -> Iterator[tuple[str, float]]:
        """Yield walls and ends of the domain near a body, and how far it is on both sides."""
        scene, grid = self._scene, self._scene.grid
        axes = [d for d in range(grid.dim) if body.inertia is not None or AXES[d] in body.free]
        for k, wall in enumerate(scene.walls):
            if wall.axis is None or wall.axis not in axes or time >= wall.opens_at:
                continue
            facing = np.ones(len(x), dtype=bool)
            for axis in range(grid.dim):
                if axis != wall.axis and wall.span is not None:
                    low, high = wall.extent(grid, axis)
                    facing &= (x[:, axis] > low) & (x[:, axis] < high)
            at = wall.extent(grid, wall.axis)[0]
            off = x[facing, wall.axis] - at
            if len(off) and off.min() < 0 < off.max():
                name = f"walls[{k}], normal to {AXES[wall.axis]} at {at:.6g} m"
                yield name, float(min(-off.min(), off.max()))
        for axis in axes:
            for sign, end in ((-1, grid.lower[axis]), (1, grid.upper[axis])):
                side = AXES[axis] + ("-" if sign < 0 else "+")
                if grid.periodic[axis] or side in grid.open_sides:
                    continue
                beyond = float((sign * (x[:, axis] - end)).max())
                if beyond > 0 >= sign * (body.position[axis] - end):
                    yield f"{THE_END} at {AXES[axis]} = {end:.6g} m", beyond

    def _in_blocks(self, x: Array) -> BoolArray:
        """True for the positions (n, dim) in blocks; none is beyond the ends of the grid."""
        grid, solid = self._scene.grid, self._solid
        assert solid is not None
        at = np.floor((x - np.array(grid.lower)) / grid.cell)
        last = np.array(grid.shape) - 1
        inside: BoolArray = ((at >= 0) & (at <= last)).all(axis=1)
        inside &= solid.at(at.clip(0, last).astype(np.intp).T)
        return inside


def _is_flat(what: str) -> bool:
    """True for the name of a wall or an end of the domain."""
    return what.startswith((THE_END, "walls["))


def _half_extents(body: Body) -> Array:
    """Half the extents of a body along its axes [m]; infinite for an endless one."""
    return extents(body.shape, np.eye(3), np.zeros((0, 3)))[: body.dim]


def places_of(scene: Scene, body: Body, deep: float) -> Places:
    """Sample a body: points on its surface, at the depth `deep` [m] below it, and on a grid within
    it.

    Those below it detect blocks, whose depth at a point is not known, where the grid is coarse. Of
    an endless body, the part is sampled that could be in the domain.
    """
    grid, shape, dim = scene.grid, body.shape, body.dim
    largest = float(np.linalg.norm(np.array(grid.shape) * grid.cell))
    low, high = np.array(shape.bounds)
    wide = high - low > 2 * largest
    low, high = np.where(wide, -largest, low), np.where(wide, largest, high)
    half = 0.5 * (high - low)
    width = max(0.5 * grid.cell, 2 * math.prod(half) ** (1 / dim) / ACROSS)
    axes = []
    for first, last, far in zip(low, high, half, strict=True):
        count = math.ceil(2 * far / width) + 1
        axes.append(np.linspace(first, last, count))
    points = combined(axes)
    phi, normal = shape.distance(points)
    near = abs(phi) <= width * math.sqrt(dim)
    surface = points[near] - phi[near, None] * normal[near]
    below = surface - deep * normal[near]
    depth = -shape.distance(below)[0]
    inside, is_deep = phi <= 0, depth > 0
    return Places(
        np.concatenate([surface, below[is_deep], points[inside]]),
        np.concatenate([np.zeros(len(surface)), depth[is_deep], -phi[inside]]),
    )
