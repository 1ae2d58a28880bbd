"""Elastic waves in a solid of Kelvin and Voigt, whose viscous stress is T times its elastic rate."""

from __future__ import annotations

from granular.checks import non_negative, positive

__all__ = ["wave_decay"]


def wave_decay(*, wavenumber: float, wave_speed: float, damping_time: float) -> float:
    """Rate at which the amplitude of a standing wave decays [1/s].

    The amplitude a of a wave obeys a" + T w^2 a' + w^2 a = 0 with w = wavenumber wave_speed, so
    that it decays as exp(-w^2 T t/2). For w T < 2 it oscillates at w sqrt(1 - (w T/2)^2).

    Parameters
    ----------
    wavenumber : float
        Wavenumber k [1/m], > 0.
    wave_speed : float
        Speed c of waves without damping [m/s], > 0.
    damping_time : float
        Ratio T of the viscosities to the moduli [s], >= 0 (`Material.damping_time`).

    Returns
    -------
    float

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
