"""Codes of the cells of the grid: which are solid, near outlets, or at walls.

The core has one byte of flags for each cell, as a map (`GridMap`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.model.grid import Grid
from granular.mpm.grid_map import GridMap, Ranges
from granular.mpm.schemes import ParticleDensity
from granular.mpm.walls import ABOVE, BELOW, WallOrBlock
from granular.tools.arrays import Array

if TYPE_CHECKING:
    from granular.mpm.scene import Scene


_ENUMERATIONS = _core.enumerations()
FLAG_SOLID, FLAG_NO_SHIFTING, FLAG_WALL = (
    _ENUMERATIONS["cell_flag"][name] for name in ("solid", "no_shifting", "wall")
)
FACE_LINK, FACE_OPEN, FACE_ROUGH = (
    _ENUMERATIONS["face"][name] for name in ("link", "open", "rough")
)


def _faces(scene: Scene) -> Iterator[tuple[Array, Array, int, int, WallOrBlock]]:
    """Yield the faces of walls and blocks: lower and upper corner [m], axis, sides, owner."""
    for wall in scene.boundaries:
        yield from ((*face, wall) for face in wall.faces(scene.grid))


class _Cells:
    """Cells of a grid, and the selection of cells by position.

    With `on_nodes` the cells are centred on the grid nodes.
    """

    def __init__(self, grid: Grid, on_nodes: bool = False) -> None:
        self.cell, self.half = grid.cell, 0.5 * grid.cell * on_nodes
        self.shape = [
            n + (on_nodes and not p) for n, p in zip(grid.shape, grid.periodic, strict=True)
        ]
        self.centre = [
            grid.lower[d] + (np.arange(n) + (0.0 if on_nodes else 0.5)) * grid.cell
            for d, n in enumerate(self.shape)
        ]

    def within(self, lower: Array, upper: Array) -> Ranges:
        """Indices of the cells whose centre lies between two corners [m]."""
        return tuple(
            np.flatnonzero((x > low) & (x < high))
            for x, low, high in zip(self.centre, lower, upper, strict=True)
        )

    def at_face(
        self, low: Array, high: Array, axis: int, sides: int
    ) -> Iterator[tuple[int, Ranges]]:
        """Yield (0, cells above a face) and (1, cells below it), as far as `sides` has them.

        The number is the end of these cells at which the face lies: 0 for low, 1 for high.
        """
        across = self.cell * (np.arange(len(low)) == axis)
        if sides & ABOVE:
            yield 0, self.within(low - self.half, high + across + self.half)
        if sides & BELOW:
            yield 1, self.within(low - across - self.half, high + self.half)


def cell_flags(scene: Scene) -> GridMap:
    """Flags of the cells by which points are grouped: solid, no particle shifting, walls at faces.

    Particle shifting is off in cells near an outlet, a wall that opens.
    """
    grid = scene.grid
    # With "ugimp" points are grouped by the nearest node.
    cells = _Cells(grid, on_nodes=scene.scheme.basis == "ugimp")
    flagged = list(_flagged(scene, cells))
    flags = GridMap.zeros(cells.shape, (where for where, _ in flagged))
    for where, flag in flagged:
        flags.values[flags.of(where)] |= flag
    return flags


def _flagged(scene: Scene, cells: _Cells) -> Iterator[tuple[Ranges, int]]:
    """Yield cells and the flag that they have."""
    for low, high, axis, sides, _ in _faces(scene):
        for side, where in cells.at_face(low, high, axis, sides):
            yield where, FLAG_WALL << 2 * axis + side
    density = scene.scheme.density
    for wall in scene.walls:
        low, high = wall.corners(scene.grid)
        if wall.is_block:
            yield cells.within(low, high), FLAG_SOLID
        elif wall.opens_at < math.inf and not isinstance(density, ParticleDensity):
            reach = density.shifting_outlet_cells * scene.grid.cell
            yield cells.within(low - reach, high + reach), FLAG_NO_SHIFTING


def fluidity_faces(scene: Scene) -> NDArray[np.uint8]:
    """Boundary conditions of the fluidity on the low and high faces of the cells along each axis.

    On a no-slip wall g = 0, on any other wall its flux is zero (dg/dn = 0). A wall that opens at
    some time has no effect on the fluidity, not even before.

    Returns
    -------
    ndarray of uint8, shape (2 dim, ..., n_y, n_x)
        0: linked to the next cell, 1: no flux, 2: g = 0.
    """
    cells = _Cells(scene.grid)
    faces = np.zeros((2 * scene.grid.dim, *cells.shape[::-1]), dtype=np.uint8)
    for low, high, axis, sides, wall in _faces(scene):
        if wall.opens_at < math.inf:
            continue
        kind = FACE_ROUGH if wall.rule.sticks else FACE_OPEN
        for side, where in cells.at_face(low, high, axis, sides):
            face, places = faces[2 * axis + side], np.ix_(*where[::-1])
            face[places] = np.maximum(face[places], kind)
    return faces
