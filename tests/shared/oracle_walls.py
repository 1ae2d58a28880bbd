"""Plain reference for the positions of walls and openings, as the density correction uses them."""

import math

import numpy as np


def faces(scene):
    """Axis, coordinate and extents of the faces of walls and blocks."""
    for wall in scene.boundaries:
        if wall.axis is not None:
            others = set(range(scene.grid.dim)) - {wall.axis}
            yield wall.axis, wall.at, {d: wall.extent(scene.grid, d) for d in others}
        else:
            extents = list(zip(wall.lower, wall.upper, strict=True))
            yield from ((d, at, extents) for d in range(scene.grid.dim) for at in extents[d])


def _beside_walls(scene, middle, reach=0.5):
    """Faces of walls, each with a mask of the cells whose centres lie within `reach` cells."""
    cell, more = scene.grid.cell, (reach - 0.5 + 1e-6) * scene.grid.cell
    for axis, at, extents in faces(scene):
        beside = abs(middle[:, axis] - at) < reach * cell + 1e-6 * cell
        for d in set(range(scene.grid.dim)) - {axis}:
            low, high = extents[d]
            beside &= (middle[:, d] > low - more) & (middle[:, d] < high + more)
        yield axis, at, beside


def alone_at_wall(scene, x):
    """Points at most two in a cell, with a wall among the nodes of the cell."""
    cell, lower = scene.grid.cell, np.array(scene.grid.lower)
    if scene.scheme.basis == "ugimp":  # cells are centred on the nodes
        at, reach = np.floor((x - lower) / cell + 0.5), 1.0
        middle = lower + at * cell
    else:
        at, reach = np.floor((x - lower) / cell), 0.5
        middle = lower + (at + 0.5) * cell
    _, which, count = np.unique(at, axis=0, return_inverse=True, return_counts=True)
    walls = [beside for *_, beside in _beside_walls(scene, middle, reach)]
    return (count[which.ravel()] <= 2) & np.any(walls, axis=0)


def held_at_walls(scene, x, delta):
    """Shift of the points, limited at walls.

    In a cell at a wall the part towards the wall is multiplied by the distance in cells.
    """
    cell, delta = scene.grid.cell, delta.copy()
    middle = scene.grid.lower + (np.floor((x - scene.grid.lower) / cell) + 0.5) * cell
    for a, at, beside in _beside_walls(scene, middle):
        distance = (x[:, a] - at) / cell
        towards = beside & (distance * delta[:, a] < 0)
        delta[:, a] *= np.where(towards, abs(distance), 1.0)
    return delta


def at_face(scene, x, axis, high):
    """Points in cells at whose low or high face along an axis a wall stands."""
    cell, found = scene.grid.cell, np.zeros(len(x), dtype=bool)
    middle = scene.grid.lower + (np.floor((x - scene.grid.lower) / cell) + 0.5) * cell
    for a, at, beside in _beside_walls(scene, middle):
        found |= beside & (a == axis) & ((at > middle[:, a]) == bool(high))
    return found


def near_outlet(scene, x):
    """Points in cells no farther than shifting_outlet_cells from an opening."""
    reach = scene.scheme.density.shifting_outlet_cells * scene.grid.cell
    cell = scene.grid.cell
    middle = scene.grid.lower + (np.floor((x - scene.grid.lower) / cell) + 0.5) * cell
    near = np.zeros(len(x), dtype=bool)
    for wall in scene.boundaries:
        if getattr(wall, "opens_at", math.inf) == math.inf:
            continue
        inside = np.ones(len(x), dtype=bool)
        for d in range(scene.grid.dim):
            low, high = (wall.at, wall.at) if d == wall.axis else wall.extent(scene.grid, d)
            inside &= (middle[:, d] > low - reach) & (middle[:, d] < high + reach)
        near |= inside
    return near
