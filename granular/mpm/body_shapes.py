"""Shapes of rigid bodies, each with its description for the core.

A 2D scene is a section of one that is endless along z: a box is infinite along z there, and a disc
is a cylinder.
"""

from __future__ import annotations

import math
import os
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from granular import _core
from granular.checks import (
    check_fields,
    finite,
    integer,
    positive,
    set_fields,
    truth,
    vector,
)
from granular.geometry import combined

__all__ = ["Box", "Cylinder", "HalfSpace", "Mesh", "Shape"]

Array = NDArray[np.float64]

MOST_SHAPES = 256
MOST_SAMPLES = 2_000_000
PARTS = _core.enumerations()["part"]
"""Number of each kind of part in the core."""


def rotation_of(name: str, value: object, dim: int) -> float | tuple[float, ...]:
    """Check a rotation [degrees]: an angle in 2D, a rotation vector in 3D; 0 is none in both."""
    is_angle = dim == 2 or (isinstance(value, (int, float)) and value == 0)
    return finite(name, value) if is_angle else vector(name, value, 3)


def turned(rotation: float | tuple[float, ...]) -> Rotation:
    """Make a rotation from an angle or a rotation vector [degrees]; 0.0 is no rotation in 3D."""
    return Rotation.from_rotvec(
        (0.0, 0.0, rotation) if isinstance(rotation, float) else rotation, degrees=True
    )


def padded(value: Sequence[float]) -> tuple[float, ...]:
    """Return 3 components; a vector of 2 gets z = 0."""
    return (*value, 0.0)[:3]


def row_of(
    kind: str,
    inside: bool = False,
    center: Sequence[float] = (0.0, 0.0, 0.0),
    matrix: Array | None = None,
    size: Iterable[float] = (0.0, 0.0, 0.0),
) -> Array:
    """Return the 17 numbers of a part: kind, inside, centre, rotation matrix, size."""
    turn = np.eye(3) if matrix is None else matrix
    return np.array([PARTS[kind], inside, *padded(center), *turn.ravel(), *size], dtype=float)


def axes_about(normal: Sequence[float]) -> Array:
    """Rotation matrix whose third column is along `normal`; in 2D the second one is along z."""
    third = np.array(padded(normal)) / np.linalg.norm(normal)
    if len(normal) == 2:
        return np.column_stack([[-third[1], third[0], 0.0], [0.0, 0.0, 1.0], third])
    first = np.cross(np.eye(3)[np.argmin(np.abs(third))], third)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(third, first), third])


def direction(name: str, value: object, dim: int | None = None) -> tuple[float, ...]:
    """Check a vector that must not be zero."""
    found = vector(name, value, dim)
    if not math.hypot(*found) > 0:
        raise ValueError(f"{name} = {found} must not be zero")
    return found


class Shape(ABC):
    """A shape of a rigid body."""

    @property
    @abstractmethod
    def dim(self) -> int:
        """Dimension, 2 or 3."""

    @abstractmethod
    def rows(self) -> Array:
        """Return the description of the shape for the core, shape (parts, 17)."""

    def samples(self) -> tuple[Array, ...]:
        """Return the arrays of the rows that need one, in their order.

        They are sampled signed distances [m], shape (z, y, x), negative inside, or the vertices [m]
        of a polygon, shape (1, n, 2).
        """
        return ()

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Signed distance to the surface, and the outward normal there.

        Parameters
        ----------
        x : ndarray, shape (n, dim)
            Positions [m] in coordinates of the body.

        Returns
        -------
        distance : ndarray, shape (n,)
            Distance [m], negative in the solid.
        normal : ndarray, shape (n, dim)

        Raises
        ------
        ValueError
            If positions are not finite or have another dimension.
        """
        x = np.asarray(x, dtype=float)
        if x.ndim != 2 or x.shape[1] != self.dim or not np.isfinite(x).all():
            raise ValueError(f"x of shape {x.shape} must be finite of shape (n, {self.dim})")
        places = np.zeros((len(x), 3))
        places[:, : self.dim] = x
        distance, normal = _core.body_distance(self.rows(), self.samples(), places)
        return distance, np.ascontiguousarray(normal[:, : self.dim])


@dataclass(frozen=True)
class Box(Shape):
    """A box, in coordinates of its body.

    Parameters
    ----------
    size : tuple of float, length dim
        Lengths of the edges [m], > 0, may be infinite.
    center : tuple of float, length dim, optional
        Centre [m]; the position of the body by default.
    rotation_deg : float or tuple of 3 floats
        Rotation about the centre: an angle in 2D, a rotation vector in 3D [degrees].

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    size: tuple[float, ...]
    _: KW_ONLY
    center: tuple[float, ...] = None  # type: ignore[assignment]  # a place once made
    rotation_deg: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        size = vector("size", self.size, check=partial(positive, allow_inf=True))
        center = (0.0,) * len(size) if self.center is None else self.center
        set_fields(self, size=size, center=vector("center", center, len(size)))
        check_fields(self, rotation_of, "rotation_deg", dim=len(size))

    @property
    def dim(self) -> int:
        return len(self.size)

    def rows(self) -> Array:
        half = [edge / 2 for edge in self.size] + [math.inf]
        matrix = turned(self.rotation_deg).as_matrix()
        return row_of("box", False, self.center, matrix, half[:3])[None]


