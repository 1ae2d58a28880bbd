"""The body of 3D material between its free surface and its walls, as a mesh with values."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from granular.model.state import State
from granular.plot.fields import Brush
from granular.tools.arrays import BoolArray, IndexArray
from granular.tools.extras import imported

SMOOTHING = 0.75
"""Standard deviation of the smoothing of the filling fraction, in spacings of the points."""
MARGIN = 4
"""Cells around the material: beyond them the smoothed fraction is zero."""


def inside_slab(x: NDArray, slab: tuple[str, float, float] | None) -> BoolArray:
    """True for positions, shape (n, 3), between the ends of a slab."""
    if slab is None:
        return np.ones(len(x), dtype=bool)
    axis, low, high = slab
    along = x[:, "xyz".index(axis)]
    return np.asarray((along >= low) & (along <= high))


def filled_volume(
    state: State, values: NDArray, brush: Brush, slab: tuple[str, float, float] | None
) -> Any:
    """Mesh of where the filling fraction is one half or more, cut by the ends of a slab.

    The volumes of the points, and their values times these, are spread over a grid whose cells have
    the mean spacing of the points, and smoothed. At the sides of the domain the fields are
    continued, and the mesh ends there. None if no cell is filled.
    """
    if not state.n:
        return None
    spacing = float(np.mean(state.volume)) ** (1 / 3)
    lower, counts, edges = _cells(state, spacing)
    x = (state.x - lower) / edges - 0.5
    known = np.isfinite(values)
    amounts = [state.volume, state.volume * known, state.volume * np.where(known, values, 0.0)]
    volume, weight, moment = (
        ndimage.gaussian_filter(_spread(x, amount, counts), SMOOTHING, mode="nearest")
        for amount in amounts
    )
    fraction = volume / np.prod(edges)
    low = brush.norm.vmin or 0.0
    mean = np.divide(moment, weight, out=np.full_like(moment, low), where=weight > 1e-3 * volume)
    mean[weight <= 1e-3 * volume] = np.nan
    # A row of zeros around: between it and the last cells are the sides of the domain.
    image = imported("pyvista", "pictures3d").ImageData(
        dimensions=counts + 2, spacing=tuple(edges), origin=tuple(lower - 0.5 * edges)
    )
    image["filled"] = np.pad(fraction, 1).ravel(order="F")
    image[brush.quantity.title] = np.pad(mean, 1, mode="edge").ravel(order="F")
    mesh = image.clip_scalar(scalars="filled", invert=False, value=0.5)
    if slab is not None and mesh.n_points:
        axis, low_end, high_end = slab
        place = np.eye(3)["xyz".index(axis)]
        mesh = mesh.clip(normal=axis, origin=low_end * place, invert=False)
        mesh = (
            mesh.clip(normal=axis, origin=high_end * place, invert=True) if mesh.n_points else mesh
        )
    if not mesh.n_points:
        return None
    mesh.set_active_scalars(brush.quantity.title)
    return mesh


def _cells(state: State, spacing: float) -> tuple[NDArray, IndexArray, NDArray]:
    """Lower corner, number and edges of cells about the material, which end at the domain's."""
    grid = state.scene.grid
    ends = np.array([grid.lower, grid.upper])
    margin = MARGIN * spacing
    lower = np.maximum(state.x.min(axis=0) - margin, ends[0])
    upper = np.minimum(state.x.max(axis=0) + margin, ends[1])
    counts = np.maximum(np.rint((upper - lower) / spacing).astype(np.intp), 1)
    return lower, counts, (upper - lower) / counts


def _spread(x: NDArray, amount: NDArray, counts: IndexArray) -> NDArray:
    """Sums of amounts over the cells around positions given in cells, by linear weights."""
    total = np.zeros(counts)
    first = np.floor(x).astype(np.intp)
    share = x - first
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, share, 1.0 - share), axis=1)
        at = np.clip(first + corner, 0, counts - 1)
        flat = np.ravel_multi_index(tuple(at.T), tuple(counts))
        total += np.bincount(flat, weight * amount, minlength=total.size).reshape(total.shape)
    return total
