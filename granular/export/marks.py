"""Marks on the surfaces of bodies that turn, by which their turning is seen."""

from __future__ import annotations

import numpy as np

from granular.export.outlines import Patches
from granular.tools.arrays import IndexArray

NEAR = 1e-9
"""Distance from a plane within which a vertex lies on it, over the size of the surface."""


def marked(patches: Patches) -> tuple[Patches, IndexArray]:
    """Split a surface along the coordinate planes of its body, and mark every other part.

    The planes meet where the body turns, so that with any axis the parts look like the sectors of a
    wheel in a crash test. The mark, shape (polygons,), is 1 where an odd number of the coordinates
    is positive, and 0 elsewhere.
    """
    vertices, polygons = patches
    for axis in range(3):
        vertices, polygons = _split(vertices, polygons, axis)
    middles = [vertices[list(polygon)].mean(axis=0) for polygon in polygons]
    return (vertices, polygons), (np.reshape(middles, (-1, 3)) > 0).sum(axis=1) % 2


def _split(vertices: np.ndarray, polygons: list[tuple[int, ...]], axis: int) -> Patches:
    """Split convex polygons along the plane at 0 of an axis."""
    along = vertices[:, axis]
    side = np.where(abs(along) > NEAR * np.ptp(vertices, axis=0).max(), np.sign(along), 0.0)
    cuts: list[np.ndarray] = []
    whole: list[tuple[int, ...]] = []
    for polygon in polygons:
        sides = side[list(polygon)]
        if sides.min() * sides.max() >= 0:
            whole.append(polygon)
            continue
        halves: dict[float, list[int]] = {-1.0: [], 1.0: []}
        for i, j in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
            for sign, half in halves.items():
                if side[i] != -sign:
                    half.append(i)
            if side[i] * side[j] < 0:
                share = along[i] / (along[i] - along[j])
                for half in halves.values():
                    half.append(len(vertices) + len(cuts))
                cuts.append(vertices[i] + share * (vertices[j] - vertices[i]))
        whole += [tuple(half) for half in halves.values()]
    return np.concatenate([vertices, np.reshape(cuts, (-1, 3))]), whole
