"""Shallow layers on a Coulomb base: the partial differential equations, and published cases."""

import math

import numpy as np
import pytest

from granular import theory

AT_35 = {"angle_deg": 35.0, "mu": math.tan(math.radians(25.0)), "half_length": 80.0}
DAM = {"angle_deg": 22.0, "mu": math.tan(math.radians(21.0)), "thickness": 1.0}


def test_dam_break_satisfies_the_equations_of_a_shallow_layer():
    """h_t + (h u)_x = 0 and u_t + u u_x + K g cos h_x = m, by central differences."""
    given, t, step = DAM | {"K": 0.8}, 2.0, 1e-4
    across = 9.81 * math.cos(math.radians(22.0))
    pull = across * (math.tan(math.radians(22.0)) - DAM["mu"])
    x = np.linspace(-4.0, 8.0, 25)
    here = theory.dam_break(x, t, **given)
    before, after = (theory.dam_break(x, t + s, **given) for s in (-step, step))
    left, right = (theory.dam_break(x + s, t, **given) for s in (-step, step))
    flux = right.thickness * right.velocity - left.thickness * left.velocity
    np.testing.assert_allclose(after.thickness - before.thickness + flux, 0.0, atol=1e-8)
    inertia = after.velocity - before.velocity + here.velocity * (right.velocity - left.velocity)
    push = 0.8 * across * (right.thickness - left.thickness)
    np.testing.assert_allclose((inertia + push) / (2 * step), pull, rtol=1e-6)
    # Nothing is lost: what is missing behind the dam is before it.
    x = np.linspace(here.back, here.front, 20001)
    behind = np.trapezoid(theory.dam_break(x, t, **given).thickness, x)
    assert behind == pytest.approx(pull * t**2 / 2 - here.back, rel=1e-8)
    assert np.isnan(theory.dam_break([20.0], t, **given).velocity).all()


@pytest.mark.parametrize(
    ("t", "length", "width", "thickness", "speed"),
    [
        (2.0, 81.5948, 80.5316, 3.89593, 3.75918),
        (10.0, 114.469, 90.9551, 2.45881, 18.7959),
        (20.0, 186.798, 110.616, 1.23894, 37.5918),
    ],
)
def test_ellipse_against_another_integration(t, length, width, thickness, speed):
    """The similarity solution of AvaFrame's test, which others integrated with rtol 1e-10."""
    found = theory.spreading_ellipse([0.0, t], thickness=4.0, **AT_35)
    assert found.half_length == pytest.approx([80.0, length], rel=1e-5)
    assert found.half_width == pytest.approx([80.0, width], rel=1e-5)
    assert found.thickness == pytest.approx([4.0, thickness], rel=1e-5)
    assert found.velocity[1] == pytest.approx(speed, rel=1e-5)
    assert found.centre[1] == pytest.approx(speed * t / 2, rel=1e-5)


def test_frictionless_ellipse_stays_a_circle_and_keeps_its_energy():
    """G = f without friction, G'' = 2 B/G^3, whose solution is G = sqrt(1 + 2 B t^2)."""
    given = AT_35 | {"mu": 0.0}
    times = np.array([1.0, 5.0, 30.0])
    found = theory.spreading_ellipse(times, thickness=4.0, K=0.7, **given)
    push = 2 * 0.7 * 4.0 / 80.0 * math.cos(math.radians(35.0)) * 9.81 / 80.0
    np.testing.assert_allclose(found.half_width, found.half_length, rtol=1e-7)
    np.testing.assert_allclose(found.half_length, 80 * np.sqrt(1 + push * times**2), rtol=1e-7)


def test_cap_keeps_its_energy_of_spreading_and_has_a_closed_form():
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
    # t = (sqrt(G (G - 1)) + ln(sqrt(G) + sqrt(G - 1)))/(2 sqrt(B))
    G = np.array([1.01996, 1.43946, 2.39736])
    B = 4.0 / 80.0 * math.cos(math.radians(35.0))
    times = np.sqrt(G * (G - 1)) + np.log(np.sqrt(G) + np.sqrt(G - 1))
    times *= math.sqrt(80.0 / 9.81) / (2 * math.sqrt(B))
    found = theory.spreading_cap(times, thickness=4.0, **AT_35)
    np.testing.assert_allclose(found.half_length, 80.0 * G, rtol=1e-7)