@dataclass(frozen=True)
class Cylinder(Shape):
    """A cylinder, in coordinates of its body; in 2D a disc.

    Parameters
    ----------
    radius : float
        Radius [m], > 0.
    length : float
        Length along the axis [m], > 0 or infinite; must be infinite in 2D.
    center : tuple of float, length dim
        Centre [m].
    axis : tuple of 3 floats, optional
        Direction of the axis, of any length; None in 2D.
    inside : bool
        If True, the material is inside, as in a drum: the solid is all that lies outside of the
        surface.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    radius: float
    _: KW_ONLY
    center: tuple[float, ...]
    axis: tuple[float, ...] | None = None
    length: float = math.inf
    inside: bool = False

    def __post_init__(self) -> None:
        center = vector("center", self.center)
        length = positive("length", self.length, allow_inf=True)
        axis = self.axis
        if len(center) == 2 and (axis is not None or math.isfinite(length)):
            raise ValueError(f"axis = {axis} and length = {length} must be None and inf in 2D")
        if len(center) == 3:
            axis = direction("axis", axis, 3)
        set_fields(self, center=center, axis=axis, length=length)
        check_fields(self, positive, "radius")
        check_fields(self, truth, "inside")

    @property
    def dim(self) -> int:
        return len(self.center)

    def rows(self) -> Array:
        matrix = np.eye(3) if self.axis is None else axes_about(self.axis)
        size = (self.radius, self.length / 2, 0.0)
        return row_of("cylinder", self.inside, self.center, matrix, size)[None]


@dataclass(frozen=True)
class HalfSpace(Shape):
    """All that lies behind a plane, in coordinates of its body.

    Parameters
    ----------
    normal : tuple of float, length dim
        Normal of the plane, out of the solid, of any length.
    through : tuple of float, length dim, optional
        A point of the plane [m]; the position of the body by default.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    normal: tuple[float, ...]
    through: tuple[float, ...] = None  # type: ignore[assignment]  # a place once made

    def __post_init__(self) -> None:
        normal = direction("normal", self.normal)
        through = (0.0,) * len(normal) if self.through is None else self.through
        set_fields(self, normal=normal, through=vector("through", through, len(normal)))

    @property
    def dim(self) -> int:
        return len(self.normal)

    def rows(self) -> Array:
        matrix = axes_about(self.normal)
        return row_of("half_space", False, self.through, matrix, (0.0, 0.0, 0.0))[None]


