"""Rigid bodies that move through the material: shapes by signed distance, motions, contact.

In the plane a box is of infinite extent along z and a cylinder a disc; masses, forces and torques
are per metre of depth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from granular import _core
from granular.checks import finite, non_negative, one_of, positive, vector

if TYPE_CHECKING:
    from granular.geometry import Grid

__all__ = ["Body", "BodyState", "Box", "Cylinder", "HalfSpace", "Motion", "Union"]

Array = NDArray[np.float64]

CONTACTS = ("sticky", "separating", "bilateral")
MOST_BODIES, MOST_SHAPES = 64, 256
STATE = (
    ("position", 3),
    ("quaternion", 4),
    ("velocity", 3),
    ("angular_velocity", 3),
    ("impulse", 3),
    ("angular_impulse", 3),
)
"""What the core tells of a body, name and count of numbers; quaternions with the scalar first."""
BOX, CYLINDER, HALF_SPACE = range(3)


def _rotation(name: str, value: object, dim: int) -> float | tuple[float, ...]:
    """An angle [degrees] in the plane, a rotation vector [degrees] in space."""
    return finite(name, value) if dim == 2 else vector(name, value, 3)


def _turned(rotation: float | tuple[float, ...]) -> Rotation:
    """The rotation that is meant; 0.0 is none in any dimension."""
    return Rotation.from_rotvec(
        (0.0, 0.0, rotation) if isinstance(rotation, float) else rotation, degrees=True
    )


def _in_space(value: Sequence[float]) -> tuple[float, ...]:
    return (*value, 0.0)[:3]


def _row(kind: int, inside: bool, center: Sequence[float], matrix: Array, size: Sequence) -> Array:
    return np.array([kind, inside, *_in_space(center), *matrix.ravel(), *size], dtype=float)


def _axes_about(normal: Sequence[float]) -> Array:
    """Rotation matrix whose third column is along `normal`."""
    third = np.array(_in_space(normal)) / np.linalg.norm(normal)
    first = np.cross(np.eye(3)[np.argmin(np.abs(third))], third)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(third, first), third])


def _set(part: object, **values: object) -> None:
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
        Its edges [m], > 0.
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
        size = vector("size", self.size)
        for axis, edge in enumerate(size):
            positive(f"size[{axis}]", edge)
        center = (0.0,) * len(size) if self.center is None else self.center
        rotation = self.rotation_deg
        if not (isinstance(rotation, (int, float)) and rotation == 0):
            rotation = _rotation("rotation_deg", rotation, len(size))
        else:
            rotation = finite("rotation_deg", rotation)
        _set(self, size=size, center=vector("center", center, len(size)), rotation_deg=rotation)

    @property
    def dim(self) -> int:
        """2 or 3."""
        return len(self.size)

    def rows(self) -> Array:
        """What the core knows of it, shape (1, 17)."""
        half = [edge / 2 for edge in self.size] + [math.inf]
        matrix = _turned(self.rotation_deg).as_matrix()
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
        _set(self, radius=radius, center=center, axis=axis, length=length, inside=inside)

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
        _set(self, normal=normal, through=vector("through", through, len(normal)))

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
        _set(self, parts=parts)

    @property
    def dim(self) -> int:
        """2 or 3."""
        return self.parts[0].dim

    def rows(self) -> Array:
        """What the core knows of it, shape (parts, 17)."""
        return np.concatenate([part.rows() for part in self.parts])


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Velocity and angular velocity, linear between given times and constant before and after.

    Parameters
    ----------
    times : tuple of float, length k >= 1
        Seconds, >= 0, ascending.
    velocity : tuple of k tuples of float, length dim
        Of the position of the body [m/s].
    angular_velocity : tuple of k floats, or of k tuples of 3 floats
        In the plane, or in space about fixed axes [rad/s]; none by default.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    times: tuple[float, ...] = (0.0,)
    velocity: tuple[tuple[float, ...], ...]
    angular_velocity: tuple[float, ...] | tuple[tuple[float, ...], ...] | None = None

    def __post_init__(self) -> None:
        for name in ("times", "velocity", "angular_velocity"):
            value = getattr(self, name)
            if name == "angular_velocity" and value is None:
                continue
            if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
                raise TypeError(f"{name} = {value!r} must be a sequence")
        times = tuple(non_negative(f"times[{i}]", t) for i, t in enumerate(self.times))
        if not times or any(b <= a for a, b in pairwise(times)):
            raise ValueError(f"times = {times} must ascend, and be at least one")
        if len(self.velocity) != len(times):
            raise ValueError(f"velocity = {self.velocity} must be as many as times, {len(times)}")
        dim = len(vector("velocity[0]", self.velocity[0]))
        velocity = tuple(vector(f"velocity[{i}]", v, dim) for i, v in enumerate(self.velocity))
        turning = self.angular_velocity
        if turning is None:
            turning = (0.0 if dim == 2 else (0.0,) * 3,) * len(times)
        if len(turning) != len(times):
            raise ValueError(f"angular_velocity = {turning} must be as many as times, {len(times)}")
        turning = tuple(
            finite(f"angular_velocity[{i}]", w)
            if dim == 2
            else vector(f"angular_velocity[{i}]", w, 3)
            for i, w in enumerate(turning)
        )
        _set(self, times=times, velocity=velocity, angular_velocity=turning)

    @property
    def dim(self) -> int:
        """2 or 3."""
        return len(self.velocity[0])

    def rows(self) -> Array:
        """Time, velocity and angular velocity as the core wants them, shape (k, 7)."""
        out = np.zeros((len(self.times), 7))
        out[:, 0] = self.times
        out[:, 1 : 1 + self.dim] = self.velocity
        out[:, 6 if self.dim == 2 else slice(4, 7)] = self.angular_velocity
        return out


@dataclass(frozen=True)
class Body:
    """A rigid body that the material touches at the nodes of the grid within it.

    Parameters
    ----------
    shape : Box, Cylinder, HalfSpace or Union
        In coordinates of the body.
    position : tuple of float, length dim
        Where the origin of these coordinates is at the start [m].
    rotation_deg : float or tuple of 3 floats
        How they are turned at the start: an angle, or a rotation vector in space [degrees].
    motion : Motion, optional
        At rest by default.
    contact : {"separating", "sticky", "bilateral"}
        "separating" holds the normal velocity of material that approaches, with friction along
        the surface, "bilateral" that of all material, "sticky" all components.
    friction : float
        Coulomb coefficient, >= 0; 0 for "sticky".
    free : str
        The axes along which the body is moved by gravity and the material instead of its motion,
        such as "z" or "xy"; it begins with the velocity of its motion.
    mass : float, optional
        [kg], > 0: needed if, and only if, it is free.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    shape: Box | Cylinder | HalfSpace | Union
    position: tuple[float, ...]
    _: KW_ONLY
    rotation_deg: float | tuple[float, ...] = 0.0
    motion: Motion | None = None
    contact: str = "separating"
    friction: float = 0.0
    free: str = ""
    mass: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.shape, (Box, Cylinder, HalfSpace, Union)):
            raise TypeError(f"shape = {self.shape!r} must be a Box, Cylinder, HalfSpace or Union")
        dim = self.shape.dim
        motion = Motion(velocity=((0.0,) * dim,)) if self.motion is None else self.motion
        if not isinstance(motion, Motion):
            raise TypeError(f"motion = {motion!r} must be a Motion or None")
        if motion.dim != dim:
            raise ValueError(f"motion = {motion} must have the dimension of the shape, {dim}")
        rotation = self.rotation_deg
        if isinstance(rotation, (int, float)) and rotation == 0:
            rotation = finite("rotation_deg", rotation)
        else:
            rotation = _rotation("rotation_deg", rotation, dim)
        contact = one_of("contact", self.contact, CONTACTS)
        friction = non_negative("friction", self.friction)
        if friction and contact == "sticky":
            raise ValueError(f'friction = {friction} must be 0 where contact is "sticky"')
        if not isinstance(self.free, str):
            raise TypeError(f"free = {self.free!r} must be a string of axes")
        if set(self.free) - set("xyz"[:dim]) or len(set(self.free)) != len(self.free):
            raise ValueError(f"free = {self.free!r} must be different axes of {'xyz'[:dim]!r}")
        if (self.mass is None) == bool(self.free):
            raise ValueError(
                f"mass = {self.mass} must be given if, and only if, free names an axis"
            )
        _set(
            self,
            position=vector("position", self.position, dim),
            rotation_deg=rotation,
            motion=motion,
            friction=friction,
            mass=None if self.mass is None else positive("mass", self.mass),
        )

    @property
    def dim(self) -> int:
        """2 or 3."""
        return self.shape.dim

    def check(self, name: str, grid: Grid) -> None:
        """Refuse what does not fit the grid."""
        if self.dim != grid.dim:
            raise ValueError(f"{name} of dimension {self.dim} must have the grid's, {grid.dim}")

    def row(self) -> _core.BodyRow:
        """What the core knows of it."""
        x, y, z, w = _turned(self.rotation_deg).as_quat()
        return (
            self.shape.rows(),
            np.array([*_in_space(self.position), w, x, y, z]),
            self.motion.rows(),
            CONTACTS.index(self.contact),
            sum(1 << "xyz".index(axis) for axis in self.free),
            self.friction,
            self.mass or 0.0,
        )

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Signed distance to the surface at the start, and the outward normal.

        Parameters
        ----------
        x : ndarray, shape (n, dim)
            Places [m].

        Returns
        -------
        distance : ndarray, shape (n,)
            [m], negative in the solid.
        normal : ndarray, shape (n, dim)
        """
        x = np.asarray(x, dtype=float)
        if x.ndim != 2 or x.shape[1] != self.dim or not np.isfinite(x).all():
            raise ValueError(f"x of shape {x.shape} must be finite of shape (n, {self.dim})")
        arm = np.zeros((len(x), 3))
        arm[:, : self.dim] = x - np.array(self.position)
        turn = _turned(self.rotation_deg)
        local = np.ascontiguousarray(turn.inv().apply(arm)) if len(x) else arm
        distance, normal = _core.body_distance(self.shape.rows(), local)
        return distance, (turn.apply(normal) if len(x) else normal)[:, : self.dim]


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyState:
    """Where a body is and what it has felt.

    Attributes
    ----------
    position : ndarray, shape (dim,)
        [m].
    rotation : ndarray, shape (dim, dim)
        Its columns are the axes of the body.
    velocity : ndarray, shape (dim,)
        [m/s].
    angular_velocity : ndarray, shape () or (3,)
        In the plane, in space [rad/s].
    impulse : ndarray, shape (dim,)
        Of the material on the body since the run began [N s].
    angular_impulse : ndarray, shape () or (3,)
        The same about the position, which moves with the body [N m s].
    """

    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array
    impulse: Array
    angular_impulse: Array


def split(numbers: Array, dim: int) -> dict[str, Array]:
    """Numbers of a body (..., 19) by the names of `STATE`, with the components that `dim` has."""
    ends = np.cumsum([count for _, count in STATE])[:-1]
    parts = dict(zip((name for name, _ in STATE), np.split(numbers, ends, axis=-1), strict=True))
    if dim == 2:
        for name in ("position", "velocity", "impulse"):
            parts[name] = parts[name][..., :2]
        for name in ("angular_velocity", "angular_impulse"):
            parts[name] = parts[name][..., 2]
    return parts


def state_of(numbers: Array, dim: int) -> BodyState:
    """The state of one body from its 19 numbers."""
    parts = split(numbers, dim)
    w, x, y, z = parts.pop("quaternion")
    rotation = Rotation.from_quat([x, y, z, w]).as_matrix()[:dim, :dim]
    return BodyState(rotation=rotation, **parts)


def check_count(bodies: Sequence[Body]) -> None:
    """Refuse more bodies or shapes than the core has room for."""
    shapes = sum(len(body.shape.rows()) for body in bodies)
    if len(bodies) > MOST_BODIES or shapes > MOST_SHAPES:
        raise ValueError(
            f"bodies: {len(bodies)} of {shapes} shapes must be at most {MOST_BODIES} of "
            f"{MOST_SHAPES} in all"
        )
