"""Free bodies that begin within walls, blocks or other bodies, which contact would not push out."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, product, repeat
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from granular.model.grid import AXES, Grid, combined
from granular.mpm.blocks import solid_cells
from granular.mpm.body_distances import distance_at, nearest, surface_at
from granular.mpm.free_bodies import places_of
from granular.mpm.rigid_contact import SPACING, balls_of, obstacles, row_of_wall
from granular.mpm.walls import WallOrBlock
from granular.shapes.measures import reach, thicknesses
from granular.tools.arrays import Array, BoolArray

if TYPE_CHECKING:
    from granular.mpm.bodies import Body
    from granular.mpm.scene import Scene


OVERLAP = 0.5
"""Overlap at the start [cells] up to which bodies, walls and blocks count as touching.

It is that of csrc/contact/rigid.c: the surface of a body is resolved to half a cell, the distance
of its sample points. Contact keeps such a pair from overlapping more; a pair that overlaps by more
than this at the start does not touch at all, so that the body would fall through.
"""

MARGIN = 0.02
"""Part by which an overlap must exceed that where it is evaluated at single points."""

MOST_ACROSS = {2: 1000, 3: 200}
"""Sample points along an edge of the part of a wall that a body may cross, by dimension."""


class Overlap(NamedTuple):
    """Name of the obstacle that a body begins within, its depth in it [m], and the deepest
    point."""

    what: str
    depth: float
    place: Array


class Balls(NamedTuple):
    """The balls with which a body touches others: centres, shape (n, dim), and radii [m]."""

    x: Array
    radius: Array


def check_overlaps(scene: Scene) -> None:
    """Refuse free bodies that begin deeper than `OVERLAP` within a solid of that time.

    A body may overlap walls normal to an axis along which it is not free, such as a symmetry plane
    that cuts it, and a body without free axes may overlap the solids in which it is hinged. Ends of
    the domain without a wall are not solid, and so are walls that open at once.
    """
    most = (OVERLAP + scene.grid.slack) * scene.grid.cell
    for i, overlap in _overlaps(scene):
        if overlap.depth > most:
            place = ", ".join(f"{x:.9g}" for x in overlap.place)
            raise ValueError(
                f"bodies[{i}] begins {overlap.depth:.4g} m within {overlap.what}, at ({place}): "
                f"must be at most {most:.4g} m, {OVERLAP} cells, as contact has no effect on larger"
                " overlaps; move it out"
            )


def _overlaps(scene: Scene) -> Iterator[tuple[int, Overlap]]:
    """Yield free bodies and the obstacles that they overlap."""
    free = [i for i, body in enumerate(scene.bodies) if body.free]
    if not free:
        return
    balls = list(map(_placed, repeat(scene.grid), scene.bodies, balls_of(scene)))
    solid = obstacles(scene)[[wall.is_block for wall in scene.walls]]
    for i in free:
        if not len(balls[i].x):  # endless: it may cross other bodies
            continue
        for k, wall in enumerate(scene.walls):
            if wall.axis is not None and AXES[wall.axis] in scene.bodies[i].free:
                within = _in_wall(scene, k, wall.axis, i, balls[i])
                yield from ((i, overlap) for overlap in within)
        if _is_near_blocks(scene, solid, scene.bodies[i]):
            yield from ((i, overlap) for overlap in _in_blocks(scene, scene.bodies[i]))
    for i, j in combinations(range(len(scene.bodies)), 2):
        if (i in free or j in free) and _are_near(scene, i, j):
            one, other = (i, j) if i in free else (j, i)
            yield from ((one, overlap) for overlap in _in_body(scene, one, other, balls))


def _placed(grid: Grid, body: Body, rows: Array) -> Balls:
    """Balls of a body, given in its coordinates, in the grid; an endless one has none."""
    pose = body.at_start()
    x = pose.position + rows[:, : grid.dim] @ pose.rotation.T
    lower, size = np.array(grid.lower), grid.cell * np.array(grid.shape)
    return Balls(np.where(grid.periodic, lower + (x - lower) % size, x), rows[:, 3])


def _is_near_blocks(scene: Scene, solid: Array, body: Body) -> bool:
    """True if a body could reach a block, given the rows of the blocks as of `obstacles`."""
    x = np.array(body.position)[None]
    far = [_from_box(x, row[: scene.dim], row[3 : 3 + scene.dim])[0] for row in solid]
    return bool(far) and (any(scene.grid.periodic) or min(far) < reach(body.shape))


def _are_near(scene: Scene, i: int, j: int) -> bool:
    """True if two bodies could reach each other, or their images."""
    one, other = scene.bodies[i], scene.bodies[j]
    periods = np.where(scene.grid.periodic, scene.grid.cell * np.array(scene.grid.shape), np.inf)
    arm = nearest(np.array(one.position) - np.array(other.position), periods)
    return float(np.linalg.norm(arm)) < reach(one.shape) + reach(other.shape)


def _in_wall(scene: Scene, k: int, axis: int, i: int, balls: Balls) -> Iterator[Overlap]:
    """Yield the overlap with a wall normal to an axis, extended beyond an end of the domain."""
    grid, wall = scene.grid, scene.walls[k]
    row, (at, _) = row_of_wall(grid, wall), wall.extent(grid, axis)
    lower, upper = row[: grid.dim], row[3 : 3 + grid.dim]
    if wall.opens_at == 0:
        return
    if lower[axis] < upper[axis]:
        phi = _from_box(balls.x, lower, upper)
        deepest = int(np.argmax(balls.radius - phi))
        depth, place = float(balls.radius[deepest] - phi[deepest]), balls.x[deepest].copy()
        place[axis] += balls.radius[deepest] * (1 if lower[axis] == at else -1)
    else:
        depth, place = _across(scene, wall, axis, i, balls)
    yield Overlap(f"walls[{k}], normal to {AXES[axis]} at {at:.9g} m", depth, place)


def _from_box(x: Array, lower: Array, upper: Array) -> Array:
    """Signed distance of points from a box."""
    beyond = np.maximum(lower - x, x - upper)
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=1)
    distance: Array = outside + np.minimum(beyond.max(axis=1), 0.0)
    return distance


def _across(
    scene: Scene, wall: WallOrBlock, normal: int, i: int, balls: Balls
) -> tuple[float, Array]:
    """Reach beyond a wall within the grid of a body that it cuts, and a common point.

    It is the part on the side on which it is smaller; 0 for a body that the wall does not meet.
    """
    grid, body = scene.grid, scene.bodies[i]
    half, position, axes = body.extents(), np.array(body.position), []
    for axis in range(grid.dim):
        low, high = wall.extent(grid, axis)
        if not grid.periodic[axis] and axis != normal:
            low = max(low, position[axis] - half[axis])
            high = min(high, position[axis] + half[axis])
        if high < low:
            return 0.0, position
        step = max(SPACING * grid.cell, (high - low) / MOST_ACROSS[grid.dim])
        axes.append(np.linspace(low, high, math.ceil((high - low) / step) + 1))
    places = combined(axes)
    phi = distance_at(scene.grid, body, places, body.at_start())
    deepest = int(phi.argmin())
    within = min(OVERLAP * grid.cell, 0.25 * min(thicknesses(body.shape)))
    if phi[deepest] > -within:
        return max(-float(phi[deepest]), 0.0), places[deepest]
    off = balls.x[:, normal] - wall.extent(grid, normal)[0]
    return float(min((balls.radius - off).max(), (balls.radius + off).max())), places[deepest]


def _in_blocks(scene: Scene, body: Body) -> Iterator[Overlap]:
    """Yield the overlap with the union of the blocks, which are extended beyond the ends of the
    grid.

    It is evaluated at points at the depth in the body that counts, and at points of its surface
    that are surrounded by blocks to this distance.
    """
    grid, pose = scene.grid, body.at_start()
    most = OVERLAP * grid.cell
    local, depth = places_of(scene, body, (1 + MARGIN) * most)
    x = pose.position + local @ pose.rotation.T
    solid, last = solid_cells(grid, scene.walls), np.array(grid.shape) - 1

    def within(places: Array) -> BoolArray:
        at = np.floor((places - np.array(grid.lower)) / grid.cell)
        at = np.where(grid.periodic, at % grid.shape, at).clip(0, last)
        inside: BoolArray = solid.at(at.astype(np.intp).T)
        return inside

    reaches = within(x)
    surrounded = reaches.copy()
    for step in product((-1.0, 1.0), repeat=grid.dim):
        surrounded[surrounded] = within(x[surrounded] + (1 + MARGIN) * most * np.array(step))
    depth = np.where(
        surrounded, np.maximum(depth, (1 + MARGIN) * most), np.where(reaches, depth, 0)
    )
    if len(depth):
        deepest = int(depth.argmax())
        yield Overlap(_block_at(scene, x[deepest]), float(depth[deepest]), x[deepest])


def _block_at(scene: Scene, x: Array) -> str:
    """Name of the block that contains a point, extended beyond an end of the grid."""
    grid = scene.grid
    lower, size = np.array(grid.lower), grid.cell * np.array(grid.shape)
    inside = np.where(grid.periodic, lower + (x - lower) % size, x.clip(lower, lower + size))[None]
    far = {
        k: float(_from_box(inside, *wall.corners(grid))[0])
        for k, wall in enumerate(scene.walls)
        if wall.is_block
    }
    return f"walls[{min(far, key=far.__getitem__)}], a Solid"


def _in_body(scene: Scene, i: int, j: int, balls: Sequence[Balls]) -> Iterator[Overlap]:
    """Yield the overlap of two bodies, evaluated at the sample points of both."""
    for one, other in ((i, j), (j, i)):
        x, radius = balls[one]
        if not len(x):
            continue
        body = scene.bodies[other]
        phi, normal = surface_at(scene.grid, body, x, body.at_start())
        deepest = int(np.argmax(radius - phi))
        place = x[deepest] - radius[deepest] * normal[deepest]
        yield Overlap(f"bodies[{j}]", float(radius[deepest] - phi[deepest]), place)
