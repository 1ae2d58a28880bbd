"""Surfaces of triangles as solids: their signed distance, sampled once in a band about them."""

from __future__ import annotations

import os
import warnings
from dataclasses import KW_ONLY, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granular.shapes.mesh_files import read_surface
from granular.shapes.mesh_samples import BAND, CUBE, MOST_BLOCKS, THIN, Tables, sampled
from granular.shapes.mesh_surface import MeshWarning, mended, solids
from granular.shapes.shape import Cover, Shape, row_of
from granular.shapes.triangles import Triangles
from granular.tools.arrays import Array, IntArray
from granular.tools.checks import positive, real_array, set_fields
from granular.tools.serializable import ComparedByContent

MOST_COARSE = 2**25
"""Number of coarse samples at most: 0.1 GB."""
MOST_FACES = 30_000_000
"""Number of triangles at most: their tree takes 8 GB."""
MILLIMETRE = 1e-3
ROUNDED = 0.1
"""Error of positions, in spacings, from which a warning is raised."""


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(ComparedByContent, Shape):
    """A surface of triangles in 3D: closed, or a sheet.

    A closed surface may have several parts. The solid is the union of the solids that they enclose,
    whether they are apart, overlap or lie within each other, less the cavities: parts within a
    solid whose triangles are clockwise as seen from outside. Triangles that do not agree with their
    neighbours and parts that are inside out are reversed, and duplicate triangles are left out,
    each with a `MeshWarning`; the fields then hold the repaired surface.

    Its signed distance is exact at the points of a sampling grid, with the sign of the winding
    number (Jacobson et al. 2013), and linear in between, which rounds edges by about one spacing.
    Samples are stored within 6 spacings of the surface, in blocks; farther away there is a lower
    bound of the right sign. A surface of area A takes some 180 A/spacing^2 bytes. It is sampled
    when it is first needed, and once for equal meshes in a process. If the environment variable
    ``GRANULAR_CACHE`` names a folder, the samples are also stored there, for later processes.

    1.3 million triangles on a ball 100 spacings wide take 10 s of one core and 0.5 GB, of which
    5 MB remain; 16 s and 0.6 GB with 200 spacings (``benchmarks/speed/mesh_setup.py``).

    Walls, and the body as a whole, must be two spacings thick at least, or their inside would fall
    between the samples. The thickness is measured when the surface is sampled. Edges that taper by
    more than 8 degrees do not count, and neither do walls on less than 1 % of the surface.

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
        the inside.
    {raises}; also for a surface without a thickness that is not
        closed or cannot be oriented. Walls thinner than two spacings are detected when it is
        sampled.

    Warns
    -----
    MeshWarning
        If triangles were reversed or left out, and for closed parts within others that do not
        change the solid.
    """

    vertices: Array
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
            faces, changes = mended(vertices, faces)
            faces.flags.writeable = False
            if changes:
                warnings.warn(f"faces: {'; '.join(changes)}", MeshWarning, stacklevel=3)
        elif positive("thickness", thickness) < THIN * spacing:
            raise ValueError(f"thickness = {thickness} must be >= {THIN:g} spacings of {spacing} m")
        else:
            thickness = float(thickness)
        set_fields(self, vertices=vertices, faces=faces, spacing=spacing, thickness=thickness)
        self._check_spacing()

    def _check_spacing(self) -> None:
        """Refuse a spacing that needs too many samples, or is wider than half the body."""
        half, spacing = self._about[1], self.spacing
        least = 2 * float(half.min())
        if least < THIN * spacing * (1 - 1e-9):
            raise ValueError(
                f"spacing = {spacing} must be <= {least / THIN:.4g} m, half the least edge of the "
                f"box about it, of {2 * half} m"
            )
        cells = self.sampling_grid()[1]
        blocks = self._area() / (CUBE * spacing) ** 2 * 4  # a band of 4 blocks
        if np.prod(cells + 1.0) > MOST_COARSE or blocks > MOST_BLOCKS or cells.max() > 100_000:
            raise ValueError(
                f"spacing = {spacing} must leave {MOST_BLOCKS} blocks of {CUBE} spacings at most on"
                f" {self._area():.4g} m2 and {MOST_COARSE} in a box of {2 * half} m; if lengths are"
                f" in millimetres, scale them by {MILLIMETRE}"
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
        """Read a surface from a file: STL, OBJ, PLY or OFF.

        Equal vertices are merged, and triangles of two equal vertices are left out. Only this file
        is read, not the materials and textures that it refers to.

        Parameters
        ----------
        path : path
            File of 1 GB at most.
        spacing, thickness
            As in `Mesh`, in metres.
        scale : float
            Unit of length of the file in metres, > 0: 0.001 for millimetres.

        Raises
        ------
        ModuleNotFoundError
            If trimesh is not installed: ``pip install granular-flow[meshes]``.
        OSError
            If the file cannot be read.
        ValueError
            As for `Mesh`, naming the path too, or if it is no file of these formats with a surface;
            also for coordinates so large that the file, which has 24 bits for each, rounds them by
            more than the spacing.

        Warns
        -----
        MeshWarning
            As for `Mesh`; also for coordinates that the file rounds by more than a tenth of the
            spacing.
        """
        scale, spacing = positive("scale", scale), positive("spacing", spacing)
        vertices, faces, rounding = read_surface(path)
        if scale * rounding > ROUNDED * spacing:
            warning = (
                f"path = {str(path)!r} rounds positions by {scale * rounding:.3g} m, more than "
                f"{'' if scale * rounding > spacing else 'a tenth of '}spacing = {spacing}: its "
                f"coordinates of up to {scale * abs(vertices).max():.3g} m are single precision; "
                "shift it to the origin before it is written, or write another format"
            )
            if scale * rounding > spacing:
                raise ValueError(warning)
            warnings.warn(warning, MeshWarning, stacklevel=2)
        try:
            return cls(scale * vertices, faces, spacing=spacing, thickness=thickness)
        except ValueError as error:
            raise ValueError(f"path = {str(path)!r}: {error}") from error

    @property
    def dim(self) -> int:
        return 3

    @property
    def band(self) -> float:
        """Distance from the surface up to which it is known exactly [m]."""
        return BAND * self.spacing

    @cached_property
    def _about(self) -> tuple[Array, Array]:
        """Middle and half lengths of a box about the solid [m]."""
        used = np.zeros(len(self.vertices), dtype=bool)
        used[self.faces] = True
        low, high = (side(self.vertices[used], axis=0) for side in (np.min, np.max))
        return 0.5 * (low + high), 0.5 * (high - low) + 0.5 * (self.thickness or 0.0)

    def _area(self) -> float:
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())

    def rows(self) -> Array:
        middle, half = self._about
        return row_of("sampled", False, tuple(middle), np.eye(3), half)[None]

    def samples(self) -> tuple[Tables, ...]:
        return (sampled(self),)

    def covers(self) -> list[Cover]:
        middle, half = self._about
        return [Cover.of(tuple(middle), np.eye(3), tuple(half))]

    def _breadth(self) -> float:
        return float(sampled(self)[0][4])

    def triangles(self) -> Triangles:
        """Make the tree of the triangles, for exact distances."""
        closed = self.thickness is None
        parts = solids(self.vertices, self.faces) if closed else None
        return Triangles(self.vertices, self.faces, parts, self.thickness or 0.0)

    def sampling_grid(self) -> tuple[Array, IntArray]:
        """Lower corner from the middle of the body, and coarse cells along each axis.

        The sampling grid extends a band beyond the solid.
        """
        _, half = self._about
        wide = CUBE * self.spacing
        cells = np.ceil((2 * half + 2 * BAND * self.spacing) / wide - 1e-9).astype(np.int64)
        return np.asarray(-0.5 * wide * cells, dtype=np.float64), cells


def _checked_faces(value: ArrayLike, count: int) -> NDArray[np.int32]:
    faces = np.asarray(value)
    if faces.size == 0:
        raise ValueError("faces = () must hold a surface")
    if len(faces) > MOST_FACES:
        raise ValueError(f"faces: {len(faces)} triangles must be {MOST_FACES} at most")
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
