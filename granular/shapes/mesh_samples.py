"""Sampling of the signed distance of a mesh, and the cache of samples."""

from __future__ import annotations

import os
import tempfile
from collections import OrderedDict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.shapes.shape import row_of
from granular.shapes.triangles import Triangles
from granular.tools.arrays import Array, IntArray
from granular.tools.progress import bar

if TYPE_CHECKING:
    from granular.shapes.mesh import Mesh


Tables = tuple[NDArray, ...]
"""Grid (5,), coarse samples, blocks, fine samples and edges; see `csrc/body/samples.h`.

The grid has the lowest sample, the spacing, and the thickness of the thinnest walls, or of the
largest ball inside if there are none.
"""

CUBE = 8
"""Spacings along an edge of a block; as in `csrc/body/samples.h`."""
BAND = 6
"""Spacings from the surface within which all samples are fine; as in `csrc/body/samples.c`.

With the recommended spacing they are the 1.5 cells within which points have contact points on a
surface.
"""
MOST_BLOCKS = 400_000
"""Number of blocks at most: 1.5 GB."""
THIN = 2.0
"""Least thickness in spacings: the inside of thinner walls may fall between the samples.

Half way between two sides the distance is -1 spacing or less. The error of the interpolation there
is at most the distance of the corners of a cube from its middle, 0.87 spacings, so that the
interpolated distance is negative.
"""
ROUNDING = 0.99
"""Share of this thickness that is sufficient, given the uncertainty of its measurement."""
BEND = 0.35
"""Second difference of the distance, in spacings, from which a sample outside is at an edge.

A ball of four spacings has 0.25, an edge of 90 degrees 0.5 to 1.4, one of 30 degrees 0.26 to 0.5.
"""
ON_SURFACE = 1e-3
"""Depth in spacings down to which a sample counts as on the surface: floats are not exactly 0."""
CHUNK = 100_000
"""Number of points between two checks for signals and steps of the progress bar."""
CACHE = "GRANULAR_CACHE"
FORMAT = 2
"""Version of the contents of files of the cache."""

_KEPT: OrderedDict[str, Tables] = OrderedDict()
_MOST_KEPT = 16


def sampled(mesh: Mesh) -> Tables:
    """Return samples of a mesh, from this process, the folder of the cache, or new."""
    tables = _KEPT.pop(mesh.digest, None)
    if tables is None:
        tables = _read_cache(mesh.digest)
    if tables is None:
        tables = _sample(mesh)
        _write_cache(mesh.digest, tables)
    for table in tables:
        table.flags.writeable = False
    _KEPT[mesh.digest] = tables
    if len(_KEPT) > _MOST_KEPT:
        _KEPT.popitem(last=False)
    return tables


def _cache_file(digest: str) -> Path | None:
    folder = os.environ.get(CACHE)
    return Path(folder) / f"mesh-{FORMAT}-{digest}.npz" if folder else None


def _read_cache(digest: str) -> Tables | None:
    """Return what `_write_cache` stored; a file that is damaged is none."""
    path = _cache_file(digest)
    if path is None or not path.exists():
        return None
    try:
        with np.load(path, allow_pickle=False) as stored:
            tables = tuple(stored[f"arr_{k}"] for k in range(5))
        row = row_of("sampled", False, (0.0,) * 3, np.eye(3), (1.0, 1.0, 1.0))[None]
        _core.body_distance(row, (tables,), np.zeros((1, 3)))
    except Exception:  # a damaged file is written anew
        return None
    return tables


