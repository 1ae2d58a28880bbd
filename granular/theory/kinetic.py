"""Pressure of a granular gas from kinetic theory, which the law neglects below rho_c.

The formulas are from appendix A of Dunatunga & Kamrin 2015, after Jenkins & Berzi (2012) and da
Cruz et al. (2005). The disconnected state is stress-free; these estimates, taken at a packing
fraction close to ``Phi_c = rho_c/rho_s``, show how large the neglected stress is.

The printed text disagrees with its own equation of state (2.7), ``p = K (1 - rho_c/rho)``, in two
equations, which are made consistent here. The elastic volume (A24) must read
``v_e/m = -p/(rho_c K)``, hence ``p = -Phi_c K/Phi_e`` in place of ``-K Phi_e`` in (A12). The laws
of the package integrate (A4) instead, ``p = K ln(rho/rho_c)``, which is larger than (2.7) by the
share p/2K, to first order; only `coupled_shear` depends on the choice, since (A11) adds volumes.
And tr D in (A16)-(A23) is the rate of *compression*. The theory diverges at Phi = 0.6, below Phi_c
= 0.612 of table 1: (A10) and (A23) cannot be evaluated at that Phi_c, unless the packing fraction
is shifted by the delta that the text allows in (A11).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.materials import MuI
from granular.tools.arrays import Array
from granular.tools.checks import finite, in_range, non_negative, positive

#: Packing fraction at which the kinetic pressure diverges.
JAMMED = 0.6
_DENSE = 0.49  # from this packing fraction on, the radial function is that of a dense gas


def radial_function(packing_fraction: ArrayLike) -> Array:
    """Radial function G of the equation of state (A5).

    It is ``Phi (1 - Phi/2)/(1 - Phi)^3`` below Phi = 0.49, and ``0.63 Phi/(0.6 - Phi)`` from there
    on.

    Parameters
    ----------
    packing_fraction : array_like
        Phi in [0, 0.6).

    Raises
    ------
    ValueError
        If Phi is outside 0 <= Phi < 0.6.
    """
    phi = np.asarray(packing_fraction, dtype=float)
    if not (np.all(phi >= 0) and np.all(phi < JAMMED)):
        raise ValueError(f"packing_fraction = {packing_fraction!s} must lie in [0, {JAMMED})")
    return np.where(phi < _DENSE, _dilute(phi), 0.63 * phi / (JAMMED - phi))


def _dilute(phi: Array) -> Array:
    return phi * (1 - phi / 2) / (1 - phi) ** 3


def gas_pressure(
    packing_fraction: ArrayLike, temperature: ArrayLike, restitution: float, material: MuI
) -> Array:
    """Pressure [Pa] of the gas (A5), ``p = 4 rho G F T = rho (4 lambda G + 1) T``.

    Here ``lambda = (1 + restitution)/2`` and ``F = lambda + 1/(4 G)``.

    Parameters
    ----------
    packing_fraction, temperature : array_like
        Phi and the granular temperature [m2/s2], broadcast together.
    material : MuI
        Or any object with ``rho_s`` [kg/m3].
    """
    phi = np.asarray(packing_fraction, dtype=float)
    factor = 4 * _lambda(restitution) * radial_function(phi) + 1
    return material.rho_s * phi * factor * np.asarray(temperature, dtype=float)


def packing_fraction_of_inertial_number(inertial_number: ArrayLike, restitution: float) -> Array:
    """Phi(I) in steady shear, the root of ``Phi (4 lambda G(Phi) + 1) = 9/I``.

    This is (A5) with the shear temperature (A6). With the dense G it is the quadratic (A8), whose
    root is (A9); where that root is below Phi = 0.49 the dilute G is used.

    Parameters
    ----------
    inertial_number : array_like
        Inertial number I >= 0, any shape.

    Returns
    -------
    ndarray
        Packing fraction in (0, 0.6], 0.6 at I = 0.
    """
    number = np.asarray(inertial_number, dtype=float)
    if not (np.all(number >= 0) and np.all(np.isfinite(number))):
        raise ValueError(f"inertial_number = {inertial_number!s} must be finite and >= 0")
    lam = _lambda(restitution)
    half = (number / 9 + 1 / JAMMED) / 2
    phi = np.asarray(1 / (half + np.sqrt(half**2 + number / (9 * JAMMED) * (2.52 * lam - 1))))
    dilute = phi < _DENSE
    if np.any(dilute):
        phi[dilute] = _dilute_packing_fraction(9 / number[dilute], lam)
    return phi


def _dilute_packing_fraction(target: Array, lam: float) -> Array:
    """Root of Phi (4 lam G + 1) = target below 0.49, by bisection (the left side increases)."""
    low, high = np.zeros_like(target), np.full_like(target, _DENSE)
    for _ in range(60):
        middle = (low + high) / 2
        below = middle * (4 * lam * _dilute(middle) + 1) < target
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return (low + high) / 2


def shear_temperature(shear_rate: ArrayLike, inertial_number: ArrayLike, diameter: float) -> Array:
    """Granular temperature [m2/s2] in steady shear (A6), ``(shear_rate d)^2/(9 I)``.

    Parameters
    ----------
    shear_rate, inertial_number : array_like
        Shear rate [1/s] and inertial number I > 0, broadcast together.
    diameter : float
        Grain diameter d [m], > 0.
    """
    rate = np.asarray(shear_rate, dtype=float)
    return (rate * positive("diameter", diameter)) ** 2 / (9 * np.asarray(inertial_number))


def shear_pressure(
    packing_fraction: ArrayLike,
    shear_rate: ArrayLike,
    *,
    diameter: float,
    restitution: float,
    material: MuI,
) -> Array:
    """Pressure [Pa] of steady shear at a given packing fraction (A10).

    It is ``rho_s Phi^2 (4 lambda G + 1)^2 (shear_rate d)^2/81``: (A5) and (A6) with
    ``I = shear_rate d sqrt(rho_s/p)`` solved for p. From Phi = 0.49 on, 4 lambda G is the printed
    ``2.52 lambda Phi/(0.6 - Phi)``. The function is the inverse of
    `packing_fraction_of_inertial_number`.

    Parameters
    ----------
    packing_fraction : array_like
        Phi in [0, 0.6).
    shear_rate : array_like
        Shear rate [1/s].
    diameter : float
        Grain diameter [m].
    material : MuI
        Or any object with ``rho_s`` [kg/m3].
    """
    phi = np.asarray(packing_fraction, dtype=float)
    factor = phi * (4 * _lambda(restitution) * radial_function(phi) + 1)
    speed = np.asarray(shear_rate, dtype=float) * positive("diameter", diameter)
    return material.rho_s * (factor * speed / 9) ** 2


def temperature_coefficients(
    packing_fraction: float, compression_rate: float, *, diameter: float, restitution: float
) -> tuple[float, float]:
    """A [1/s] and B [1/m] of ``dT/dt = A T - B T^1.5`` (A17-A19).

    ``A = (8/3) G F compression_rate``, ``B = 8 G (1 - restitution^2)/(sqrt(pi) d)``.

    Parameters
    ----------
    packing_fraction : float
        Phi in (0, 0.6).
    compression_rate : float
        -tr D [1/s]; a positive value heats the gas (the tr D of the text has the opposite sign).
    diameter : float
        Grain diameter d [m], > 0.

    Returns
    -------
    tuple of 2 floats
        A and B.
    {raises}.
    """
    positive("packing_fraction", packing_fraction)
    g = float(radial_function(packing_fraction))
    f = _lambda(restitution) + 1 / (4 * g)
    loss = 8 * g * (1 - restitution**2) / (math.sqrt(math.pi) * positive("diameter", diameter))
    return 8 / 3 * g * f * finite("compression_rate", compression_rate), loss


def granular_temperature(
    times: ArrayLike,
    temperature0: float,
    packing_fraction: float,
    compression_rate: float,
    *,
    diameter: float,
    restitution: float,
) -> Array:
    """Solution T(t) [m2/s2] of ``dT/dt = A T - B T^1.5`` at constant A and B (A21).

    sqrt(T) is logistic: ``u0/(exp(-At/2) + u0 B (1 - exp(-At/2))/A)`` with ``u0 = sqrt(T0)``. This
    is (A21) with its constant determined by T0; it holds for expansion (A < 0) and A = 0 as well.

    Parameters
    ----------
    times : array_like
        Times [s], >= 0.
    temperature0 : float
        T at t = 0 [m2/s2], >= 0; zero stays zero.
    packing_fraction, compression_rate, diameter, restitution
        As in `temperature_coefficients`.
    """
    times = np.asarray(times, dtype=float)
    if not np.all(times >= 0):
        raise ValueError(f"times = {times} must be >= 0")
    gain, loss = temperature_coefficients(
        packing_fraction, compression_rate, diameter=diameter, restitution=restitution
    )
    start = math.sqrt(non_negative("temperature0", temperature0))
    growth = gain * times / 2
    with np.errstate(over="ignore"):
        fade = np.exp(-growth)
        span = times / 2 if gain == 0 else -np.expm1(-growth) / gain
        return (start / (fade + start * loss * span)) ** 2


def compression_temperature(
    packing_fraction: ArrayLike, compression_rate: ArrayLike, *, diameter: float, restitution: float
) -> Array:
    """Upper bound T_c [m2/s2] of the temperature under steady compression (A22).

    It is the fixed point of (A17),
    ``A^2/B^2 = pi/(144 (1 - lambda)^2) (1 + 1/(4 lambda G))^2 (compression_rate d)^2``. Under
    expansion the gas cools and the bound is 0. For elastic grains (restitution 1) there is no
    bound.

    Parameters
    ----------
    packing_fraction : array_like
        Phi in (0, 0.6).
    compression_rate : array_like
        -tr D [1/s].
    diameter : float
        Grain diameter [m].
    restitution : float
        Effective coefficient of restitution, in [0, 1).
    {raises}.
    """
    lam = _lambda(restitution)
    if lam == 1:
        raise ValueError("restitution = 1 must be below 1: the temperature has no bound")
    g = radial_function(packing_fraction)
    if not np.all(g > 0):
        raise ValueError(f"packing_fraction = {packing_fraction!s} must be > 0")
    rate = np.maximum(np.asarray(compression_rate, dtype=float), 0.0)
    speed = rate * positive("diameter", diameter) * (1 + 1 / (4 * lam * g))
    return math.pi / 144 * (speed / (1 - lam)) ** 2


def compression_pressure(
    packing_fraction: ArrayLike,
    compression_rate: ArrayLike,
    *,
    diameter: float,
    restitution: float,
    material: MuI,
) -> Array:
    """Pressure [Pa] of the gas at the bound of `compression_temperature` (A23).

    Parameters
    ----------
    packing_fraction, compression_rate, diameter, restitution
        As in `compression_temperature`.
    material : MuI
        Or any object with ``rho_s`` [kg/m3].

    Raises
    ------
    TypeError, ValueError
        As in `compression_temperature`.
    """
    temperature = compression_temperature(
        packing_fraction, compression_rate, diameter=diameter, restitution=restitution
    )
    return gas_pressure(packing_fraction, temperature, restitution, material)


@dataclass(frozen=True)
class CoupledShear:
    """Shear of elastic grains, with the elastic and the flowing volume in series.

    Attributes
    ----------
    p : float
        Pressure [Pa].
    packing_fraction_flow : float
        Phi_f.
    inverse_elastic : float
        1/Phi_e <= 0; it is zero at p = 0, where Phi_e itself is infinite.
    """

    p: float
    packing_fraction_flow: float
    inverse_elastic: float


def coupled_shear(
    packing_fraction: float,
    shear_rate: float,
    *,
    diameter: float,
    restitution: float,
    material: MuI,
    offset: float = 0.0,
) -> CoupledShear:
    """Pressure of sheared *elastic* grains at a given packing fraction (A11, A12).

    The equation ``1/(Phi + offset) = 1/Phi_e + 1/Phi_f`` is solved for p, where ``p = -Phi_c
    K/Phi_e`` (made consistent with eq. 2.7) and p is also the shear pressure (A10) at Phi_f. At
    rest it is less than the pressure of the laws by the share p/2K. The solution is unique: Phi_f
    increases with p and the elastic volume decreases.

    Parameters
    ----------
    packing_fraction : float
        Phi > 0; it may exceed 0.6.
    shear_rate : float
        Shear rate [1/s], >= 0.
    diameter, restitution
        As in `shear_pressure`.
    material : MuI
        Or any object with ``rho_s``, ``rho_c``, ``K``.
    offset : float
        The delta of the text, > -Phi. With ``0.6 - Phi_c`` the flowing volume jams at Phi_c.
    {raises}.
    """
    inverse = 1 / positive("packing_fraction + offset", packing_fraction + offset)
    speed = non_negative("shear_rate", shear_rate) * positive("diameter", diameter)
    stiffness = material.K * material.rho_c / material.rho_s

    def flow(p: float) -> float:
        if speed == 0:
            return JAMMED
        number = speed * math.sqrt(material.rho_s / p)
        return float(packing_fraction_of_inertial_number(number, restitution))

    def excess(log_p: float) -> float:
        p = math.exp(log_p)
        return 1 / flow(p) - p / stiffness - inverse

    if speed == 0:
        p = max(stiffness * (1 / JAMMED - inverse), 0.0)
    else:
        # Below the first bound Phi_f alone is too small; above the second the grains are compressed
        # too much.
        low = math.log(material.rho_s * speed**2 * 1e-12)
        while excess(low) < 0:
            low -= 20
        high = max(low, math.log(stiffness)) + 1
        while excess(high) > 0:
            high += 5
        p = math.exp(scipy.optimize.brentq(excess, low, high, xtol=1e-14, rtol=1e-14))
    return CoupledShear(p, flow(p) if p > 0 else JAMMED, -p / stiffness)


def _lambda(restitution: float) -> float:
    return (1 + in_range("restitution", restitution, 0.0, 1.0)) / 2
