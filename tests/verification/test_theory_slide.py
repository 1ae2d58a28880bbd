"""Slides on a Coulomb slope: limits by hand, and the equations of motion by quadrature."""

import math

import numpy as np
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


def test_cap_keeps_its_energy_of_spreading():
    """First integral: L'^2/2 + 2 K g cos h_0 L_0/L is constant; at first L'' t^2/2 is exact."""
    cap = {"angle_deg": 35.0, "mu": 0.3, "half_length": 0.25, "thickness": 0.05, "K": 0.7}
    times = np.linspace(0.0, 1.0, 2001)
    found = theory.spreading_cap(times, **cap)
    push = 2 * 0.7 * 9.81 * math.cos(math.radians(35.0)) * 0.05 * 0.25
    rate = np.gradient(found.half_length, times, edge_order=2)
    kept = 0.5 * rate**2 + push / found.half_length
    np.testing.assert_allclose(kept[1:-1], push / 0.25, rtol=1e-5)
    assert found.half_length[20] - 0.25 == pytest.approx(0.5 * push / 0.25**2 * 1e-4, rel=1e-3)
    pull = 9.81 * (math.sin(math.radians(35.0)) - 0.3 * math.cos(math.radians(35.0)))
    assert found.centre[-1] == pytest.approx(0.5 * pull, rel=1e-12)


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
