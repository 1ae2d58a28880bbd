"""Bodies that another program moves or loads between steps: controllers, multibody codes, FEM."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from granular import _core
from granular.mpm.bodies import BodyLoad, place_of
from granular.mpm.limits import courant_limit, damped_step
from granular.mpm.scene import Scene
from granular.shapes.measures import extents, reach
from granular.shapes.shape import padded, turned
from granular.tools.arrays import Array
from granular.tools.checks import finite, integer, vector

if TYPE_CHECKING:
    from granular.mpm.bodies import Body

RATES, LOAD = place_of("velocity", "angular_velocity"), place_of("applied_force", "applied_torque")
IMPULSES, MET = place_of("impulse", "angular_impulse"), place_of("met", "met")


class Coupled:
    """The methods of simulations by which another program drives bodies; see `Simulation`."""

    scene: Scene
    _engine: _core.Engine

    def set_motion(
        self,
        body: int,
        *,
        velocity: Sequence[float] | None = None,
        angular_velocity: float | Sequence[float] | None = None,
    ) -> BodyLoad:
        """Set the velocity of a body from now on, in the place of its `motion`.

        It holds until it is set again. Checkpoints and records have it, so that a resumed run goes
        on exactly. Steps become shorter at once if the body is so fast that they must.

        Parameters
        ----------
        body : int
            Index of the body in the scene.
        velocity : sequence of float, length dim, optional
            Velocity of its position [m/s]; by default the present one. It must be 0 along the axes
            named in `free`.
        angular_velocity : float or sequence of 3 floats, optional
            Angular velocity [rad/s], a number in 2D, a vector about fixed axes in 3D; by default
            the present one. Must be None if the body has an `inertia`.

        Returns
        -------
        BodyLoad
            As by `body_load`, whose next interval begins.

        Raises
        ------
        TypeError, ValueError
            If an argument is out of range, follows from the forces, is faster than elastic waves or
            too fast for a fixed `dt`, or turns a body that is endless or too large along a periodic
            axis; or for a motion that has no axis in an axisymmetric grid.
        """
        body, described = self._body(body)
        row = self._engine.bodies()[body]
        rates = row[RATES].tolist()
        if velocity is not None:
            rates[:3] = padded(vector("velocity", velocity, described.dim))
            for axis in described.free:
                if rates["xyz".index(axis)]:
                    raise ValueError(
                        f"velocity = {velocity} must be 0 along {axis}: bodies[{body}] moves "
                        "freely there, see apply_load"
                    )
        if angular_velocity is not None:
            if described.inertia is not None:
                raise ValueError(
                    f"angular_velocity = {angular_velocity} must be None: bodies[{body}] turns "
                    "freely, see apply_load"
                )
            rates[3:] = _turning("angular_velocity", angular_velocity, described.dim)
            self._check_turning(body, described, rates[3:])
        if self.scene.grid.axisymmetric and (rates[0] or any(rates[3:])):
            raise ValueError(
                f"velocity = {velocity}, angular_velocity = {angular_velocity} must be along the "
                f"axis of symmetry: bodies[{body}] is one of revolution"
            )
        self._check_speed(body, rates)
        self._drive(body, tuple(rates))
        return self._load_of(row)

    def apply_load(
        self,
        body: int,
        *,
        force: Sequence[float] | None = None,
        torque: float | Sequence[float] | None = None,
    ) -> BodyLoad:
        """Let a force and a torque act on a free body from now on, besides gravity.

        They hold until they are set again, as those of `set_motion` do.

        Parameters
        ----------
        body : int
            Index of the body in the scene.
        force : sequence of float, length dim, optional
            Force at its position [N; in 2D per metre of depth]; by default the present one. It must
            be 0 along axes that are not named in `free`.
        torque : float or sequence of 3 floats, optional
            Torque [N m], a number in 2D, a vector about fixed axes in 3D; by default the present
            one. Must be None unless the body has an `inertia`.

        Returns
        -------
        BodyLoad
            As by `body_load`, whose next interval begins. What is set here is no part of it.

        Raises
        ------
        TypeError, ValueError
            If an argument is out of range, or has no effect as it acts on what is prescribed.
        """
        body, described = self._body(body)
        row = self._engine.bodies()[body]
        load = row[LOAD].tolist()
        if force is not None:
            load[:3] = padded(vector("force", force, described.dim))
            for d, axis in enumerate("xyz"):
                if load[d] and axis not in described.free:
                    raise ValueError(
                        f"force = {force} must be 0 along {axis}: the motion of bodies[{body}] is "
                        f"prescribed there, as free = {described.free!r}"
                    )
        if torque is not None:
            if described.inertia is None:
                raise ValueError(
                    f"torque = {torque} must be None: bodies[{body}] has no inertia, and its "
                    "rotation is prescribed"
                )
            load[3:] = _turning("torque", torque, described.dim)
        self._load(body, tuple(load))
        return self._load_of(row)

    def body_load(self, body: int) -> BodyLoad:
        """Mean load of the material on a body since it was last set from outside.

        Parameters
        ----------
        body : int
            Index of the body in the scene.

        Returns
        -------
        BodyLoad
            Mean since `set_motion` or `apply_load` was last called for it, or since the start of
            the run; 0 if no step was made since then.

        Raises
        ------
        TypeError, ValueError
            If there is no such body.
        """
        body, _ = self._body(body)
        return self._load_of(self._engine.bodies()[body])

    def _drive(self, body: int, rates: tuple[float, ...]) -> None:
        """Give the core the velocities of a body."""
        self._engine.drive(body, rates)

    def _load(self, body: int, load: tuple[float, ...]) -> None:
        """Give the core the load on a body."""
        self._engine.load(body, load)

    def _load_of(self, row: Array) -> BodyLoad:
        """Mean load since the state `row` of a body was set."""
        begin, *before = row[MET].tolist()
        duration = self._engine.scalars()["time"] - begin
        dim, share = self.scene.dim, 1 / duration if duration > 0 else 0.0
        load = share * (row[IMPULSES] - before)
        return BodyLoad(load[:dim], load[5] if dim == 2 else load[3:], duration)

    def _body(self, body: int) -> tuple[int, Body]:
        bodies = self.scene.bodies
        if not bodies:
            raise ValueError(f"body = {body!r}: the scene has no bodies")
        body = integer("body", body, 0, len(bodies) - 1)
        return body, bodies[body]

    @cached_property
    def _wave_speed(self) -> float:
        return self.scene.wave_speed

    @cached_property
    def _reaches(self) -> list[float]:
        """Distance of the surface of each body from its position [m]; the domain ends it."""
        grid = self.scene.grid
        far = math.hypot(*(n * grid.cell for n in grid.shape))
        return [min(reach(body.shape), far) for body in self.scene.bodies]

    def _check_speed(self, body: int, rates: Sequence[float]) -> None:
        """Refuse a body faster than elastic waves, or too fast for a fixed time step."""
        scene = self.scene
        wave, speed = self._wave_speed, math.hypot(*rates[:3])
        if any(rates[3:]):
            speed += math.hypot(*rates[3:]) * self._reaches[body]
        if speed > wave:
            raise ValueError(
                f"bodies[{body}] must be slower than elastic waves, {wave:.4g} m/s, and would have "
                f"{speed:.4g} m/s"
            )
        if scene.scheme.dt is None:
            return
        largest = damped_step(scene, courant_limit(scene) * scene.grid.cell / (wave + speed))
        if scene.scheme.dt > largest:
            raise ValueError(
                f"bodies[{body}] at {speed:.4g} m/s must have a dt of at most {largest:.4g} s, not "
                f"{scene.scheme.dt}: take a shorter one, or cfl"
            )

    def _check_turning(self, body: int, described: Body, omega: Sequence[float]) -> None:
        """Refuse a rotation by which a body and its images along a periodic axis would meet."""
        grid = self.scene.grid
        if not any(omega) or not any(grid.periodic):
            return
        rotation = turned(described.rotation_deg)
        about = np.eye(3)[2 if described.dim == 2 else 0 :]
        for axis in np.flatnonzero(grid.periodic):
            along = np.eye(3)[axis]
            stays = not np.cross(omega, along).any()
            if stays and described.shape.is_endless(rotation.inv().apply(along)):
                continue
            wide = extents(described.shape, rotation.as_matrix(), about)[axis]
            half = 0.5 * grid.shape[axis] * grid.cell
            if wide > half:
                raise ValueError(
                    f"angular_velocity = {omega} turns bodies[{body}], which reaches {wide:.4g} m "
                    f"along {'xyz'[axis]}, must be <= {half:.4g} m, half the period"
                )


def _turning(name: str, value: object, dim: int) -> tuple[float, ...]:
    """Three components of an angular velocity or torque."""
    return (0.0, 0.0, finite(name, value)) if dim == 2 else vector(name, value, 3)
