"""Shallow layers on a Coulomb base: dam break on an incline, and caps that spread as they slide.

They are solutions of the depth-averaged equations of Savage & Hutter (1989, J. Fluid Mech. 199,
177, sections 3 and 4): the layer slides as a block with a velocity uniform over its depth, and its
pressure along the base is K times the weight above. They hold where the layer is much longer than
thick.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.model.gravity import EARTH
from granular.tools.arrays import Array
from granular.tools.checks import array, in_range, positive

_START = 1e-6
"""Time from which the cap is integrated, in sqrt(L/g). A series gives the values there; its error,
of the order of the square of this time, is that of the round-off."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DamBreak:
    """A layer released by a dam on an incline, at one time.

    Attributes
    ----------
    thickness, velocity : ndarray, shape (n,)
        Thickness across the plane [m] and velocity along it [m/s]; nan velocity where there is no
        material.
    front, back : float
        Positions along the plane of the front and of the end of the part that is still as thick as
        at the start [m].
    """

    thickness: Array
    velocity: Array
    front: float
    back: float


@dataclass(frozen=True, eq=False, kw_only=True)
class SpreadingCap:
    """A thin parabolic cap that slides down a plane.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Times since the release from rest [s].
    centre : ndarray, shape (k,)
        Distance that the centre of mass has moved along the plane [m].
    half_length : ndarray, shape (k,)
        Distance of both ends from the centre [m].
    """

    times: Array
    centre: Array
    half_length: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class SpreadingEllipse:
    """A thin cap that slides down a plane and spreads along and across the slope.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Times since the release from rest [s].
    centre, velocity : ndarray, shape (k,)
        Distance that the centre has moved along the plane [m] and its velocity [m/s].
    half_length, half_width : ndarray, shape (k,)
        Half-axes of the base along and across the slope [m].
    thickness : ndarray, shape (k,)
        Thickness in the centre [m].
    """

    times: Array
    centre: Array
    velocity: Array
    half_length: Array
    half_width: Array
    thickness: Array


def _inclined(angle_deg: float, mu: float, gravity: float) -> tuple[float, float]:
    """Gravity across the plane, and acceleration of a block down it, both checked."""
    angle = math.radians(in_range("angle_deg", angle_deg, 0.0, 90.0, open_high=True))
    mu = in_range("mu", mu, 0.0, math.tan(angle))
    across = positive("gravity", gravity) * math.cos(angle)
    return across, across * (math.tan(angle) - mu)


def _sliding(angle_deg: float, mu: float, gravity: float) -> tuple[float, float]:
    """Return the same two accelerations, of a slope on which the block does slide."""
    across, pull = _inclined(angle_deg, mu, gravity)
    if pull <= 0.0:
        raise ValueError(f"mu = {mu} must be below the tangent of angle_deg = {angle_deg}")
    return across, pull


def _ascending(times: ArrayLike) -> Array:
    """Times, checked."""
    t = array("times", times, (None,))
    if not len(t) or t[0] < 0 or not (np.diff(t) > 0).all():
        raise ValueError(f"times must be ascending, from 0 on, are {t}")
    return t


def dam_break(
    x: ArrayLike,
    time: float,
    *,
    angle_deg: float,
    mu: float,
    thickness: float,
    K: float = 1.0,
    gravity: float = EARTH,
) -> DamBreak:
    """Dam break on an incline with Coulomb friction (Mangeney et al. 2000).

    At first a layer of uniform thickness h0 is at rest at x < 0, and the plane is empty at x > 0.
    In the frame of a block that slides with ``m = g (sin(angle) - mu cos(angle))`` the friction and
    the slope cancel, and Ritter's wave remains: with ``c = sqrt(K g cos(angle) h0)`` and
    ``s = (x - m t^2/2)/t`` in [-c, 2 c], ``h = h0 (2 - s/c)^2/9`` and ``u = m t + 2 (c + s)/3``.

    Parameters
    ----------
    x : array_like, shape (n,)
        Positions along the plane [m], positive downhill.
    time : float
        Time since the release [s], > 0.
    angle_deg : float
        Inclination [deg], 0 <= angle < 90.
    mu : float
        Friction coefficient of the base, 0 to tan(angle).
    thickness : float
        Thickness h0 [m], > 0.
    K : float
        Coefficient of earth pressure along the plane, > 0, see `sliding_earth_pressure`.
    {raises}.
    """
    x, t, h0 = array("x", x, (None,)), positive("time", time), positive("thickness", thickness)
    across, pull = _inclined(angle_deg, mu, gravity)
    c = math.sqrt(positive("K", K) * across * h0)
    moved = 0.5 * pull * t**2
    s = np.maximum((x - moved) / t, -c)
    wet = s < 2.0 * c
    return DamBreak(
        thickness=np.where(wet, h0 * (2.0 - s / c) ** 2 / 9.0, 0.0),
        velocity=np.where(wet, pull * t + 2.0 * (c + s) / 3.0, np.nan),
        front=moved + 2.0 * c * t,
        back=moved - c * t,
    )


