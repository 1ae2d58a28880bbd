"""Waves with elastic damping, in a solid of Kelvin and Voigt: viscous stress of T times the elastic
rate."""

from __future__ import annotations

import math

import numpy as np
import scipy

from granular.tools.checks import non_negative, positive

_MODES = 4000
"""Modes of a bar: the force of a bar with T c/L = 1e-3 is then exact to 1e-6."""


def wave_decay(*, wavenumber: float, wave_speed: float, damping_time: float) -> float:
    """Rate at which the amplitude of a standing wave decays [1/s].

    The amplitude a of a wave obeys a" + T w^2 a' + w^2 a = 0 with w = wavenumber wave_speed, so
    that it decays as exp(-w^2 T t/2). For w T < 2 it oscillates at w sqrt(1 - (w T/2)^2).

    Parameters
    ----------
    wavenumber : float
        Wavenumber k [1/m], > 0.
    wave_speed : float
        Speed c of waves without elastic damping [m/s], > 0.
    damping_time : float
        Ratio T of the viscosities to the moduli [s], >= 0 (`Material.damping_time`).

    Raises
    ------
    ValueError
        For values out of range, and waves that do not oscillate, w T >= 2.
    """
    w = positive("wavenumber", wavenumber) * positive("wave_speed", wave_speed)
    if w * non_negative("damping_time", damping_time) >= 2.0:
        raise ValueError(
            f"damping_time = {damping_time} must be < {2.0 / w:.6g} s for a wave that oscillates"
        )
    return 0.5 * w * w * damping_time


def bar_restitution(*, length: float, wave_speed: float, damping_time: float) -> float:
    """Coefficient of restitution of a bar that hits a rigid wall with its end.

    Until it leaves the wall, its modes sin(k x) with k = (n + 1/2) pi/L obey the equation of
    `wave_decay`. It leaves when the stress at the wall, elastic and viscous, has fallen to zero.
    The coefficient is the mean velocity then over that of the impact. It depends on T c/L only: the
    rest of the energy is in vibrations, or was dissipated.

    Parameters
    ----------
    length : float
        Length L of the bar [m], > 0.
    wave_speed : float
        Speed c of waves without elastic damping [m/s], > 0.
    damping_time : float
        Ratio T of the viscosities to the moduli [s] (`Material.damping_time`), at least 0.001 L/c,
        below which the series converges slowly, and at most L/c.

    Raises
    ------
    ValueError
        For values out of range.
    """
    crossing = positive("length", length) / positive("wave_speed", wave_speed)
    ratio = positive("damping_time", damping_time) / crossing
    if not 1e-3 <= ratio <= 1.0:
        raise ValueError(
            f"damping_time = {damping_time} must be {1e-3 * crossing:.6g} to {crossing:.6g} s"
        )
    k = (np.arange(_MODES) + 0.5) * math.pi  # with L = c = 1
    root = np.sqrt((0.5 * ratio * k * k) ** 2 - k * k + 0j)
    slow, fast = -0.5 * ratio * k * k + root, -0.5 * ratio * k * k - root

    def stress(time: float) -> float:
        """Stress at the wall, tension positive, of an impact with the velocity -1."""
        a, rate = _impulse_response(slow, fast, time)
        return float(np.sum(-2.0 * (a + ratio * rate)))

    # Undamped, the tension arrives at t = 2; damped contacts last a little longer.
    times = np.linspace(1.0, 6.0, 501)
    begin = next(t for t in times if stress(t) < 0.0 <= stress(t + 0.01))
    end = scipy.optimize.brentq(stress, begin, begin + 0.01, xtol=1e-12)
    return float(np.sum(-2.0 / k**2 * _impulse_response(slow, fast, end)[1]))


def _impulse_response(
    slow: np.ndarray, fast: np.ndarray, time: float
) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and velocity after this time of modes that start from 0 with the velocity 1."""
    a, b = np.exp(slow * time), np.exp(fast * time)
    difference = slow - fast
    return ((a - b) / difference).real, ((slow * a - fast * b) / difference).real
