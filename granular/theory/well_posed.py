"""Well-posedness of the mu(I) law (Barker, Schaeffer, Bohorquez & Gray 2015, J. Fluid Mech. 779).

The law of an incompressible flow, ``s = mu(I) p A`` with A = D/||D||, ``||D|| = sqrt(D:D/2)``, is
linearised about a flow of uniform shear for waves so short that the base flow does not vary over
them. With r = d ln mu/d ln I and I ~ ||D||/sqrt(p),

    s' = mu (1 - r/2) p' A + (mu p/||D||) (D' + (r - 1) A (A:D')/2).

A wave along the unit vector k has velocities along the normal t of k, because the flow is
incompressible. The momentum balance along k determines p'. The wave then grows at the rate
(|k|^2 mu p/(2 rho ||D||)) times ``-(1 + (r - 1) a^2/(1 - q b))`` with a = k.A.t, b = k.A.k,
a^2 + b^2 = 1 and q = mu (1 - r/2). This rate grows without bound as the wave gets shorter if
``r - q b + (1 - r) b^2 < 0`` for some direction, that is for a positive

    C = q^2 - 4 r (1 - r) = 4 r^2 - 4 r + mu^2 (1 - r/2)^2.

The material enters only by mu_s and mu_2, and the flow only by I/I0.

With a cohesion c the shear stress is c + mu(I) p. The same steps lead to the same C with q as it
is, d tau/dp, and with d ln tau/d ln I = r mu p/(c + mu p) for r: then the result depends on the
pressure, too.

The regularised law of Barker & Gray 2017 (`granular.RegularisedMuI`) has a different mu and r.
Below I1 r = mu^2/(2 alpha), with which C is not positive from rest on.
"""

import math
from typing import Any, overload

import numpy as np
import scipy

from granular.materials import NGF, DilatantMuI, MuI, RegularisedMuI
from granular.theory.incline import check_cohesionless, check_mu_I, check_not_dilating
from granular.tools.arrays import Array
from granular.tools.checks import in_range, positive

_Law = MuI | RegularisedMuI | NGF
"""Laws with mu(I); of a nonlocal one it is that of steady uniform flow."""

_PER_DECADE = 40
"""Values of I/I0 in a decade between which the ends of the range are searched for."""


def _searched(material: _Law) -> Array:
    """Values of I/I0 between which the ends of the range lie: from 1e-6 to 1e6 or beyond.

    For I << I0 the law is linear in I, so that they are smaller in the ratio mu_s/(mu_2 - mu_s) if
    mu_2 > 2 mu_s. With little friction the range is wide, for C is about mu^2 - 4 r: its ends are
    where r = mu_s^2/4 and mu_2^2/4, with r = I/I0 (mu_2 - mu_s)/mu_s and (mu_2 - mu_s)/(mu_2 I/I0).
    """
    gain = material.mu_2 - material.mu_s
    ratio = min(1.0, material.mu_s / gain)
    low = min(-6, math.floor(math.log10(material.mu_s**2 / 40)))
    high = max(6, math.ceil(math.log10(40 * gain / material.mu_2**3 / ratio)))
    return np.logspace(low, high, _PER_DECADE * (high - low) + 1) * ratio


@overload
def ill_posedness(scaled: float, material: _Law, pressure: float | None = None) -> float: ...
@overload
def ill_posedness(scaled: Array, material: _Law, pressure: Array | None = None) -> Array: ...
def ill_posedness(
    scaled: float | Array, material: _Law, pressure: float | Array | None = None
) -> float | Array:
    """Discriminant C of Barker et al. 2015: the law is ill posed where it is positive.

    Parameters
    ----------
    scaled : float or ndarray
        I/I0, >= 0 (`granular.measure.scaled_inertial_number` of points); nan gives nan.
    material : MuI, RegularisedMuI or NGF
    pressure : float or ndarray, optional
        Pressure [Pa], > 0; needed if the material has a cohesion.

    Returns
    -------
    float or ndarray
        C, without unit.

    Raises
    ------
    TypeError
        For a `DilatantMuI`, of which `granular.theory.shear_wave_growth` decides.
    ValueError
        For a material with cohesion without a pressure.
    """
    check_not_dilating(material)
    mu, r = _friction(scaled, material)
    q, cohesion = mu * (1 - r / 2), getattr(material, "cohesion", 0.0)
    if cohesion:
        if pressure is None:
            raise ValueError(
                f"pressure = None must be given for a material with the cohesion {cohesion}"
            )
        r = r * mu * pressure / (cohesion + mu * pressure)
    return q**2 - 4 * r * (1 - r)


def _friction(x: float | Array, material: _Law | DilatantMuI) -> tuple[Any, Any]:
    """Friction mu at x = I/I0, and r = d ln mu/d ln I."""
    gain = material.mu_2 - material.mu_s
    if not isinstance(material, RegularisedMuI):
        mu = material.mu_s + gain * x / (1 + x)
        return mu, gain * x / ((1 + x) ** 2 * mu)
    mu, k = material.friction(x * material.I0), material.mu_inf * material.I0
    fast = (gain + k * x * (2 + x)) * x / (1 + x) ** 2
    creeps = x * material.I0 <= material.I1
    with np.errstate(invalid="ignore", divide="ignore"):
        return mu, np.where(creeps, mu**2 / (2 * material.alpha), fast / mu)[()]


