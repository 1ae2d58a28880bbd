"""Distances of positions from bodies on a grid and from their images in periodic directions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from granular import _core
from granular.model.grid import Grid
from granular.model.open_space import Distance, nowhere
from granular.shapes.shape import padded, turned
from granular.tools.arrays import Array

if TYPE_CHECKING:
    from granular.mpm.bodies import Body, BodyState


def periods(grid: Grid, body: Body) -> Array:
    """Periods [m] with which a body has images along x, y and z; inf without images.

    As in the core, there are none along axes on which the body reaches farther than half a period.
    """
    periods = np.full(3, np.inf)
    lengths = grid.cell * np.array(grid.shape)
    reaches = body.extents()[: grid.dim]
    repeats = np.array(grid.periodic) & (2 * reaches <= lengths)
    periods[: grid.dim][repeats] = lengths[repeats]
    return periods


def nearest(arms: NDArray[np.floating], period: float | Array) -> Array:
    """Distances from a body, or vectors, as from its nearest image."""
    finite = np.where(np.isfinite(period), period, 0.0)
    nearest: Array = arms - finite * np.rint(arms / period)
    return nearest


def distances(grid: Grid, body: Body, places: Array) -> Array:
    """Signed distances [m] of positions (n, 3) from a body, or its nearest image, at the start."""
    return _from_body(grid, body, places, turned(body.rotation_deg), padded(body.position))[0]


def distance_at(grid: Grid, body: Body, x: Array, pose: BodyState) -> Array:
    """Signed distances [m] of positions (n, dim) from a body, or its nearest image, in a pose."""
    return surface_at(grid, body, x, pose)[0]


def surface_at(grid: Grid, body: Body, x: Array, pose: BodyState) -> tuple[Array, Array]:
    """Signed distances as of `distance_at`, and the normals of the surface, shape (n, dim)."""
    places = np.pad(x, ((0, 0), (0, 3 - grid.dim)))
    distance, normal = _from_body(grid, body, places, *_placed(pose))
    return distance, normal[:, : grid.dim]


def _placed(pose: BodyState) -> tuple[scipy.spatial.transform.Rotation, tuple[float, ...]]:
    """Rotation and position of a body in 3D."""
    matrix = np.eye(3)
    dim = len(pose.position)
    matrix[:dim, :dim] = pose.rotation
    return scipy.spatial.transform.Rotation.from_matrix(matrix), padded(tuple(pose.position))


def _from_body(
    grid: Grid,
    body: Body,
    places: Array,
    turn: scipy.spatial.transform.Rotation,
    position: Sequence[float],
) -> tuple[Array, Array]:
    """Signed distances [m] of positions (n, 3) from a body, or its nearest image, and normals."""
    local = turn.inv().apply(nearest(places - position, periods(grid, body)))
    rows, samples = body.shape.rows(), body.shape.samples()
    distance, normal = _core.body_distance(rows, samples, np.ascontiguousarray(local))
    return distance, turn.apply(normal)


def distance_from_bodies(
    grid: Grid, bodies: Sequence[Body], states: Sequence[BodyState] = ()
) -> Distance:
    """Make the function of the distance of positions from the nearest body, and its normal.

    Bodies are in the poses of the `states`, or in those at the start.
    """
    if not bodies:
        return nowhere
    dim = grid.dim
    poses = [_placed(state) for state in states] or [
        (turned(body.rotation_deg), padded(body.position)) for body in bodies
    ]

    def distance(x: Array) -> tuple[Array, Array]:
        least, normal = nowhere(x)
        if not len(x):
            return least, normal
        places = np.pad(x, ((0, 0), (0, 3 - dim)))
        for body, (turn, position) in zip(bodies, poses, strict=True):
            phi, away = _from_body(grid, body, places, turn, position)
            nearer = phi < least
            least[nearer], normal[nearer] = phi[nearer], away[nearer, :dim]
        return least, normal

    return distance
