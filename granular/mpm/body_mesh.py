"""Surfaces of triangles as bodies: their signed distance, sampled once in a band about them."""

from __future__ import annotations

import os
import tempfile
from collections import OrderedDict
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granular import _core
from granular.checks import positive, real_array, set_fields
from granular.mpm.body_shapes import Shape, row_of
from granular.running import bar
from granular.serializable import ComparedByContent

__all__ = ["Mesh"]

Array = NDArray[np.float64]
Tables = tuple[NDArray, ...]
"""Grid (4,), coarse samples, blocks, fine samples and edges; see `csrc/body/samples.h`."""

CUBE = 8
"""Spacings along an edge of a block; as in `csrc/body/samples.h`."""
BAND = 6
"""Spacings from the surface within which all samples are fine; as in `csrc/body/samples.c`.

With the spacing recommended they are the 1.5 cells within which points have feet on a surface.
"""
MOST_COARSE, MOST_BLOCKS = 2**25, 400_000
"""Number of coarse samples and of blocks at most: 0.1 GB and 1.5 GB."""
BEND = 0.35
"""Second difference of the distance, in spacings, from which a sample outside is at an edge.

A ball of four spacings has 0.25, an edge of 90 degrees 0.5 to 1.4, one of 30 degrees 0.26 to 0.5.
"""
ON_SURFACE = 1e-3
"""Depth in spacings down to which a sample counts as on the surface: floats are not exactly 0."""
CHUNK = 100_000
"""Places between two checks for signals and steps of the progress bar."""
THIN = 2.0
"""Least thickness of a sheet in spacings: its middle, where the distance has a kink, is inside."""
CACHE = "GRANULAR_CACHE"
FORMAT = 1
"""Version of what is in files of the cache."""
LEAST_SIGNS = 1e-9
"""Least ratio of the volume of a surface to the cube of its size."""


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(ComparedByContent, Shape):
    """A surface of triangles in 3D, in coordinates of its body: closed, or a sheet.

    Its signed distance is exact (Baerentzen & Aanaes 2005) at the places of a sampling grid and
    linear in between, which rounds edges by about one spacing. Samples are kept within 6 spacings
    of the surface, in blocks; farther off there is a lower bound of the right sign. A surface of
    area A takes some 180 A/spacing^2 bytes. It is sampled when a body is first asked for it, and
    once for equal meshes in a process. If the environment variable ``GRANULAR_CACHE`` names a
    folder, the samples are also kept there, for later processes.

    1.3 million triangles on a ball 100 spacings wide take 7 s of one core and 0.3 GB, of which 5 MB
    remain; 15 s and 0.6 GB with 200 spacings (``benchmarks/mesh_setup.py``).

    Parameters
    ----------
    vertices : array_like, shape (k, 3)
        Vertices [m].
    faces : array_like of int, shape (n, 3)
        Indices of the vertices of each triangle, from 0 on, of a closed surface anticlockwise as
        seen from outside.
    spacing : float
        Spacing of the sampling grid [m], > 0; a quarter of a cell of the computational grid is
        recommended. The force on a cube four cells wide that moves through a bed errs by 0.13 %
        with half a cell and by 0.05 % with a quarter. A corner rounder than about three spacings
        counts as smooth, a sharper one as an edge.
    thickness : float, optional
        Thickness [m], >= 2 spacings, of a sheet about the triangles, which then may be open, cross
        each other and have any orientation. By default the surface must be closed, and the solid is
        all that is inside.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range; also for a surface without a thickness that is not
        closed, not oriented or inside out.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    _: KW_ONLY
    spacing: float
    thickness: float | None = None

    def __post_init__(self) -> None:
        vertices = real_array("vertices", self.vertices)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise ValueError(f"vertices of shape {vertices.shape} must have the shape (k, 3)")
        faces = _checked_faces(self.faces, len(vertices))
        spacing, thickness = positive("spacing", self.spacing), self.thickness
        if thickness is None:
            _refuse_open(faces, len(vertices))
            _refuse_inside_out(vertices, faces)
        elif positive("thickness", thickness) < THIN * spacing:
            raise ValueError(f"thickness = {thickness} must be >= {THIN:g} spacings of {spacing} m")
        else:
            thickness = float(thickness)
        set_fields(self, vertices=vertices, faces=faces, spacing=spacing, thickness=thickness)
        cells = self._grid()[1]
        blocks = self._area() / (CUBE * spacing) ** 2 * 4  # a band of 4 blocks
        if np.prod(cells + 1.0) > MOST_COARSE or blocks > MOST_BLOCKS or cells.max() > 100_000:
            raise ValueError(
                f"spacing = {spacing} must leave {MOST_BLOCKS} blocks of {CUBE} spacings at most on"
                f" {self._area():.4g} m2 and {MOST_COARSE} in a box of {2 * self._box[1]} m"
            )

    @classmethod
    def read(
        cls,
        path: str | os.PathLike,
        *,
        spacing: float,
        scale: float = 1.0,
        thickness: float | None = None,
    ) -> Mesh:
        """Read a surface from a file (STL, OBJ, PLY, ...).

        Equal vertices are one, and triangles of two equal vertices are left out.

        Parameters
        ----------
        path : path
            File in a format that trimesh reads.
        spacing, thickness
            As in `Mesh`, in metres.
        scale : float
            Unit of length of the file in metres, > 0.

        Raises
        ------
        ModuleNotFoundError
            If trimesh is not installed: ``pip install granular[meshes]``.
        ValueError
            As for `Mesh`, or if the file holds no surface.
        """
        surface = _trimesh().load_mesh(path)
        if not len(getattr(surface, "faces", ())):
            raise ValueError(f"path = {str(path)!r} must hold a surface of triangles")
        scale = positive("scale", scale)
        vertices, same = np.unique(np.asarray(surface.vertices), axis=0, return_inverse=True)
        faces = same.reshape(-1)[np.asarray(surface.faces)]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        return cls(scale * vertices, faces, spacing=spacing, thickness=thickness)

    @property
    def dim(self) -> int:
        return 3

    @cached_property
    def _box(self) -> tuple[Array, Array]:
        """Middle and half lengths of a box about the solid [m]."""
        used = np.zeros(len(self.vertices), dtype=bool)
        used[self.faces] = True
        low, high = (side(self.vertices[used], axis=0) for side in (np.min, np.max))
        return 0.5 * (low + high), 0.5 * (high - low) + 0.5 * (self.thickness or 0.0)

    def _area(self) -> float:
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    def rows(self) -> Array:
        middle, half = self._box
        return row_of("sampled", False, tuple(middle), np.eye(3), half)[None]

    def samples(self) -> tuple[Tables, ...]:
        return (_sampled(self),)

    def _grid(self) -> tuple[Array, NDArray[np.int64]]:
        """Lower corner from the middle of the body, and coarse cells along each axis.

        The sampling grid extends a band beyond the solid.
        """
        _, half = self._box
        wide = CUBE * self.spacing
        cells = np.ceil((2 * half + 2 * BAND * self.spacing) / wide - 1e-9).astype(np.int64)
        return np.asarray(-0.5 * wide * cells, dtype=np.float64), cells


def _checked_faces(value: ArrayLike, count: int) -> NDArray[np.int32]:
    faces = np.asarray(value)
    if faces.size == 0:
        raise ValueError("faces = () must hold a surface")
    if faces.dtype.kind not in "iu":
        raise TypeError(f"faces of dtype {faces.dtype} must hold indices of vertices")
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(f"faces of shape {faces.shape} must have the shape (n, 3)")
    for bad, rule in (
        ((faces < 0) | (faces >= count), f"be indices from 0 to {count - 1}"),
        (faces == np.roll(faces, 1, axis=1), "be three different vertices"),
    ):
        if bad.any():
            first = int(np.argwhere(bad)[0, 0])
            raise ValueError(f"faces[{first}] = {faces[first].tolist()} must {rule}")
    faces = np.ascontiguousarray(faces, dtype=np.int32).view()
    faces.flags.writeable = False
    return faces


def _edges(faces: NDArray[np.int32], count: int) -> tuple[NDArray, NDArray[np.intp]]:
    """Key of each side of a triangle by its vertices, and an order with equal ones together."""
    start, end = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel()
    key = np.minimum(start, end) * count + np.maximum(start, end)
    return key, np.argsort(key, kind="stable")


def _refuse_open(faces: NDArray[np.int32], count: int) -> None:
    """Refuse a surface unless each edge belongs to two triangles, once in each direction."""
    key, order = _edges(faces, count)
    start, end = faces.ravel()[order], np.roll(faces, -1, axis=1).ravel()[order]
    begins = np.flatnonzero(np.diff(key[order], prepend=-1))
    counts = np.diff(begins, append=len(order))
    up = np.add.reduceat((start < end).astype(np.int64), begins)
    bad = np.flatnonzero((counts != 2) | (up != 1))
    if len(bad):
        first = begins[bad[0]]
        a, b = sorted((int(start[first]), int(end[first])))
        n, one = int(counts[bad[0]]), int(up[bad[0]])
        raise ValueError(
            f"faces: the edge from vertex {a} to {b} belongs to {n} triangles ({one} in this "
            "direction), must be two, of opposite directions: the surface must be closed, or have "
            f"a thickness (edges that are not: {len(bad)} of {len(counts)})"
        )


def _refuse_inside_out(vertices: Array, faces: NDArray[np.int32]) -> None:
    a, b, c = (vertices[faces[:, k]] - vertices[faces[0, 0]] for k in range(3))
    volume = float(np.einsum("ni,ni->", a, np.cross(b, c))) / 6
    if not volume > LEAST_SIGNS * float(np.ptp(a, axis=0).max()) ** 3:
        raise ValueError(
            f"faces: they hold the volume {volume:.4g} m3, must be > 0: anticlockwise as seen "
            "from outside"
        )


def _neighbours(faces: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """Triangle beyond each edge of the triangles of a closed surface."""
    _, order = _edges(faces, count)
    pairs = order.reshape(-1, 2)
    beyond = np.empty(faces.size, dtype=np.int32)
    beyond[pairs[:, 0]], beyond[pairs[:, 1]] = pairs[:, 1] // 3, pairs[:, 0] // 3
    return beyond.reshape(-1, 3)


def _trimesh() -> Any:
    try:
        import trimesh
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error}: files of triangles need trimesh: pip install granular[meshes]"
        ) from error
    return trimesh


# ---- sampling ----

_KEPT: OrderedDict[str, Tables] = OrderedDict()
_MOST_KEPT = 16


def _sampled(mesh: Mesh) -> Tables:
    """Samples of a mesh, from this process, the folder of the cache, or new."""
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
    except Exception:  # whatever is wrong with a file: it is written anew
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
    """Sample a mesh: at coarse places all over, at fine ones in blocks about the surface."""
    middle, _ = mesh._box
    low, cells = mesh._grid()
    h, half = mesh.spacing, 0.5 * (mesh.thickness or 0.0)
    closed = mesh.thickness is None
    beyond = _neighbours(mesh.faces, len(mesh.vertices)) if closed else None
    tree = _core.mesh_tree(mesh.vertices, mesh.faces, beyond)
    fine_counts = CUBE * cells + 1

    def distances(keys: NDArray, counts: NDArray, step: float, what: str) -> Array:
        out = np.empty(len(keys))
        with bar(total=len(keys), desc=what, delay=2.0, disable=None) as done:
            for begin in range(0, len(keys), CHUNK):
                at = _unravelled(keys[begin : begin + CHUNK], counts)
                places = np.ascontiguousarray(low + middle + step * at)
                out[begin : begin + CHUNK] = _core.mesh_distance(tree, places) - half
                done.update(len(places))
        return out

    coarse = distances(np.arange(np.prod(cells + 1)), cells + 1, CUBE * h, "coarse samples")
    coarse = coarse.reshape((cells + 1)[::-1])
    reach = (BAND + 0.5 * np.sqrt(3) * CUBE) * h  # no point of a cell is farther from its middle
    near = _cells_near(coarse, reach)
    places = np.ascontiguousarray(low + middle + CUBE * h * (near[:, ::-1] + 0.5))
    near = near[abs(_core.mesh_distance(tree, places) - half) < reach]
    if len(near) > MOST_BLOCKS:
        raise ValueError(f"spacing = {h} leaves {len(near)} blocks, must be <= {MOST_BLOCKS}")
    block = np.full(cells[::-1], -1, dtype=np.int32)
    block[tuple(near.T)] = np.arange(len(near))
    inside = np.arange(CUBE + 1)
    own = np.stack(np.meshgrid(inside, inside, inside, indexing="ij"), axis=-1)
    at = CUBE * near[:, None, None, None, :] + own  # (z, y, x) of each sample of each block
    numbers = np.ravel_multi_index(tuple(np.moveaxis(at, -1, 0)), fine_counts[::-1])
    keys, place = np.unique(numbers, return_inverse=True)
    place = place.reshape(numbers.shape)
    values = distances(keys, fine_counts, h, "samples").astype(np.float32)
    fine = np.ascontiguousarray(values[place])
    grid = np.array([*low, h])
    tables = (grid, coarse.astype(np.float32), block, fine)
    sharp = _sharp(mesh, tables, keys, values, fine_counts)[place]
    return (*tables, np.ascontiguousarray(sharp))


def _unravelled(keys: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices (x, y, z) of samples from their numbers, x fastest."""
    return np.stack(np.unravel_index(keys, counts[::-1])[::-1], axis=1)


def _cells_near(coarse: Array, reach: float) -> NDArray[np.int64]:
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
    """1 for samples just outside beside a convex edge, 2 beside a concave one, see `BEND`."""
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
