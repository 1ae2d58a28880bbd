"""Rigid bodies that move through the material: a shape, its motion and its contact.

A 2D scene is a section of one that is endless along z: a disc is a cylinder there; masses, forces
and torques are per metre of depth.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from granular import _core
from granular.model.grid import combined
from granular.mpm.motion import Motion
from granular.shapes.height_map import HeightMap
from granular.shapes.inertia import MassProperties, inertia_of, mass_properties, principal
from granular.shapes.measures import extents, largest_speed, reach, thicknesses
from granular.shapes.moments import has_no_inside
from granular.shapes.shape import MOST_SHAPES, Shape, padded, rotation_of, turned
from granular.tools.arrays import Array
from granular.tools.checks import (
    check_fields,
    in_range,
    non_negative,
    one_of,
    positive,
    set_fields,
    truth,
    vector,
)
from granular.tools.description import Description

if TYPE_CHECKING:
    from granular.model.grid import Grid

__all__ = ["Body", "BodyLoad", "BodyState", "MassProperties", "mass_properties"]


CONTACTS = _core.enumerations()["contact"]
MOST_BODIES = 64
STATE = (
    ("position", 3),
    ("quaternion", 4),
    ("velocity", 3),
    ("angular_velocity", 3),
    ("impulse", 3),
    ("angular_impulse", 3),
    ("work", 1),
    ("driven", 1),
    ("drive", 6),
    ("applied_force", 3),
    ("applied_torque", 3),
    ("met", 7),
)
"""Name and length of the parts of a body's state in the core; quaternions have the scalar first."""
NUMBERS = sum(length for _, length in STATE)
"""Length of a body's state."""


def place_of(first: str, last: str) -> slice:
    """Place of the parts of a body's state from one to another one."""
    names, ends = [name for name, _ in STATE], np.cumsum([length for _, length in STATE]).tolist()
    return slice([0, *ends][names.index(first)], ends[names.index(last)])


