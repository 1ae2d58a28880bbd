"""Shapes of rigid bodies, each with what the core knows of it.

In the plane a box is of infinite extent along z and a cylinder a disc.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from granular.checks import finite, one_of, positive, vector

__all__ = ["Box", "Cylinder", "HalfSpace", "Union"]

Array = NDArray[np.float64]

MOST_SHAPES = 256
BOX, CYLINDER, HALF_SPACE = range(3)


def rotation_of(name: str, value: object, dim: int) -> float | tuple[float, ...]:
    """An angle [degrees] in the plane, a rotation vector [degrees] in space."""
    return finite(name, value) if dim == 2 else vector(name, value, 3)


def turned(rotation: float | tuple[float, ...]) -> Rotation:
    """The rotation that is meant; 0.0 is none in any dimension."""
    return Rotation.from_rotvec(
        (0.0, 0.0, rotation) if isinstance(rotation, float) else rotation, degrees=True
    )


def in_space(value: Sequence[float]) -> tuple[float, ...]:
    return (*value, 0.0)[:3]


def _row(kind: int, inside: bool, center: Sequence[float], matrix: Array, size: Sequence) -> Array:
    return np.array([kind, inside, *in_space(center), *matrix.ravel(), *size], dtype=float)


def _axes_about(normal: Sequence[float]) -> Array:
    """Rotation matrix whose third column is along `normal`."""
    third = np.array(in_space(normal)) / np.linalg.norm(normal)
    first = np.cross(np.eye(3)[np.argmin(np.abs(third))], third)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(third, first), third])


def set_fields(part: object, **values: object) -> None:
    for name, value in values.items():
        object.__setattr__(part, name, value)


def _direction(name: str, value: object, dim: int | None = None) -> tuple[float, ...]:
    direction = vector(name, value, dim)
    if not math.hypot(*direction) > 0:
        raise ValueError(f"{name} = {direction} must not be zero")
    return direction


@dataclass(frozen=True)
class Box:
    """A box, in coordinates of its body.

    Parameters
    ----------
    size : tuple of float, length dim
        Its edges [m], > 0, may be infinite.
    center : tuple of float, length dim, optional
        [m]; the position of the body by default.
    rotation_deg : float or tuple of 3 floats
        About its centre: an angle in the plane, a rotation vector in space [degrees].

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    size: tuple[float, ...]
    _: KW_ONLY
    center: tuple[float, ...] | None = None
    rotation_deg: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        size = vector("size", self.size, check=partial(positive, allow_inf=True))
        center = (0.0,) * len(size) if self.center is None else self.center
        rotation = self.rotation_deg
        if not (isinstance(rotation, (int, float)) and rotation == 0):
            rotation = rotation_of("rotation_deg", rotation, len(size))
        else:
            rotation = finite("rotation_deg", rotation)
        set_fields(
            self, size=size, center=vector("center", center, len(size)), rotation_deg=rotation
        )

    @property
    def dim(self) -> int:
        """2 or 3."""
        return len(self.size)

    def rows(self) -> Array:
        """What the core knows of it, shape (1, 17)."""
        half = [edge / 2 for edge in self.size] + [math.inf]
        matrix = turned(self.rotation_deg).as_matrix()
        return _row(BOX, False, self.center, matrix, half[:3])[None]


@dataclass(frozen=True)
class Cylinder:
    """A cylinder, in coordinates of its body; in the plane a disc.

    Parameters
    ----------
    radius : float
        [m], > 0.
    length : float
        Along the axis [m], > 0 or infinite; must be infinite in the plane.
    center : tuple of float, length dim
        [m].
    axis : tuple of 3 floats, optional
        Direction of the axis, of any length; None in the plane.
    inside : bool
        The solid is all that lies outside of the surface, a drum with the material in it.

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
            raise ValueError(
                f"axis = {axis} and length = {length} must be None and inf in the plane"
            )
        if len(center) == 3:
            axis = _direction("axis", axis, 3)
        radius, inside = (
            positive("radius", self.radius),
            one_of("inside", self.inside, (False, True)),
        )
        set_fields(self, radius=radius, center=center, axis=axis, length=length, inside=inside)

    @property
    def dim(self) -> int:
        """2 or 3."""
        return len(self.center)

    def rows(self) -> Array:
        """What the core knows of it, shape (1, 17)."""
        matrix = np.eye(3) if self.axis is None else _axes_about(self.axis)
        size = (self.radius, self.length / 2, 0.0)
        return _row(CYLINDER, self.inside, self.center, matrix, size)[None]


@dataclass(frozen=True)
class HalfSpace:
    """All that lies behind a plane, in coordinates of its body.

    Parameters
    ----------
    normal : tuple of float, length dim
        Out of the solid, of any length.
    through : tuple of float, length dim, optional
        A place of the plane [m]; the position of the body by default.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    normal: tuple[float, ...]
    through: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        normal = _direction("normal", self.normal)
        through = (0.0,) * len(normal) if self.through is None else self.through
        set_fields(self, normal=normal, through=vector("through", through, len(normal)))

    @property
    def dim(self) -> int:
        """2 or 3."""
        return len(self.normal)

    def rows(self) -> Array:
        """What the core knows of it, shape (1, 17)."""
        return _row(HALF_SPACE, False, self.through, _axes_about(self.normal), (0.0, 0.0, 0.0))[
            None
        ]


