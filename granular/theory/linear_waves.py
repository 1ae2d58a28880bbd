"""Growth of short waves in a flow of uniform shear, with the elasticity of the material.

`granular.theory.well_posed` has the limit of incompressible flow. Here the equations of the law are
linearised without further assumptions: the deviator s of the stress has the elastic rate of Jaumann
and relaxes by the plastic flow, and the pressure is that of the density, p = K c with c =
ln(rho/rho_c),

    rho Dv = div(s - p I),   Dc = -div v,
    Ds = 2 G (dev D - g s/(2 tau)) + W s - s W,   D and W the symmetric and the odd part of grad v,

with the plastic shear rate g of tau = mu(I) p, I ~ g/sqrt(p). About a flow v = (g y, 0) at a steady
stress, a small change of tau and p changes g by

    g' = g (tau' - mu (1 - r/2) p')/(r mu p),   r = d ln mu/d ln I,

so that a wave exp(i k.x) of (v_x, v_y, s_xx, s_yy, s_xy, c) changes at rates that are the
eigenvalues of a matrix. Material that dilates (`granular.DilatantMuI`) has the packing fraction phi
besides. In steady flow its angle of dilation is 0, and with the tangent psi = m (phi - phi_eq(I))

    Dc = -div v + psi g,   D ln(phi) = -psi g,   tau = (mu(I) + psi) p,

so that r is that of mu(I) + m (phi_c - phi_eq(I)), and g' has the further term -g m phi'/(r mu).
With a critical-state line phi_c depends on the pressure, and psi' and g' have terms of p' besides:
-m dphi_eq/dp p' and g m dphi_eq/dp p'/(r mu).

The wave vector is taken as constant, though the shear turns it: its component along y changes by
-g k_x per time. The differences of normal stress of the base flow, of the order of mu p/G, are
neglected.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from granular.materials import DilatantMuI, MuI, RegularisedMuI
from granular.materials.dilatant import DENSEST_CRITICAL
from granular.theory.incline import check_cohesionless
from granular.theory.well_posed import _friction
from granular.tools.checks import positive, vector

_Law = MuI | RegularisedMuI | DilatantMuI
"""Laws whose waves are known."""


def _base(material: _Law, inertial_number: float, pressure: float) -> tuple[float, float, float]:
    """Friction, r = d ln mu/d ln I, and shear rate [1/s] of the flow."""
    if not isinstance(material, _Law):
        raise TypeError(f"material = {material!r} must be a MuI, RegularisedMuI or DilatantMuI")
    check_cohesionless(material)
    if material.d is None or material.I0 is None:
        raise ValueError(
            f"material must have a grain diameter d and I0, has d = {material.d} and I0 = "
            f"{material.I0}"
        )
    mu, r = _friction(inertial_number / material.I0, material)
    if isinstance(material, DilatantMuI):
        r += _loosening(material, inertial_number, pressure) / mu
    rate = inertial_number / material.d * math.sqrt(pressure / material.rho_s)
    return float(mu), float(r), rate


def _loosening(material: DilatantMuI, inertial_number: float, pressure: float) -> float:
    """Derivative of the angle of dilation by ln I at a constant packing and pressure."""
    share = material.I0 * inertial_number / (material.I0 + inertial_number) ** 2
    span = material.critical_packing(pressure) - material.phi_fast
    return float(material.dilatancy * span * share)


def _stiffening(material: DilatantMuI, inertial_number: float, pressure: float) -> float:
    """Minus the derivative of the angle of dilation by ln p, at a constant packing and I."""
    critical = float(material.critical_packing(pressure))
    if not material.csl_slope or critical >= DENSEST_CRITICAL:
        return 0.0
    fall = 1.0 / material.phi_c - 1.0 / critical  # of the void ratio
    share = material.I0 / (material.I0 + inertial_number)
    return material.dilatancy * share * critical**2 * material.csl_exponent * fall


def shear_waves(
    *,
    material: _Law,
    inertial_number: float,
    pressure: float,
    wave_vector: tuple[float, float],
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Rates and shapes of waves in a flow (g y, 0) of uniform shear in 2D.

    Parameters
    ----------
    material : MuI, RegularisedMuI or DilatantMuI
        Without cohesion; made with `I0` and the diameter `d` of its grains.
    inertial_number, pressure : float
        Inertial number I of the flow and its pressure [Pa], > 0.
    wave_vector : tuple of 2 floats
        Wave vector [1/m].

    Returns
    -------
    rates : ndarray, shape (6,), or (7,) for a DilatantMuI
        Complex rates [1/s]; a wave grows if the real part is positive. The fastest comes first.
    shapes : ndarray, shape (6, 6) or (7, 7)
        Columns (v_x, v_y, s_xx, s_yy, s_xy, c, ln phi) of each [m/s, Pa, 1], up to a factor.
    {raises}.
    """
    number = positive("inertial_number", inertial_number)
    p = positive("pressure", pressure)
    x, y = vector("wave_vector", wave_vector, 2)
    mu, r, g = _base(material, number, p)
    G, K, rho, count = material.G, material.K, material.rho_c, 6
    if isinstance(material, DilatantMuI):
        packing = float(material.packing(number, p))
        rho, count = material.rho_s * packing, 7
    # Rows are equations, columns (v_x, v_y, s_xx, s_yy, s_xy, c, ln phi).
    A = np.zeros((count, count), dtype=complex)
    A[0, [2, 4, 5]] = np.array([x, y, -K * x]) * 1j / rho
    A[1, [4, 3, 5]] = np.array([x, y, -K * y]) * 1j / rho
    A[0, 1] = -g
    A[5, :2] = -1j * x, -1j * y
    third = 2.0 * G / 3.0
    A[2, :2] = 1j * third * 2.0 * x, -1j * third * y
    A[3, :2] = -1j * third * x, 1j * third * 2.0 * y
    A[4, :2] = 1j * G * y, 1j * G * x
    # The spin of the wave, (v_x' ik_y - v_y' ik_x)/2, turns the shear stress mu p of the flow, and
    # that of the flow, g/2, the stress of the wave.
    turn = 1j * mu * p
    A[2, :2] += turn * y, -turn * x
    A[3, :2] -= turn * y, -turn * x
    A[2, 4], A[3, 4] = g, -g
    A[4, 2], A[4, 3] = -0.5 * g, 0.5 * g
    # Plastic flow: D_p' has g s_xx'/(2 tau), and g'/2 along the shear.
    relax = G * g / (mu * p)
    A[2, 2] -= relax
    A[3, 3] -= relax
    faster = np.zeros(count)  # g' by each
    faster[4], faster[5] = g / (r * mu * p), -g * (1.0 - 0.5 * r) * K / (r * p)
    if isinstance(material, DilatantMuI):
        denser, loosens = material.dilatancy * packing, _loosening(material, number, p)
        stiffens = _stiffening(material, number, p)
        faster[5] += g * stiffens * K / (r * mu * p)
        faster[6] = -g * denser / (r * mu)
        dilates = loosens * faster  # psi' g
        dilates[5] -= (0.5 * loosens + stiffens) * g * K / p
        dilates[6] += denser * g
        A[5] += dilates
        A[6] -= dilates
    A[4] -= G * faster
    rates, shapes = np.linalg.eig(A)
    order = np.argsort(-rates.real)
    return rates[order], shapes[:, order]


def shear_wave_growth(
    *,
    material: _Law,
    inertial_number: float,
    pressure: float,
    wave_vector: tuple[float, float],
) -> float:
    """Growth rate of the fastest wave of a wave vector in a flow of uniform shear [1/s].

    See `shear_waves`. With a stiff material it is the rate of Barker et al. 2015, which is without
    bound for short waves where mu(I) is ill posed and falls with -k^2 elsewhere.

    Parameters
    ----------
    material, inertial_number, pressure, wave_vector
        As of `shear_waves`.

    Returns
    -------
    float
        Largest real part of the rates [1/s].

    Raises
    ------
    TypeError, ValueError
        As `shear_waves`.
    """
    rates, _ = shear_waves(
        material=material,
        inertial_number=inertial_number,
        pressure=pressure,
        wave_vector=wave_vector,
    )
    return float(rates[0].real)
