"""Hoppers: the largest angle of mass flow, the rate of discharge, pressures in the bin above."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from granular.model.gravity import EARTH
from granular.tools.arrays import Array
from granular.tools.checks import in_range, integer, non_negative, positive


def mass_flow_limit(wall_deg: float, effective_deg: float, *, dim: int = 2) -> float:
    """Largest half angle of a hopper in which all the material moves (Jenike 1964, Bulletin 123).

    Jenike's charts come from radial stress fields. For a cone their limit is

        90 - arccos((1 - sin d)/(2 sin d))/2 - (w + arcsin(sin w/sin d))/2,

    with the wall friction angle w and the effective angle of internal friction d. For a plane
    hopper it is the fit of his chart by Arnold, McLean & Roberts (1982, "Bulk solids: storage, flow
    and handling", TUNRA, Newcastle), (exp(3.75 1.01^((d - 30)/10)) - w)/0.725; the chart has d of
    30 to 70 deg, and w below d - 3.

    Parameters
    ----------
    wall_deg : float
        Angle of wall friction [deg], >= 0 and less than `effective_deg`.
    effective_deg : float
        Effective angle of internal friction [deg], from 20 to 70. For a law without dilation it is
        `EarthPressure.coaxial_deg` of `earth_pressure(mu)`.
    dim : {2, 3}
        2 for a plane hopper, 3 for a cone.

    Returns
    -------
    float
        Half angle to the vertical [deg], at most 90. For a cone it is at least 0; the fit for a
        plane hopper falls below 0 at a large `wall_deg`.
    {raises}.
    """
    dim = integer("dim", dim, 2, 3)
    d = in_range("effective_deg", effective_deg, 20.0, 70.0)
    w = in_range("wall_deg", wall_deg, 0.0, d, open_high=True)
    if dim == 2:
        limit = (math.exp(3.75 * 1.01 ** ((d - 30.0) / 10.0)) - w) / 0.725
        return min(limit, 90.0)
    sine = math.sin(math.radians(d))
    turned = 0.5 * (w + math.degrees(math.asin(math.sin(math.radians(w)) / sine)))
    # Below asin(1/3) the cosine would exceed 1: there the limit is that of friction alone.
    return max(90.0 - 0.5 * math.degrees(math.acos(min((1 - sine) / (2 * sine), 1.0))) - turned, 0)


def hourglass_rate(
    orifice: float,
    angle_deg: float,
    mass: float,
    *,
    mu: float,
    rho: float,
    dim: int = 2,
    gravity: float = EARTH,
) -> float:
    """Rate of discharge of a narrow hopper with smooth walls (Savage 1965, Br. J. Appl. Phys. 16).

    The hourglass theory: material that yields everywhere flows towards the apex of the walls,
    v = -A/r^(dim-1), between two free arcs, the opening at r_0 = D/(2 sin a) and the surface at
    r_1. With sigma_tt = K sigma_rr and the radial balance

        s' - (dim - 1) (K - 1) s/r = (dim - 1) rho A^2/r^(2 dim - 1) - rho g,

    s = sigma_rr = 0 at r_0 and r_1 determines A; r_1 follows from the remaining mass. As the angle
    tends to 0 the solution is exact, except for the slow fall of the surface. Here g is the mean of
    its radial component over the arc, which is right to the second order in the angle. K is that of
    flow without dilation at tau = mu p: (1 + mu)/(1 - mu) in 2D, where it is radial and coaxial,
    and (1 + mu/sqrt 3)/(1 - 2 mu/sqrt 3) in 3D.

    Parameters
    ----------
    orifice : float
        Width of the opening, or its diameter [m], > 0.
    angle_deg : float
        Half angle of the hopper [deg], 0 to 90, ends excluded.
    mass : float
        Mass in the hopper above the arc of the opening [kg; in 2D per metre of depth], > 0.
    mu : float
        Friction coefficient tau/p, >= 0; below 1 in 2D and sqrt(3)/2 in 3D.
    rho : float
        Bulk density [kg/m3].
    dim : {2, 3}
        2 for a plane hopper, 3 for a cone.

    Returns
    -------
    float
        Rate [kg/s; in 2D per metre of depth].
    {raises}.
    """
    dim = integer("dim", dim, 2, 3)
    a = math.radians(in_range("angle_deg", angle_deg, 0.0, 90.0, open_low=True, open_high=True))
    mu = in_range("mu", mu, 0.0, (1.0, math.sqrt(0.75))[dim - 2], open_high=True)
    rho, mass = positive("rho", rho), positive("mass", mass)
    first = positive("orifice", orifice) / (2 * math.sin(a))
    arc = 2 * a if dim == 2 else 2 * math.pi * (1 - math.cos(a))
    radial = math.sin(a) / a if dim == 2 else 0.5 * (1 + math.cos(a))
    g = positive("gravity", gravity) * radial
    last = (first**dim + dim * mass / (rho * arc)) ** (1 / dim)
    ratio = (1 + mu) / (1 - mu) if dim == 2 else (3 + math.sqrt(3) * mu) / (3 - math.sqrt(12) * mu)
    m, far = (dim - 1) * (ratio - 1), last / first
    # Integrals of r^-m and of r^(1 - 2 dim - m) from the opening to the surface, over r_0.
    near_one = (1 - m) * math.log(far)
    weight = math.log(far) * (math.expm1(near_one) / near_one if near_one else 1.0)
    inertia = (dim - 1) * (1 - far ** (2 - 2 * dim - m)) / (2 * dim - 2 + m)
    return rho * arc * first ** (dim - 1) * math.sqrt(g * first * weight / inertia)


def rose_tanaka_factor(angle_deg: ArrayLike, stagnant_deg: float) -> Array:
    """Rate of a hopper over that of a flat bottom (Rose & Tanaka 1959, The Engineer 208, 465).

    It is (tan a tan s)^-0.35 for a half angle a below 90 - s, and 1 beyond, where stagnant material
    makes the walls (as given by Nedderman 1992, "Statics and kinematics of granular materials").

    Parameters
    ----------
    angle_deg : array_like
        Half angle to the vertical [deg], 0 to 90, ends excluded.
    stagnant_deg : float
        Angle of the boundary of the stagnant zone to the horizontal [deg], 0 to 90, ends excluded.

    Returns
    -------
    ndarray, of the shape of `angle_deg`
    {raises}.
    """
    angle = np.asarray(angle_deg, dtype=float)
    if not np.all((angle > 0) & (angle < 90)):
        raise ValueError(f"angle_deg = {angle} must lie between 0 and 90")
    ends = {"open_low": True, "open_high": True}
    stagnant = math.radians(in_range("stagnant_deg", stagnant_deg, 0.0, 90.0, **ends))
    # Beyond 90 - s the product of the tangents exceeds 1.
    return np.minimum(np.tan(np.radians(angle)) * math.tan(stagnant), 1.0) ** -0.35


def janssen_pressure(
    depth: ArrayLike,
    width: float,
    *,
    friction: float,
    ratio: float,
    rho: float,
    dim: int = 2,
    gravity: float = EARTH,
) -> Array:
    """Mean vertical stress in a bin (Janssen 1895): rho g L (1 - exp(-z/L)).

    L = W/(2 (dim - 1) mu K), with the ratio K of the stress on the wall to the mean vertical
    stress. The pressure on the wall is K times the result.

    Parameters
    ----------
    depth : array_like
        Depth z below the surface [m], >= 0.
    width : float
        Width W between two walls, or diameter of the bin [m].
    friction : float
        Coefficient of friction at the wall, >= 0.
    ratio : float
        K, > 0.
    rho : float
        Bulk density [kg/m3].
    dim : {2, 3}
        2 for two walls, 3 for a cylinder.

    Returns
    -------
    ndarray, of the shape of `depth`
        Stress [Pa].
    {raises}.
    """
    z = np.asarray(depth, dtype=float)
    if not np.all((z >= 0) & np.isfinite(z)):
        raise ValueError(f"depth = {z} must be finite and >= 0")
    sides = 2.0 * (integer("dim", dim, 2, 3) - 1)
    rate = sides * non_negative("friction", friction) * positive("ratio", ratio)
    rate /= positive("width", width)
    weight = positive("rho", rho) * positive("gravity", gravity)
    return weight * (z if rate == 0.0 else -np.expm1(-rate * z) / rate)