@dataclass(frozen=True)
class Mesh(Shape):
    """A closed surface of triangles in 3D, in coordinates of its body.

    Its signed distance is sampled once on a sampling grid and interpolated linearly in between,
    which rounds edges by about one spacing.

    Parameters
    ----------
    vertices : sequence of k points
        Vertices [m].
    faces : sequence of triples of int
        Indices of the vertices of each triangle, from 0 on, anticlockwise as seen from outside.
    spacing : float
        Spacing of the sampling grid [m], > 0; a quarter of a cell of the computational grid is
        recommended. The force on a cube four cells wide that moves through a bed errs by a tenth
        with half a cell and by 0.1 % with a quarter.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range; also for a surface that is not closed, not
        oriented or inside out.
    ModuleNotFoundError
        When a body with this shape is used and trimesh or rtree is not installed: ``pip install
        granular[meshes]``.
    """

    vertices: tuple[tuple[float, float, float], ...]
    faces: tuple[tuple[int, int, int], ...]
    _: KW_ONLY
    spacing: float

    def __post_init__(self) -> None:
        vertices = tuple(vector(f"vertices[{i}]", v, 3) for i, v in enumerate(self.vertices))
        last = len(vertices) - 1
        faces = tuple(
            tuple(integer(f"faces[{i}]", n, 0, last) for n in face)
            for i, face in enumerate(self.faces)
        )
        for i, face in enumerate(faces):
            if len(face) != 3 or len(set(face)) != 3:
                raise ValueError(f"faces[{i}] = {face} must be three different vertices")
        _refuse_open(faces)
        x = np.array(vertices)[np.array(faces)]
        volume = float(np.einsum("ni,ni->", x[:, 0], np.cross(x[:, 1], x[:, 2]))) / 6
        if not volume > 0:
            raise ValueError(
                f"faces: they hold the volume {volume:.4g} m3, must be > 0: anticlockwise as seen "
                "from outside"
            )
        spacing = positive("spacing", self.spacing)
        size = np.ptp(x.reshape(-1, 3), axis=0)
        if np.prod(size / spacing + 5) > MOST_SAMPLES or (size / spacing + 5).max() > 4096:
            raise ValueError(
                f"spacing = {spacing} must leave {MOST_SAMPLES} samples at most in a box of "
                f"{size} m"
            )
        set_fields(self, vertices=vertices, faces=faces, spacing=spacing)

    @classmethod
    def read(cls, path: str | os.PathLike, *, spacing: float, scale: float = 1.0) -> Mesh:
        """Read a surface from a file (STL, OBJ, PLY, ...) with lengths in units of `scale` metres.

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
        return cls(
            tuple(tuple(scale * x for x in v) for v in surface.vertices.tolist()),
            tuple(tuple(face) for face in surface.faces.tolist()),
            spacing=spacing,
        )

    @property
    def dim(self) -> int:
        return 3

    def rows(self) -> Array:
        low, counts = self._sampling_grid()
        half = 0.5 * self.spacing * (counts - 1)
        return row_of("sampled", False, tuple(low + half), np.eye(3), half)[None]

    def samples(self) -> tuple[Array, ...]:
        return (_sampled(self),)

    def _sampling_grid(self) -> tuple[Array, NDArray[np.int64]]:
        """Lower corner, and number of samples along each axis.

        The sampling grid extends two spacings beyond the surface.
        """
        x = np.array(self.vertices)
        counts = np.ceil(np.ptp(x, axis=0) / self.spacing - 1e-9).astype(int) + 5
        middle = 0.5 * (x.min(axis=0) + x.max(axis=0))
        return middle - 0.5 * self.spacing * (counts - 1), counts


def _refuse_open(faces: tuple[tuple[int, ...], ...]) -> None:
    """Refuse a surface unless each edge belongs to two triangles, once in each direction."""
    edges = Counter((face[k], face[(k + 1) % 3]) for face in faces for k in range(3))
    for (a, b), count in edges.items():
        if count != 1 or edges[b, a] != 1:
            raise ValueError(
                f"faces: the edge from vertex {a} to {b} belongs to {count + edges[b, a]} "
                f"triangles ({count} in this direction), must be two, of opposite directions: the "
                "surface must be closed"
            )
    if not edges:
        raise ValueError("faces = () must hold a closed surface")


def _trimesh() -> Any:
    try:
        import rtree  # noqa: F401
        import trimesh
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error}: triangle meshes need trimesh and rtree: pip install granular[meshes]"
        ) from error
    return trimesh


@lru_cache(maxsize=16)
def _sampled(mesh: Mesh) -> Array:
    trimesh = _trimesh()
    surface = trimesh.Trimesh(np.array(mesh.vertices), np.array(mesh.faces), process=False)
    low, counts = mesh._sampling_grid()
    axes = [start + mesh.spacing * np.arange(n) for start, n in zip(low, counts, strict=True)]
    places = combined(axes)
    parts = np.array_split(places, max(len(places) // 20000, 1))
    inside = [trimesh.proximity.signed_distance(surface, part) for part in parts]
    distance = -np.concatenate(inside).reshape(counts[::-1])
    distance.flags.writeable = False
    return distance