def spreading_cap(
    times: ArrayLike,
    *,
    angle_deg: float,
    mu: float,
    half_length: float,
    thickness: float,
    K: float = 1.0,
    gravity: float = EARTH,
) -> SpreadingCap:
    """Thin parabolic cap that slides down a plane in 2D (Savage & Hutter 1989).

    With the normal stress K rho g h cos(angle) along the plane, the depth-averaged equations
    preserve the parabola ``h = h_m (1 - s^2/L^2)``, h_m L constant, and a velocity linear in the
    distance s from the centre. The centre is that of a block,
    ``g (sin(angle) - mu cos(angle)) t^2/2``, and ``L'' = 2 K g cos(angle) h_0 L_0/L^2``.

    Parameters
    ----------
    times : array_like, shape (k,)
        Times [s], >= 0, ascending.
    angle_deg : float
        Inclination [deg], 0 < angle < 90.
    mu : float
        Friction coefficient of the base, below tan(angle).
    half_length, thickness : float
        Initial half-length along the plane and thickness across it in the middle [m], > 0.
    K : float
        Coefficient of earth pressure along the plane, > 0: 1 in a liquid, less (active) in material
        that spreads, see `sliding_earth_pressure`.
    {raises}.
    """
    t = _ascending(times)
    across, pull = _sliding(angle_deg, mu, gravity)
    L0, h0 = positive("half_length", half_length), positive("thickness", thickness)
    push = 2.0 * positive("K", K) * across * h0 * L0
    # The last time alone would be an empty interval if it were 0.
    end = max(float(t[-1]), 1e-9)
    solved = scipy.integrate.solve_ivp(
        lambda _, y: (y[1], push / y[0] ** 2),
        (0.0, end),
        (L0, 0.0),
        t_eval=t,
        rtol=1e-9,
        atol=1e-12,
    )
    return SpreadingCap(times=t, centre=0.5 * pull * t**2, half_length=solved.y[0])


def spreading_ellipse(
    times: ArrayLike,
    *,
    angle_deg: float,
    mu: float,
    half_length: float,
    thickness: float,
    K: float = 1.0,
    gravity: float = EARTH,
) -> SpreadingEllipse:
    """Thin cap with a circular base that slides down a plane in 3D (Hutter et al. 1993).

    The thickness stays a paraboloid, ``h = H/(f G) (1 - (x/(L G))^2 - (y/(L f))^2)``, and the
    velocity linear in x and y. Friction points against the velocity, which turns it slightly
    towards the sides: ``G'' = 2 B/(G^2 f)`` and ``f'' = 2 B/(G f^2) - C/(A - C) f'/t``, with times
    in sqrt(L/g), ``B = K H/L cos(angle)``, ``A = sin(angle)`` and ``C = mu cos(angle)``. The last
    term holds while the cap spreads slowly compared with its fall.

    Parameters
    ----------
    times : array_like, shape (k,)
        Times [s], >= 0, ascending.
    angle_deg : float
        Inclination [deg], 0 < angle < 90.
    mu : float
        Friction coefficient of the base, below tan(angle).
    half_length, thickness : float
        Initial radius of the base L and thickness in the centre H [m], > 0.
    K : float
        Coefficient of earth pressure in both directions, > 0.
    {raises}.
    """
    t = _ascending(times)
    across, pull = _sliding(angle_deg, mu, gravity)
    L, H = positive("half_length", half_length), positive("thickness", thickness)
    B = positive("K", K) * H / L * across / gravity
    turned = mu * across / pull
    scaled = t / math.sqrt(L / gravity)

    def rate(s: float, y: Array) -> tuple[float, ...]:
        G, dG, f, df = y
        return dG, 2.0 * B / (G**2 * f), df, 2.0 * B / (G * f**2) - turned * df / s

    first = np.array([2.0 * B, 2.0 * B / (1.0 + turned)])
    start = np.ravel(np.transpose([1.0 + first * _START**2 / 2.0, first * _START]))
    solved = scipy.integrate.solve_ivp(
        rate,
        (_START, max(float(scaled[-1]), 2.0 * _START)),
        start,
        t_eval=np.maximum(scaled, _START),
        rtol=1e-9,
        atol=1e-12,
    )
    G, f = solved.y[0], solved.y[2]
    return SpreadingEllipse(
        times=t,
        centre=0.5 * pull * t**2,
        velocity=pull * t,
        half_length=L * G,
        half_width=L * f,
        thickness=H / (f * G),
    )