def _write_cache(digest: str, tables: Tables) -> None:
    path = _cache_file(digest)
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, suffix=".tmp")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, *tables)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def _sample(mesh: Mesh) -> Tables:
    """Sample a mesh: at coarse points everywhere, at fine ones in blocks around the surface."""
    low, cells = mesh.sampling_grid()
    h, triangles = mesh.spacing, mesh.triangles()
    middle, fine_counts = triangles.origin, CUBE * cells + 1
    wall, ball = _checked_thickness(triangles, h)

    def distances(keys: NDArray, counts: NDArray, step: float, what: str) -> Array:
        out = np.empty(len(keys))
        with bar(total=len(keys), desc=what, delay=2.0, disable=None) as done:
            for begin in range(0, len(keys), CHUNK):
                at = _unravelled(keys[begin : begin + CHUNK], counts)
                places = np.ascontiguousarray(low + middle + step * at)
                out[begin : begin + CHUNK] = triangles.distance(places)
                done.update(len(places))
        return out

    coarse = distances(np.arange(np.prod(cells + 1)), cells + 1, CUBE * h, "coarse samples")
    coarse = coarse.reshape((cells + 1)[::-1])
    reach = (BAND + 0.5 * np.sqrt(3) * CUBE) * h  # no point of a cell is farther from its middle
    near = _cells_near(coarse, reach)
    places = np.ascontiguousarray(low + middle + CUBE * h * (near[:, ::-1] + 0.5))
    near = near[abs(triangles.distance(places)) < reach]
    block, numbers = _blocks(near, cells, fine_counts, h)
    keys, place = np.unique(numbers, return_inverse=True)
    place = place.reshape(numbers.shape)
    values = distances(keys, fine_counts, h, "samples").astype(np.float32)
    fine = np.ascontiguousarray(values[place])
    deepest = -float(min(coarse.min(), values.min(initial=0.0)))
    grid = np.array([*low, h, min(wall, max(ball, 2 * deepest))])
    tables = (grid, coarse.astype(np.float32), block, fine)
    sharp = _sharp(mesh, tables, keys, values, fine_counts)[place]
    return (*tables, np.ascontiguousarray(sharp))


def _blocks(
    near: IntArray, cells: IntArray, counts: IntArray, spacing: float
) -> tuple[NDArray[np.int32], IntArray]:
    """Block of each coarse cell, -1 where there is none, and the numbers of the samples of each."""
    if len(near) > MOST_BLOCKS:
        raise ValueError(f"spacing = {spacing} leaves {len(near)} blocks, must be <= {MOST_BLOCKS}")
    block = np.full(cells[::-1], -1, dtype=np.int32)
    block[tuple(near.T)] = np.arange(len(near))
    inside = np.arange(CUBE + 1)
    offsets = np.stack(np.meshgrid(inside, inside, inside, indexing="ij"), axis=-1)
    at = CUBE * near[:, None, None, None, :] + offsets  # (z, y, x) of each sample of each block
    return block, np.ravel_multi_index(tuple(np.moveaxis(at, -1, 0)), counts[::-1])


def _checked_thickness(triangles: Triangles, spacing: float) -> tuple[float, float]:
    """Measure the thickness, and refuse a sampling that loses the inside."""
    wall, ball = triangles.thickness()
    if (thickness := min(wall, ball)) < THIN * spacing * ROUNDING:
        raise ValueError(
            f"spacing = {spacing} must be <= {thickness / THIN:.3g} m, half the thickness of the "
            f"thinnest walls, {thickness:.3g} m: with fewer samples they would have holes"
        )
    return wall, ball


def _unravelled(keys: IntArray, counts: IntArray) -> IntArray:
    """Indices (x, y, z) of samples from their numbers, x fastest."""
    return np.stack(np.unravel_index(keys, counts[::-1])[::-1], axis=1)


def _cells_near(coarse: Array, reach: float) -> IntArray:
    """Coarse cells (z, y, x), some of whose corners are nearer to the surface than `reach`."""
    close = abs(coarse) < reach
    for axis in range(3):
        before = (slice(None),) * axis
        low, high = (*before, slice(None, -1)), (*before, slice(1, None))
        close = close[low] | close[high]
    return np.argwhere(close)


def _sharp(
    mesh: Mesh, tables: Tables, keys: NDArray, values: NDArray, counts: NDArray
) -> NDArray[np.uint8]:
    """1 for samples just outside of a convex edge, 2 of a concave one, see `BEND`."""
    sharp, h = np.zeros(len(keys), dtype=np.uint8), mesh.spacing
    chosen = np.flatnonzero((values > -ON_SURFACE * h) & (values < h))
    places = tables[0][:3] + h * _unravelled(keys[chosen], counts)
    row = row_of("sampled", False, (0.0,) * 3, np.eye(3), np.full(3, h))[None]
    empty = (*tables, np.zeros(tables[3].shape, dtype=np.uint8))
    for axis in np.eye(3):
        sides = (_core.body_distance(row, (empty,), places + s * h * axis)[0] for s in (-1, 1))
        bend = sum(sides) - 2.0 * values[chosen]
        sharp[chosen] |= (bend > BEND * h) * np.uint8(1) | (bend < -BEND * h) * np.uint8(2)
    return sharp
