"""Positions that the material, blocks and bodies of a scene occupy at the start."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from granular.model.grid import combined
from granular.mpm.body_distances import distances
from granular.tools.arrays import Array, BoolArray

if TYPE_CHECKING:
    from granular.mpm.scene import Scene


MOST_PLACES = (5, 40)
"""Cells along an axis that `is_full` looks at, first few and then more; the ends are among them."""


def is_full(scene: Scene) -> bool:
    """True if fills, blocks and bodies leave none of the sampled cells empty at the start."""
    return all(_leave_none(scene, most) for most in MOST_PLACES)


def _leave_none(scene: Scene, most: int) -> bool:
    """True if none is left of some cells along each axis, `most` at most."""
    grid, axes = scene.grid, []
    for low, cells in zip(grid.lower, grid.shape, strict=True):
        at = np.unique(np.linspace(0, cells - 1, min(cells, most)).round())
        axes.append(low + grid.cell * (at + 0.5))
    places = combined(axes)
    empty = places[~_in_fills(scene, places)]
    return not _outside(scene, empty).any()


def has_material(scene: Scene, places: Array) -> BoolArray:
    """True for positions of shape (n, dim) with material at the start: not in blocks or bodies."""
    inside = _in_fills(scene, places)
    inside[inside] = _outside(scene, places[inside])
    return inside


def _in_fills(scene: Scene, places: Array) -> BoolArray:
    inside = np.zeros(len(places), dtype=bool)
    for fill in scene.fills:
        inside[~inside] = fill.region.contains(places[~inside])
    return inside


def _outside(scene: Scene, places: Array) -> BoolArray:
    """True for positions outside of blocks and bodies."""
    outside = np.ones(len(places), dtype=bool)
    for wall in scene.walls:
        outside &= ~wall.encloses(scene.grid, places)
    for body in scene.bodies:
        if not outside.any():
            break
        left = np.pad(places[outside], ((0, 0), (0, 3 - body.dim)))
        outside[outside] = distances(scene.grid, body, left) > 0
    return outside


def middle_points(scene: Scene, lower: Array, upper: Array) -> Array:
    """Centres of the cells between two corners [m], shape (n, dim)."""
    grid, axes = scene.grid, []
    for zero, cells, low, high in zip(grid.lower, grid.shape, lower, upper, strict=True):
        middle = zero + grid.cell * (np.arange(cells) + 0.5)
        axes.append(middle[(middle > low) & (middle < high)])
    return combined(axes)
