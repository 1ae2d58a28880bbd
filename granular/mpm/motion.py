"""Prescribed motion of a rigid body: velocities in time, and paths."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.mpm.path_files import read_path
from granular.tools.arrays import Array
from granular.tools.checks import (
    array,
    ascending,
    check_fields,
    finite,
    sequence,
    set_fields,
    truth,
    vector,
)
from granular.tools.description import Description

__all__ = ["Motion"]


@dataclass(frozen=True, kw_only=True)
class Motion(Description):
    """Velocity and angular velocity, linear between given times and constant before and after them.

    `Motion.through` makes the motion through given positions, and `Motion.read` that of a file.

    Parameters
    ----------
    times : tuple of float, length k >= 1
        Times [s], >= 0, ascending.
    velocity : tuple of k tuples of float, length dim, optional
        Velocity of the position of the body [m/s]; 0 by default. A constant one may be a vector.
    angular_velocity : tuple of k floats, or of k tuples of 3 floats, optional
        Angular velocity [rad/s], a number in 2D, a vector about fixed axes in 3D; 0 by default. One
        of the two must be given. A constant one may be a number, or a vector in 3D.
    {raises}.

    Examples
    --------
    >>> lifted = gr.Motion(velocity=(0.0, 0.1))
    >>> rolling = gr.Motion(velocity=(0.2, 0.0), angular_velocity=-1.0)
    >>> slower = gr.Motion(times=(0.0, 1.0), velocity=((0.2, 0.0), (0.0, 0.0)))
    """

    times: tuple[float, ...] = (0.0,)
    velocity: tuple[tuple[float, ...], ...] = None  # type: ignore[assignment]  # some once made
    angular_velocity: tuple[float, ...] | tuple[tuple[float, ...], ...] | None = None

    def __post_init__(self) -> None:
        check_fields(self, ascending, "times")
        count = len(self.times)
        turning = _of_times("angular_velocity", self.angular_velocity, count, lengths=(3,))
        velocity = _of_times("velocity", self.velocity, count, lengths=(2, 3))
        if velocity is None:
            if turning is None:
                raise TypeError("velocity = None and angular_velocity = None: one must be given")
            dim = 3 if any(np.ndim(w) for w in turning) else 2
            velocity = ((0.0,) * dim,) * count
        dim = len(vector("velocity[0]", velocity[0]))
        velocity = tuple(vector(f"velocity[{i}]", v, dim) for i, v in enumerate(velocity))
        if turning is None:
            turning = (0.0 if dim == 2 else (0.0,) * 3,) * count
        checked = tuple(
            finite(f"angular_velocity[{i}]", w)
            if dim == 2
            else vector(f"angular_velocity[{i}]", w, 3)
            for i, w in enumerate(turning)
        )
        set_fields(self, velocity=velocity, angular_velocity=checked)

    @classmethod
    def through(
        cls,
        times: ArrayLike,
        positions: ArrayLike,
        *,
        angles_deg: ArrayLike | None = None,
        axis: tuple[float, float, float] = (0.0, 1.0, 0.0),
        stops: bool = True,
    ) -> Self:
        """Return the motion through positions, and angles, at given times, which it meets exactly.

        Between two times the velocity is linear in two halves. At each time it is that of a
        monotone cubic interpolation, and in the middle between two times it is such that the next
        position is reached. Between two positions no component changes its direction.

        Parameters
        ----------
        times : array_like, shape (k,)
            Times [s], >= 0, ascending, at least two.
        positions : array_like, shape (k, dim)
            Positions of the body [m]. Only their differences count: the first one should be the
            position with which the `Body` is made.
        angles_deg : array_like, shape (k,), optional
            Angles by which the body has turned [deg], of which only the differences count. They may
            exceed a whole turn.
        axis : (float, float, float)
            Axis of these turns in 3D, by default y; in 2D it is z.
        stops : bool
            If True, the body is at rest before the first and after the last time, and begins and
            ends with the velocity 0. If False, it goes on with the first and the last velocity.
        {raises}.

        Examples
        --------
        >>> down_and_ahead = gr.Motion.through(
        ...     (0.0, 0.5, 2.0), ((0.2, 0.1), (0.2, 0.05), (0.6, 0.05))
        ... )
        """
        t = np.asarray(ascending("times", times))
        if len(t) < 2:
            raise ValueError(f"times = {t.tolist()} must be at least two")
        x = array("positions", positions, (len(t), None))
        if x.shape[1] not in (2, 3):
            raise ValueError(f"positions has shape {x.shape}, must be ({len(t)}, 2) or (.., 3)")
        turns = (
            np.zeros(len(t)) if angles_deg is None else array("angles_deg", angles_deg, (len(t),))
        )
        stops = truth("stops", stops)
        knots, velocity = _met(t, x, stops)
        _, turning = _met(t, np.radians(turns)[:, None], stops)
        about = np.asarray(vector("axis", axis, 3))
        if not np.any(about):
            raise ValueError(f"axis = {axis} must not be zero")
        rates = turning if x.shape[1] == 2 else turning * about / np.linalg.norm(about)
        return cls(
            times=tuple(knots.tolist()),
            velocity=tuple(map(tuple, velocity.tolist())),
            angular_velocity=tuple(rates[:, 0].tolist())
            if x.shape[1] == 2
            else tuple(map(tuple, rates.tolist())),
        )

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        axis: tuple[float, float, float] | None = None,
        stops: bool = True,
    ) -> Self:
        """Return the motion through the positions of a file, a table with commas or semicolons.

        Its first line names the columns: time, x, y, z in 3D, and angle, in any order. Units may
        follow in brackets: [s], [ms] or [min], [m], [cm] or [mm], [deg] or [rad]; without one they
        are s, m and degrees. Other columns, and lines that begin with ``#``, are left out. The file
        of a `granular.measure.BodyMotion`, by `to_csv`, is such a table; the body turns as its
        quaternions do, which must be by less than half a turn from one row to the next.

        Parameters
        ----------
        path : path
            File to read. Only the differences of its positions and angles count: the `Body` begins
            where it is made.
        axis : (float, float, float), optional
            Axis of the turns in 3D; by default that of the quaternions of the file, or y.
        stops : bool
            As of `through`.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ValueError
            If a column is missing, its unit is unknown, an entry is no finite number, or the body
            of a recorded path turns about several axes.
        """
        known = read_path(Path(path))
        return cls.through(
            known.times,
            known.positions,
            angles_deg=known.angles_deg,
            axis=axis or known.axis or (0.0, 1.0, 0.0),
            stops=stops,
        )

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return len(self.velocity[0])

    def rows(self) -> Array:
        """Return time, velocity and angular velocity for the core, shape (k, 7)."""
        out = np.zeros((len(self.times), 7))
        out[:, 0] = self.times
        out[:, 1 : 1 + self.dim] = self.velocity
        out[:, 6 if self.dim == 2 else slice(4, 7)] = self.angular_velocity
        return out


def _of_times(name: str, value: Any, count: int, *, lengths: tuple[int, ...]) -> tuple | None:
    """Values at each of the times; a constant may be one value, a number or a vector."""
    if value is None:
        return None
    wanted = "one value for each of the times"
    if np.ndim(value) == 0 and name == "angular_velocity":
        if count > 1:
            raise ValueError(f"{name} = {value} must be {wanted}, {count}, such as ({value}, ...)")
        return (value,)
    values = sequence(name, value)
    flat = all(np.ndim(part) == 0 for part in values)
    is_vector = flat and len(values) in lengths and (name == "velocity" or len(values) != count)
    if is_vector and count == 1:
        return (values,)
    if len(values) != count or (flat and name == "velocity"):
        wanted_form = f"({values}, ...)" if is_vector else "one vector or number each"
        raise ValueError(f"{name} = {values} must be {wanted}, {count}: {wanted_form}")
    return values


def _met(times: Array, values: Array, stops: bool) -> tuple[Array, Array]:
    """Times and rates of change, linear between them, with which values (k, n) are met."""
    rates = scipy.interpolate.PchipInterpolator(times, values).derivative()(times)
    if stops:
        rates[[0, -1]] = 0.0
    means = np.diff(values, axis=0) / np.diff(times)[:, None]
    most = np.abs(2 * means)  # up to twice the mean rates on both sides, the middle has their sign
    most = np.minimum(np.concatenate([most[:1], most]), np.concatenate([most, most[-1:]]))
    rates = np.clip(rates, -most, most)
    middle = 2 * means - (rates[:-1] + rates[1:]) / 2
    knots = np.empty(2 * len(times) - 1)
    knots[::2], knots[1::2] = times, (times[:-1] + times[1:]) / 2
    out = np.empty((len(knots), values.shape[1]))
    out[::2], out[1::2] = rates, middle
    return knots, out