@dataclass(frozen=True)
class Body(Description):
    """A rigid body; it acts on the material at contact points on its surface.

    Parameters
    ----------
    shape : Shape
        A shape of `granular.shapes`, such as a `Box`, in coordinates of the body.
    position : tuple of float, length dim
        Origin of these coordinates at the start [m].
    rotation_deg : float or tuple of 3 floats
        Rotation of these coordinates at the start: an angle in 2D, a rotation vector in 3D
        [degrees].
    motion : Motion, optional
        Prescribed motion; the body is at rest by default.
    contact : {"separating", "sticky", "bilateral"}
        "separating" gives material that approaches the normal velocity of the body, with friction
        along the surface; "bilateral" does the same to all material; "sticky" gives all material
        the velocity of the body.
    friction : float
        Coulomb friction coefficient, >= 0, with the material, and with walls, blocks and other
        bodies, where the smaller one of two counts; must be 0 for "sticky", which is infinitely
        rough.
    rough : bool
        Boundary condition of the fluidity of a nonlocal law: if True the fluidity is 0 at the
        surface, as at a no-slip wall; if False its normal derivative is 0, on the faces of cells
        nearest to the surface.
    free : str
        Axes along which gravity and the forces of the material move the body instead of its
        `motion`, such as "z" or "xy"; its initial velocity is that of its `motion`. A simulation
        refuses such a body where it begins more than half a cell within a block, another body, or
        a wall normal to one of these axes; less counts as touching.
    mass : float, optional
        Mass [kg; in 2D per metre of depth], > 0; required if, and only if, `free` names an axis.
    inertia : float, tuple of 3 floats, or 3 x 3 tuple of floats, optional
        Moment of inertia about the position, which must be the centre of mass [kg m2; in 2D per
        metre of depth]: a number > 0 in 2D; in 3D the moments about the axes of the body, or the
        tensor in them. If given, the torque of the material turns the body about its position
        instead of its `motion`, whose angular velocity is the initial one. See `mass_properties`.
        Must be None for an endless shape.
    restitution : float
        Coefficient of restitution of its impacts on walls, blocks and other bodies, 0 to 1; of two
        free bodies the lesser. Must be 0 unless the body moves freely.
    {raises}.
    """

    shape: Shape
    position: tuple[float, ...]
    _: KW_ONLY
    rotation_deg: float | tuple[float, ...] = 0.0
    motion: Motion = None  # type: ignore[assignment]  # a motion once made
    contact: str = "separating"
    friction: float = 0.0
    rough: bool = False
    free: str = ""
    mass: float | None = None
    inertia: float | tuple[float, ...] | tuple[tuple[float, ...], ...] | None = None
    restitution: float = 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.shape, Shape):
            raise TypeError(f"shape = {self.shape!r} must be a shape of granular.shapes")
        if has_no_inside(self.shape):
            raise ValueError(f"shape = {self.shape!r} must have an inside: it is empty")
        dim = self.shape.dim
        motion = Motion(velocity=((0.0,) * dim,)) if self.motion is None else self.motion
        if not isinstance(motion, Motion):
            raise TypeError(f"motion = {motion!r} must be a Motion or None")
        if motion.dim != dim:
            raise ValueError(f"motion = {motion} must have the dimension of the shape, {dim}")
        set_fields(self, motion=motion)
        check_fields(self, rotation_of, "rotation_deg", dim=dim)
        contact = one_of("contact", self.contact, tuple(CONTACTS))
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
        set_fields(self, friction=friction)
        check_fields(self, truth, "rough")
        check_fields(self, vector, "position", dim=dim)
        check_fields(self, positive, "mass", optional=True)
        check_fields(self, inertia_of, "inertia", optional=True, dim=dim)
        check_fields(self, in_range, "restitution", low=0.0, high=1.0)
        if self.restitution and not self.free and self.inertia is None:
            raise ValueError(
                f"restitution = {self.restitution} must be 0 without free axes and inertia"
            )
        if self.inertia is not None and not math.isfinite(reach(self.shape)):
            raise ValueError(f"inertia = {self.inertia} must be None: the shape is endless")

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return self.shape.dim

    def check(self, name: str, grid: Grid) -> None:
        """Refuse a body that does not fit the grid."""
        if self.dim != grid.dim:
            raise ValueError(f"{name} of dimension {self.dim} must have the grid's, {grid.dim}")
        for part in self.shape.leaves():
            if isinstance(part, HeightMap):
                part.check(name, self._corners_of(grid), grid.slack * grid.cell)
        reaches = self.extents()
        for axis in np.flatnonzero(grid.periodic):
            half, letter = 0.5 * grid.shape[axis] * grid.cell, "xyz"[axis]
            if reaches[axis] > half and not self._is_endless(axis):
                raise ValueError(
                    f"{name} reaches {reaches[axis]:.6g} m from its position along {letter} in its "
                    f"motion, must be <= {half:.6g} m, half the period; or be endless along "
                    f"{letter} and turn about no other axis"
                )

    def _corners_of(self, grid: Grid) -> Array:
        """Corners of the domain in coordinates of the body at the start, shape (2^dim, dim)."""
        sides = np.stack([grid.lower, grid.upper], axis=1)
        arms = np.zeros((2**self.dim, 3))
        arms[:, : self.dim] = combined(list(sides)) - np.array(self.position)
        return turned(self.rotation_deg).inv().apply(arms)[:, : self.dim]

    def extents(self) -> Array:
        """Largest distance of its surface from its position along x, y, z, in all its motion."""
        turning = self._turning()
        return extents(self.shape, turned(self.rotation_deg).as_matrix(), turning)

    def least_volume(self) -> float:
        """Lower bound of its volume [m3], in 2D area [m2]: that of a ball within it, if it is
        whole.

        It is 0 for shapes of several parts, which may be hollow.
        """
        diameter = min(thicknesses(self.shape))
        whole = len(self.shape.rows()) == 1 and math.isfinite(diameter)
        return math.pi / (2 * self.dim) * diameter**self.dim if whole else 0.0

    @property
    def turns(self) -> bool:
        """True if its motion or forces turn it."""
        return bool(self._turning().any())

    def _turning(self) -> Array:
        """Angular velocities of its motion; if it turns freely, some about all its axes."""
        if self.inertia is None:
            return self.motion.rows()[:, 4:]
        return np.eye(3)[2 if self.dim == 2 else 0 :]

    def _is_endless(self, axis: np.intp) -> bool:
        """True if the body is infinite along an axis, and stays so in its motion."""
        along = turned(self.rotation_deg).inv().apply(np.eye(3)[axis])
        turning = np.delete(self._turning(), axis, axis=1)
        return not turning.any() and self.shape.is_endless(along)

    def largest_speed(self, grid: Grid) -> float:
        """Upper bound on the speed [m/s] of its points in the domain, from its motion."""
        motion = self.motion.rows()
        if math.isfinite(reach(self.shape)):
            rotation = turned(self.rotation_deg).as_matrix()
            return largest_speed(self.shape, rotation, motion[:, 1:4], motion[:, 4:])
        lower, size = np.array(grid.lower), np.array(grid.shape) * grid.cell
        near = np.array(self.position) - lower
        far = np.linalg.norm(np.maximum(abs(near), abs(size - near)))
        speed, turning = (np.linalg.norm(motion[:, k : k + 3], axis=1) for k in (1, 4))
        return float((speed + far * turning).max())

    def at_start(self) -> BodyState:
        """Return the state of the body at the start of a run."""
        moving = self.motion.rows()[0, 1:]
        numbers = [*self.row()[2], *moving, *np.zeros(NUMBERS - 13)]
        return state_of(np.array(numbers), self.dim)

    def row(self) -> _core.BodyRow:
        """Return the description of the body for the core."""
        x, y, z, w = turned(self.rotation_deg).as_quat()
        return (
            self.shape.rows(),
            self.shape.samples(),
            np.array([*padded(self.position), w, x, y, z]),
            self.motion.rows(),
            self.extents(),
            CONTACTS[self.contact],
            sum(1 << "xyz".index(axis) for axis in self.free),
            int(self.rough),
            self.friction,
            self.mass or 0.0,
            np.zeros(0) if self.inertia is None else principal(self.inertia),
        )

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Signed distance to the surface at the start, and the outward normal there.

        Parameters
        ----------
        x : ndarray, shape (n, dim)
            Positions [m].

        Returns
        -------
        distance : ndarray, shape (n,)
            Distance [m], negative in the solid.
        normal : ndarray, shape (n, dim)
        """
        x = np.asarray(x, dtype=float)
        if x.ndim != 2 or x.shape[1] != self.dim or not np.isfinite(x).all():
            raise ValueError(f"x of shape {x.shape} must be finite of shape (n, {self.dim})")
        arm = np.zeros((len(x), 3))
        arm[:, : self.dim] = x - np.array(self.position)
        turn = turned(self.rotation_deg)
        local = turn.inv().apply(arm) if len(x) else arm
        distance, along = self.shape.distance(local[:, : self.dim])
        normal = np.zeros((len(x), 3))
        normal[:, : self.dim] = along
        return distance, (turn.apply(normal) if len(x) else normal)[:, : self.dim]


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyState:
    """Position, velocity and accumulated impulse of a body.

    Impulses and work refer to the modelled part where planes of symmetry cut the body.

    Attributes
    ----------
    position : ndarray, shape (dim,)
        Position [m].
    rotation : ndarray, shape (dim, dim)
        Rotation matrix; its columns are the axes of the body.
    velocity : ndarray, shape (dim,)
        Velocity of the position [m/s].
    angular_velocity : ndarray, shape () or (3,)
        Angular velocity [rad/s], a number in 2D, a vector in 3D.
    impulse : ndarray, shape (dim,)
        Impulse of the material on the body since the start of the run [N s].
    angular_impulse : ndarray, shape () or (3,)
        Angular impulse [N m s] about the position, which moves with the body.
    work : ndarray, shape ()
        Work of the contact on the material since the start of the run [J; in 2D per metre of
        depth]: the impulse on each node times the velocity of the node after it. It does not
        include the dissipation by friction at the surface: the work of the body itself is larger by
        that.
    driven : ndarray of bool, shape ()
        Whether `Simulation.set_motion` has replaced its `motion`.
    applied_force : ndarray, shape (dim,)
        Force that `Simulation.apply_load` has set [N].
    applied_torque : ndarray, shape () or (3,)
        Likewise the torque [N m].
    """

    position: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array
    impulse: Array
    angular_impulse: Array
    work: Array
    driven: Array
    applied_force: Array
    applied_torque: Array


@dataclass(frozen=True, eq=False)
class BodyLoad:
    """Mean load of the material on a body over an interval: its impulse over the time.

    Attributes
    ----------
    force : ndarray, shape (dim,)
        Force [N; in 2D per metre of depth].
    torque : ndarray, shape () or (3,)
        Torque [N m] about the position of the body, which moves with it: a number in 2D.
    duration : float
        Length of the interval [s]; without one the load is 0.
    """

    force: Array
    torque: Array
    duration: float


def split(numbers: Array, dim: int) -> dict[str, Array]:
    """Split the numbers of a body by the names of `STATE`; in 2D drop unused components.

    `numbers` has the shape (..., `NUMBERS`). What only a restart needs is left out.
    """
    ends = np.cumsum([count for _, count in STATE])[:-1]
    parts = dict(zip((name for name, _ in STATE), np.split(numbers, ends, axis=-1), strict=True))
    for name in ("drive", "met"):
        del parts[name]
    parts["work"], parts["driven"] = parts["work"][..., 0], parts["driven"][..., 0] != 0
    if dim == 2:
        for name in ("position", "velocity", "impulse", "applied_force"):
            parts[name] = parts[name][..., :2]
        for name in ("angular_velocity", "angular_impulse", "applied_torque"):
            parts[name] = parts[name][..., 2]
    return parts


def state_of(numbers: Array, dim: int) -> BodyState:
    """Return the state of one body from its numbers."""
    parts = split(numbers, dim)
    w, x, y, z = parts.pop("quaternion")
    rotation = scipy.spatial.transform.Rotation.from_quat([x, y, z, w]).as_matrix()[:dim, :dim]
    return BodyState(rotation=rotation, **parts)


def check_count(bodies: Sequence[Body]) -> None:
    """Refuse more bodies or shapes than the core can hold."""
    shapes = sum(len(body.shape.rows()) for body in bodies)
    if len(bodies) > MOST_BODIES or shapes > MOST_SHAPES:
        raise ValueError(
            f"bodies: {len(bodies)} of {shapes} shapes must be at most {MOST_BODIES} of "
            f"{MOST_SHAPES} in all"
        )