def well_posed_range(material: _Law) -> tuple[float, float] | None:
    """Range of I/I0 in which the law is well posed; of the regularised law it begins at 0.

    Parameters
    ----------
    material : MuI, RegularisedMuI or NGF

    Returns
    -------
    tuple of float, or None
        Ends of the range; None if there is none, because mu_2 is too close to mu_s.

    Raises
    ------
    TypeError
        For a `DilatantMuI`, of which `granular.theory.shear_wave_growth` decides.
    ValueError
        For a material with cohesion, whose range depends on the pressure.
    """
    check_cohesionless(material)
    check_not_dilating(material)
    searched = _searched(material)
    sign = ill_posedness(searched, material)
    inside = np.flatnonzero(sign < 0)
    if not len(inside):
        return None
    regularised = isinstance(material, RegularisedMuI)
    first, last = inside[0], inside[-1]

    def root(i: int) -> float:
        return float(
            scipy.optimize.brentq(ill_posedness, *searched[i : i + 2], args=(material,), rtol=1e-12)
        )

    return 0.0 if regularised else root(first - 1), root(last)


def well_posed_slopes(material: MuI | NGF) -> tuple[float, float] | None:
    """Range of slopes [degrees] in which steady flow down a rough incline is well posed.

    The tangent of the slope is mu(I).

    Parameters
    ----------
    material : MuI or NGF
        Without cohesion.

    Returns
    -------
    tuple of float, or None
        Ends of the range; None as in `well_posed_range`.

    Raises
    ------
    TypeError, ValueError
        For a `RegularisedMuI`, which has no yield stress, a material with cohesion, or
        ``rheology="linear_mu_I"``, whose friction has no limit.
    """
    check_mu_I(material)
    ends = well_posed_range(material)
    if ends is None:
        return None
    gain = material.mu_2 - material.mu_s
    low, high = (math.degrees(math.atan(material.mu_s + gain * x / (1 + x))) for x in ends)
    return low, high


def scaled_inertial_number_of_slope(angle_deg: float, material: MuI) -> float:
    """I/I0 of steady flow down a rough incline (Dunatunga & Kamrin 2015, A of eq. 4.6).

    Parameters
    ----------
    angle_deg : float
        Inclination [degrees], in [0, 90).
    material : MuI or NGF
        Without cohesion. Or any object with ``mu_s`` and ``mu_2``.

    Returns
    -------
    float
        I/I0; 0 if the tangent of the slope is at most mu_s, infinite if it is at least mu_2.

    Raises
    ------
    TypeError, ValueError
        If the angle is not in [0, 90), or the material is a `RegularisedMuI`, has a cohesion, with
        which I depends on the depth, or ``rheology="linear_mu_I"``, which has no such scale.
    """
    check_mu_I(material)
    slope = math.tan(math.radians(in_range("angle_deg", angle_deg, 0.0, 90.0, open_high=True)))
    if slope >= material.mu_2:
        return math.inf
    return max(slope - material.mu_s, 0.0) / (material.mu_2 - slope)


_SMOOTHEST = 1e-3
"""Friction below which the growth rate of short waves is that of its limit for little friction,
-det Q/tr Q at its largest; the error is of the order mu. The difference of two roots that gives it
else is lost in rounding."""
_ROUGHEST = 1e6
"""Friction above which the growth rate of short waves is that of this friction, against overflow:
such material does not yield."""


def short_wave_growth(mu: float, nu: float) -> float:
    """Bound of the growth rate of short waves in slow plastic flow, over c_w k.

    Rate-independent friction tau = mu p without dilation, with elasticity, is linearised in the
    plane for waves along the unit vector n with velocity w,

        rho s^2 w = -k^2 Q w,  Q = (K + G/3) n n + G 1 - G a (a + mu (K/G) n),  a = N n,

    where N is the direction of shear, N:N = 2. With c = n.a, the trace of Q is
    K + 4 G/3 - mu K c and its determinant G c (c (K + G/3) - mu K), so that one eigenvalue is
    negative, and waves grow at a rate s in proportion to k, for 0 < c < mu K/(K + G/3) (the loss of
    ellipticity of Rudnicki & Rice 1975, J. Mech. Phys. Solids 23). Rate dependence and a finite
    shear rate only make waves grow slower: of the mu(I) law this is the limit I -> 0.

    Parameters
    ----------
    mu : float
        Friction coefficient, > 0.
    nu : float
        Poisson's ratio, 0 <= nu < 0.5.

    Returns
    -------
    float
        Largest s/(c_w k) over all directions, c_w = sqrt((K + 4 G/3)/rho).
    """
    mu = min(positive("mu", mu), _ROUGHEST)
    nu = in_range("nu", nu, 0.0, 0.5, open_high=True)
    K, G = (1 + nu) / (3 * (1 - nu)), (1 - 2 * nu) / (2 * (1 - nu))  # over K + 4 G/3

    if mu < _SMOOTHEST:
        return 0.5 * mu * K * math.sqrt(G / (K + G / 3))

    def squared(c: float) -> float:
        half = (1 - mu * K * c) / 2
        return math.sqrt(half**2 - G * c * (c * (K + G / 3) - mu * K)) - half

    end = min(mu * K / (K + G / 3), 1.0)
    best = scipy.optimize.minimize_scalar(
        lambda c: -squared(c), bounds=(0.0, end), method="bounded"
    )
    return math.sqrt(-best.fun)


def viscous_growth(mu: float) -> float:
    """Growth rate of waves in slow, incompressible flow, times rho gdot/(mu p k^2).

    It is the rate of Barker et al. 2015 for I -> 0 (r = 0, q = mu) in the direction in which waves
    grow fastest: the maximum of (1 - b^2)/(1 - mu b) - 1, which is
    2 (1 - sqrt(1 - mu^2))/mu^2 - 1 = (mu/(1 + sqrt(1 - mu^2)))^2.

    Parameters
    ----------
    mu : float
        Friction coefficient, > 0; 1 stands for larger ones, where the growth has no bound.
    """
    mu = min(positive("mu", mu), 1.0)
    return (mu / (1 + math.sqrt(1 - mu**2))) ** 2
