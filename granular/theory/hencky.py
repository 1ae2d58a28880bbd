"""Closed forms of Hencky's elasticity in one dimension, against which finite strains are tested.

If a body is stretched along one axis only, by lambda = exp(e), the Kirchhoff stress along it is M e
with the modulus M = K + 4G/3. The force per unit area of the undeformed section is
P = M e exp(-e).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.materials import Material
from granular.model.gravity import EARTH
from granular.tools.arrays import Array
from granular.tools.checks import finite, integer, one_of, positive

_MOST_STRAIN = 1.0
"""ln(lambda) below which P grows with lambda, so that waves propagate."""


@dataclass(frozen=True)
class HenckyColumn:
    """A column compressed by its own weight.

    Attributes
    ----------
    y : ndarray
        Height above the base to which each reference height has moved [m].
    log_stretch : ndarray
        ln(lambda), <= 0; it equals -ln(rho/rho_c).
    stress : ndarray, shape (..., 4)
        Cauchy stress xx, yy, zz, xy [Pa] with y upwards; yy balances the weight above.
    height : float
        Height of the column [m].
    friction : float
        tau/p, which is uniform: 2G/(sqrt(3) K). Materials with a smaller mu_s yield.
    """

    y: Array
    log_stretch: Array
    stress: Array
    height: float
    friction: float


@dataclass(frozen=True)
class StandingWave:
    """A small standing wave in a bar.

    Attributes
    ----------
    displacement, velocity : ndarray
        Displacement [m] and velocity [m/s] along the bar.
    strain : ndarray
        Gradient of the displacement.
    frequency : float
        Frequency of the wave [Hz].
    wave_speed : float
        Speed of waves along the bar in its present length [m/s].
    """

    displacement: Array
    velocity: Array
    strain: Array
    frequency: float
    wave_speed: float


def hencky_column(
    reference_height: ArrayLike, height0: float, material: Material, gravity: float = EARTH
) -> HenckyColumn:
    """Exact solution of a column between free-slip walls under its own weight.

    The weight above the reference height Y is rho_c g (H0 - Y) = M w. The equation
    M e exp(-e) = -M w has the solution e = -q with q exp(q) = w, so that q is Lambert's function of
    w. The integral of lambda = exp(-q) gives the height y = M/(rho_c g) [Q(q(0)) - Q(q(Y))] with
    Q(q) = q + q^2/2.

    Parameters
    ----------
    reference_height : array_like
        Heights Y without gravity [m], any shape, within [0, height0].
    height0 : float
        Height of the column without gravity [m].
    material : Material
        Or any object with ``K``, ``G``, ``rho_c``.
    {raises}.
    """
    Y = np.asarray(reference_height, dtype=float)
    height0 = positive("height0", height0)
    K, G = positive("K", material.K), positive("G", material.G)
    if not np.all((height0 >= Y) & (Y >= 0)):
        raise ValueError(f"reference_height = {Y} must be in [0, {height0}]")
    M = K + 4 * G / 3
    weight = positive("rho_c", material.rho_c) * positive("gravity", gravity)
    load = weight * (height0 - Y) / M
    q, q0 = scipy.special.lambertw(load).real, scipy.special.lambertw(weight * height0 / M).real

    def integral(q: Array) -> Array:
        return q + np.square(q) / 2

    side = -(K - 2 * G / 3) * load
    stress = np.stack([side, -M * load, side, np.zeros_like(load)], axis=-1)
    return HenckyColumn(
        y=M / weight * (integral(q0) - integral(q)),
        log_stretch=-q,
        stress=stress,
        height=float(M / weight * integral(q0)),
        friction=2 * G / (math.sqrt(3) * K),
    )


def standing_wave(
    x: ArrayLike,
    t: ArrayLike,
    length: float,
    amplitude: float,
    material: Material,
    *,
    ends: str = "fixed-free",
    mode: int = 1,
    log_stretch: float = 0.0,
) -> StandingWave:
    """Small standing wave along a uniformly prestrained bar between free-slip walls.

    Waves travel along the bar in its present length at ``sqrt(M (1 - e)/rho_c)``. The reason is
    that P = M e exp(-e), with e = ln(lambda), has the slope dP/dlambda = M (1 - e)/lambda^2, and
    the mass per undeformed volume is rho_c.

    Parameters
    ----------
    x, t : array_like
        Distance from the first end [m] and time [s], broadcast together.
    length : float
        Present length of the bar [m].
    amplitude : float
        Largest displacement [m], at t = 0.
    material : Material
        Or any object with ``K``, ``G``, ``rho_c``.
    ends : {"fixed-free", "fixed-fixed"}
        Condition at the first end and at the other end.
    mode : int
        Number of the mode, 1 for the longest wave.
    log_stretch : float
        Prestrain e, below 1; negative in compression.

    Returns
    -------
    StandingWave
        Arrays of the broadcast shape.
    {raises}.
    """
    x, t = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(t, dtype=float))
    length, amplitude = positive("length", length), finite("amplitude", amplitude)
    if not np.all((x >= 0) & (x <= length)):
        raise ValueError(f"x = {x} must be in [0, {length}]")
    if finite("log_stretch", log_stretch) >= _MOST_STRAIN:
        raise ValueError(f"log_stretch = {log_stretch} must be below {_MOST_STRAIN}: no waves run")
    waves = integer("mode", mode, 1) / 2
    if one_of("ends", ends, ("fixed-free", "fixed-fixed")) == "fixed-free":
        waves -= 0.25
    M = positive("K", material.K) + 4 * positive("G", material.G) / 3
    speed = math.sqrt(M * (1 - log_stretch) / positive("rho_c", material.rho_c))
    k = 2 * math.pi * waves / length
    frequency = speed * waves / length
    phase = 2 * math.pi * frequency * t
    return StandingWave(
        displacement=amplitude * np.sin(k * x) * np.cos(phase),
        velocity=-2 * math.pi * frequency * amplitude * np.sin(k * x) * np.sin(phase),
        strain=amplitude * k * np.cos(k * x) * np.cos(phase),
        frequency=frequency,
        wave_speed=speed,
    )