@dataclass(frozen=True)
class Union:
    """Several shapes as one: a bucket is a union of boxes.

    Its distance is the least of theirs: exact outside, less deep than it is where shapes overlap.

    Parameters
    ----------
    parts : sequence of Box, Cylinder, HalfSpace
        At least one, of one dimension.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    parts: tuple[Box | Cylinder | HalfSpace, ...]

    def __post_init__(self) -> None:
        if isinstance(self.parts, str) or not isinstance(self.parts, Sequence):
            raise TypeError(
                f"parts = {self.parts!r} must be a sequence of Box, Cylinder, HalfSpace"
            )
        parts = tuple(self.parts)
        if not 1 <= len(parts) <= MOST_SHAPES:
            raise ValueError(f"parts: {len(parts)} shapes must be from 1 to {MOST_SHAPES}")
        for i, part in enumerate(parts):
            if not isinstance(part, (Box, Cylinder, HalfSpace)):
                raise TypeError(f"parts[{i}] = {part!r} must be a Box, Cylinder or HalfSpace")
            if part.dim != parts[0].dim:
                raise ValueError(f"parts[{i}] = {part} must have dimension {parts[0].dim}")
        set_fields(self, parts=parts)

    @property
    def dim(self) -> int:
        """2 or 3."""
        return self.parts[0].dim

    def rows(self) -> Array:
        """What the core knows of it, shape (parts, 17)."""
        return np.concatenate([part.rows() for part in self.parts])


# ---- what is known of rows, as the core has them ----


def reach(rows: Array, dim: int) -> float:
    """Distance from the position within which all of the surface lies [m]; may be infinite."""
    farthest = 0.0
    for kind, inside, *numbers in rows:
        center, size = np.array(numbers[:3]), np.array(numbers[12:])
        if inside or kind == HALF_SPACE:
            return math.inf
        extent = size[: dim if kind == BOX else dim - 1]
        farthest = max(farthest, float(np.linalg.norm(center) + np.linalg.norm(extent)))
    return farthest


def thicknesses(rows: Array, dim: int) -> tuple[float, float]:
    """Least edge of the boxes and least diameter or length of the cylinders [m]; inf without."""
    box = cylinder = math.inf
    for kind, inside, *numbers in rows:
        size = numbers[12:]
        if kind == BOX:
            box = min(box, *(2 * edge for edge in size[:dim]))
        elif kind == CYLINDER and not inside:
            cylinder = min(cylinder, 2 * size[0], 2 * size[1])
    return box, cylinder


def corners(rows: Array) -> Array:
    """Corners of boxes about parts of finite size, shape (8 parts, 3); z is 0 in the plane."""
    found = []
    signs = np.array(list(product((-1, 1), repeat=3)))
    for kind, _, *numbers in rows:
        center, matrix, size = np.array(numbers[:3]), np.array(numbers[3:12]), numbers[12:]
        half = np.array([size[0], size[0], size[1]] if kind == CYLINDER else size)
        half[~np.isfinite(half)] = 0.0
        found.append(center + signs * half @ matrix.reshape(3, 3).T)
    return np.concatenate(found)


def are_endless(rows: Array, along: Array) -> bool:
    """Whether all parts are the same everywhere along a direction."""
    for kind, _, *numbers in rows:
        matrix, size = np.array(numbers[3:12]).reshape(3, 3), numbers[12:]
        share = abs(matrix.T @ along)
        if kind == HALF_SPACE:
            endless = share[2] < 1e-12
        else:
            lengths = [0.0, 0.0, size[1]] if kind == CYLINDER else size
            endless = any(
                s > 1 - 1e-12 and length == math.inf
                for s, length in zip(share, lengths, strict=True)
            )
        if not endless:
            return False
    return True
