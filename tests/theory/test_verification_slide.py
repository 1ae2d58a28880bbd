"""Slides on a Coulomb slope: limits by hand, and the equations of motion by quadrature."""

import math

import pytest
from scipy.integrate import solve_ivp

from granular import theory


def test_earth_pressure_of_a_slide_has_its_two_ends():
    """Smooth: Rankine's active state. Where the base yields like the material: Mohr's circle
    touches the yield line at the base, (1 + sin^2)/cos^2."""
    mu = 0.4
    smooth = theory.earth_pressure(mu).active_coaxial
    assert theory.sliding_earth_pressure(mu, 0.0) == pytest.approx(smooth, rel=1e-12)
    rough = theory.sliding_earth_pressure(mu, mu / math.sqrt(1 - mu**2))
    assert rough == pytest.approx((1 + mu**2) / (1 - mu**2), rel=1e-7)
    with pytest.raises(ValueError, match=r"base = 0\.5 must be"):
        theory.sliding_earth_pressure(mu, 0.5)


@pytest.mark.parametrize("bend", [0.05, 0.3, 1.0])
def test_block_against_its_equation_of_motion(bend):
    angle, mu, g, start = math.radians(35.0), 0.3, 9.81, 0.9
    tangent = bend * math.tan(angle / 2)
    first = (start - tangent * math.cos(angle)) / math.cos(angle)

    def rate(s, y):
        on_arc = min(max(s - first, 0.0), bend * angle)
        psi, curved = angle - on_arc / bend, first < s < first + bend * angle
        return [2 * g * (math.sin(psi) - mu * math.cos(psi)) - 2 * mu * y[0] / bend * curved]

    speed2 = 0.0
    for ends in ((0.0, first), (first, first + bend * angle)):
        inner = (ends[0] + 1e-12, ends[1] - 1e-12)
        speed2 = solve_ivp(rate, inner, [speed2], rtol=1e-10, atol=1e-12).y[0, -1]
    stops = theory.block_runout(angle_deg=35.0, bend=bend, mu=mu, distance=start)
    assert stops == pytest.approx(tangent + speed2 / (2 * mu * g), rel=1e-8)
    # the energy line: less than without the press of the arc
    assert start * math.tan(angle) / (start + stops) > mu
