"""Jenike's flow factor and critical outlet beside closed forms and a chart."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_bvp

from granular import theory


def closed_form(angle_deg, wall_deg, effective_deg, dim):
    """The flow factor of Arnold & McLean (1976, Powder Technology 13, 255-261)."""
    a, w, d = (math.radians(x) for x in (angle_deg, wall_deg, effective_deg))
    m, sine = dim - 2, math.sin(d)
    b = 0.5 * (w + math.asin(math.sin(w) / sine))
    X = 2**m * sine / (1 - sine) * (math.sin(2 * b + a) / math.sin(a) + 1)
    top = (2 * (1 - math.cos(a + b))) ** m * (a + b) ** (1 - m) * math.sin(a)
    top += math.sin(b) * math.sin(a + b) ** (1 + m)
    Y = top / ((1 - sine) * math.sin(a + b) ** (2 + m))
    H = ((130 + angle_deg) / 65) ** m * ((200 + angle_deg) / 200) ** (1 - m)
    return Y * (1 + sine) * H / (2 * (X - 1) * math.sin(a))


@pytest.mark.parametrize("dim", [2, 3])
def test_narrow_smooth_hopper_has_the_stress_of_a_closed_form(dim):
    """Without shear the equilibrium along the axis is 1 = s ((2 dim - 1) sin d - 1), as in
    Nedderman (1992, section 7.5). The angle adds a term of the second order."""
    sine = math.sin(math.radians(40.0))
    narrow = (1 + sine) / ((2 * dim - 1) * sine - 1)

    def error(angle):
        H = theory.arch_factor(angle, dim=dim)
        found = theory.flow_factor(angle, 0.0, 40.0, dim=dim)
        return found * 2 * math.sin(math.radians(angle)) / H / narrow - 1

    coarse, fine = error(8.0), error(4.0)
    assert abs(fine) < 0.005
    assert math.log2(coarse / fine) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    "hopper", [(27.5, 19.0, 30.0, 3), (20.0, 20.0, 50.0, 3), (30.0, 20.0, 50.0, 2)]
)
def test_wall_stress_is_that_of_the_equilibrium_in_cartesian_coordinates(hopper):
    """A boundary value problem for the mean stress and the fall of the major stress below the
    horizontal, where d/dx = sin t + cos t d/dt and d/dz = cos t - sin t d/dt of r f(t)."""
    angle, wall, d = (math.radians(x) for x in hopper[:3])
    m, S = hopper[3] - 2, math.sin(d)

    def equilibrium(t, y):
        s, fall = y
        c, q, cos, sin = np.cos(2 * fall), np.sin(2 * fall), np.cos(t), np.sin(t)
        xx, zz, xz, hoop = s * (1 + S * c), s * (1 - S * c), -s * S * q, s * (1 + S)
        # xx', zz' and xz' are linear in s' and fall'
        dxx, dzz, dxz = (
            (1 + S * c, -2 * s * S * q),
            (1 - S * c, 2 * s * S * q),
            (-S * q, -2 * s * S * c),
        )
        a, b = (cos * dxx[k] - sin * dxz[k] for k in (0, 1))
        e, f = (cos * dxz[k] - sin * dzz[k] for k in (0, 1))
        g = -(sin * xx + cos * xz + m * (xx - hoop) / sin)
        h = -1.0 - (sin * xz + cos * zz + m * xz / sin)
        return np.array((g * f - b * h, a * h - e * g)) / (a * f - b * e)

    at_wall = angle + 0.5 * (wall + math.asin(math.sin(wall) / S))
    t = np.linspace(1e-6, angle, 81)
    start = np.array((np.full_like(t, 0.5), at_wall * t / angle))
    field = solve_bvp(
        equilibrium, lambda p, q: np.array((p[1], q[1] - at_wall)), t, start, max_nodes=20_000
    )
    assert field.success
    H = theory.arch_factor(hopper[0], dim=hopper[3])
    expected = field.y[0, -1] * (1 + S) * H / (2 * math.sin(angle))
    assert theory.flow_factor(*hopper[:3], dim=hopper[3]) == pytest.approx(expected, rel=1e-3)


def test_flow_factors_are_near_the_closed_form_and_the_chart():
    """The closed form has a uniform stress on each arc; measured: within 6 % for these hoppers, of
    angles well below that of mass flow. Rhodes (2008, example 10.1) reads 1.8 in Jenike's chart."""
    for hopper in (
        (10, 30, 50, 3),
        (20, 15, 40, 3),
        (20, 20, 50, 3),
        (15, 10, 40, 2),
        (30, 20, 50, 2),
    ):
        found = theory.flow_factor(*hopper[:3], dim=hopper[3])
        assert found == pytest.approx(closed_form(*hopper), rel=0.06), hopper
    assert theory.flow_factor(27.5, 19.0, 30.0, dim=3) == pytest.approx(1.8, abs=0.1)


@pytest.mark.parametrize(
    ("wall", "effective"), [(15.0, 30.0), (20.0, 40.0), (20.0, 50.0), (30.0, 60.0)]
)
def test_the_field_of_a_cone_exists_up_to_the_angle_of_mass_flow(wall, effective):
    """Jenike's limit of mass flow is where the radial field ends; the formula is within 1 deg."""
    limit = theory.mass_flow_limit(wall, effective, dim=3)
    assert theory.flow_factor(limit - 1.0, wall, effective, dim=3) > 1.0
    with pytest.raises(ValueError, match="no radial stress field"):
        theory.flow_factor(limit + 1.0, wall, effective, dim=3)


HOPPER = {"angle_deg": 27.5, "wall_deg": 19.0, "effective_deg": 30.0, "dim": 3, "density": 1300.0}


def test_outlet_where_the_flow_function_meets_the_flow_factor():
    """A power law of Pa, f = f0^(1 - n) s1^n, meets s1/ff at f = f0 ff^(n/(1 - n))."""
    n, reference = 0.4, 900.0
    found = theory.critical_outlet(lambda s: reference ** (1 - n) * s**n, **HOPPER)
    strength = reference * found.flow_factor ** (n / (1 - n))
    assert found.strength == pytest.approx(strength, rel=1e-9)
    assert found.consolidation == pytest.approx(strength * found.flow_factor, rel=1e-9)
    # Rhodes (2008, example 10.1): 1.3 kPa at the crossing, 0.25 m
    known = theory.critical_outlet(1300.0, gravity=9.81, **HOPPER)
    assert known.outlet == pytest.approx(0.250, abs=0.001)


def test_flow_functions_that_do_not_meet_the_line():
    assert theory.critical_outlet(lambda s: 0.9 * s, **HOPPER).outlet == math.inf
    assert theory.critical_outlet(lambda s: 0.1 * s, **HOPPER).outlet == 0.0
    assert theory.critical_outlet(0.0, **HOPPER).outlet == 0.0
    with pytest.raises(ValueError, match=r"strength\(1\) = -1"):
        theory.critical_outlet(lambda s: -s, **HOPPER)
