"""The steady Bagnold profile and the transient incline against independent results."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from granular.theory import bagnold_mean, bagnold_profile, transient

MATERIAL = SimpleNamespace(mu_s=0.3819, mu_2=0.6435, xi=1.1233, rho_c=1500.0)
HEIGHT, GRAVITY = 0.2, 9.81


def flow_rule(p, mu):
    """mu(I) solved for the shear rate, written independently."""
    return MATERIAL.xi * math.sqrt(p) * (mu - MATERIAL.mu_s) / (MATERIAL.mu_2 - mu)


@pytest.mark.parametrize("angle_deg", [21.5, 25.0, 30.0, 32.5])
def test_profile_is_the_integral_of_the_flow_rule(angle_deg):
    weight = MATERIAL.rho_c * GRAVITY * math.cos(math.radians(angle_deg))
    slope = math.tan(math.radians(angle_deg))
    heights = np.array([0.0, 0.05, 0.13, 0.2])

    def rate(y):
        return flow_rule(weight * (HEIGHT - y), slope)

    expected = [quad(rate, 0, y, epsrel=1e-12)[0] for y in heights]
    v = bagnold_profile(heights, angle_deg, HEIGHT, MATERIAL)
    np.testing.assert_allclose(v, expected, rtol=1e-9)


def test_mean_is_the_mean_of_the_profile():
    def profile(y):
        return bagnold_profile(y, 27.0, HEIGHT, MATERIAL)

    expected = quad(profile, 0, HEIGHT, epsrel=1e-11)[0] / HEIGHT
    assert bagnold_mean(27.0, HEIGHT, MATERIAL) == pytest.approx(expected, rel=1e-9)


def test_no_flow_below_the_yield_angle_and_creep_above():
    y = np.linspace(0, HEIGHT, 5)
    assert np.all(bagnold_profile(y, 20.9, HEIGHT, MATERIAL) == 0)
    assert bagnold_mean(0.0, HEIGHT, MATERIAL) == 0
    limit = math.degrees(math.atan(MATERIAL.mu_2))
    for angle_deg in (limit, 34.0):
        with pytest.raises(ValueError, match="mu_2"):
            bagnold_profile(y, angle_deg, HEIGHT, MATERIAL)
    with pytest.raises(ValueError, match="angle_deg = 90"):
        bagnold_mean(90.0, HEIGHT, MATERIAL)
    with pytest.raises(ValueError, match="height"):
        bagnold_profile([0.21], 25.0, HEIGHT, MATERIAL)
    # just above it the layer creeps to the steady state
    angle_deg = math.degrees(math.atan(MATERIAL.mu_s)) + 1e-3
    late = transient(angle_deg, HEIGHT, MATERIAL, [500.0]).mean[0]
    assert late == pytest.approx(bagnold_mean(angle_deg, HEIGHT, MATERIAL), rel=1e-4)


@pytest.mark.parametrize("angle_deg", [22.0, 25.0])
def test_transient_ends_in_the_bagnold_profile(angle_deg):
    late = transient(angle_deg, HEIGHT, MATERIAL, [400.0])
    steady = bagnold_profile(late.y, angle_deg, HEIGHT, MATERIAL)
    assert np.max(np.abs(late.v[0] - steady)) < 2e-4 * steady[-1]
    assert late.mean[0] == pytest.approx(bagnold_mean(angle_deg, HEIGHT, MATERIAL), rel=1e-5)
    balance = MATERIAL.rho_c * GRAVITY * math.sin(math.radians(angle_deg))
    np.testing.assert_allclose(late.shear_stress[0], balance * (HEIGHT - late.y_mid), rtol=1e-5)


def test_order_of_convergence_in_space_and_time():
    times = [0.5, 6.0]
    mean = [transient(25.0, HEIGHT, MATERIAL, times, cells=n).mean for n in (25, 50, 100)]
    change = np.abs(np.diff(mean, axis=0))
    order = np.log2(change[:-1] / change[1:])
    assert np.all((order > 1.85) & (order < 2.15)), order
    coarse, fine = (transient(25.0, HEIGHT, MATERIAL, times, rtol=r).mean for r in (1e-5, 1e-7))
    assert np.max(np.abs(coarse / fine - 1)) < 1e-5


def regularised(angle_deg, times, cells, sharpness):
    """The same layer in velocities, with friction mu_s gamma/(gamma + sharpness) at small rates."""
    angle, dy = math.radians(angle_deg), HEIGHT / cells
    depth = HEIGHT - dy * (np.arange(cells) + 0.5)

    def rate(t, v):
        g = GRAVITY * min(t / 0.1, 1.0)
        p = MATERIAL.rho_c * g * math.cos(angle) * depth + 1e-9
        gamma = np.diff(v, prepend=0.0) / dy
        creep = gamma / (np.abs(gamma) + sharpness)
        inertial = gamma / (np.abs(gamma) + MATERIAL.xi * np.sqrt(p))
        tau = p * (MATERIAL.mu_s * creep + (MATERIAL.mu_2 - MATERIAL.mu_s) * inertial)
        a = np.diff(tau, append=0.0) / (MATERIAL.rho_c * dy)
        a[-1] *= 2
        return a + g * math.sin(angle)

    v = solve_ivp(rate, (0, times[-1]), np.zeros(cells), "BDF", times, rtol=1e-7, atol=1e-10).y
    return (v.sum(axis=0) - v[-1] / 2) / cells


def test_transient_against_a_regularised_solution():
    """An ODE solution of the regularised law tends to the transient as the creep vanishes."""
    times = [0.3, 1.0]
    exact = transient(25.0, HEIGHT, MATERIAL, times, cells=40, rtol=1e-8).mean
    sharpness = (1e-4, 1e-5, 1e-6)
    error = [np.abs(regularised(25.0, times, 40, s) / exact - 1).max() for s in sharpness]
    assert error[1] < 0.3 * error[0]
    assert error[2] < 0.3 * error[1]
    assert error[2] < 3e-4


def test_transient_figures():
    """25 degrees: a prototype gave, at 9.8 m/s2, 0.26552, 1.62612, 2.0055 m/s (5 digits)."""
    mean = transient(25.0, HEIGHT, MATERIAL, [0.5, 6.0, 11.5], 9.8).mean
    np.testing.assert_allclose(mean, [0.26552, 1.62612, 2.0055], rtol=1.5e-4)
    # gravity at once flows faster
    ramped = transient(25.0, HEIGHT, MATERIAL, [0.5]).mean[0]
    sudden = transient(25.0, HEIGHT, MATERIAL, [0.5], ramp=0.0).mean[0]
    assert sudden / ramped == pytest.approx(1.096, abs=1e-3)


@pytest.mark.parametrize("angle_deg", [0.0, 19.0, 20.0, 20.9])
def test_exact_rest_below_the_yield_angle(angle_deg):
    rest = transient(angle_deg, HEIGHT, MATERIAL, [0.0, 0.05, 1.0, 20.0])
    assert np.all(rest.v == 0)
    # The stress is determined all the same: it carries the weight.
    full = MATERIAL.rho_c * GRAVITY * math.sin(math.radians(angle_deg)) * (HEIGHT - rest.y_mid)
    np.testing.assert_allclose(rest.shear_stress[2:], np.tile(full, (2, 1)), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(rest.shear_stress[1], full / 2, rtol=1e-9, atol=1e-9)
    assert np.all(rest.shear_stress[0] == 0)


def test_flow_rule_and_sign_of_the_plastic_work():
    flow = transient(28.0, HEIGHT, MATERIAL, [0.05, 0.2, 2.0])
    weight = MATERIAL.rho_c * GRAVITY * math.cos(math.radians(28.0))
    for k, share in enumerate((0.5, 1.0, 1.0)):
        p = share * weight * (HEIGHT - flow.y_mid)
        mu = flow.shear_stress[k] / p
        # Close to yield the difference mu - mu_s of the check itself has no digits.
        flowing = mu > MATERIAL.mu_s + 1e-4
        assert flowing.any()
        assert np.all(mu < MATERIAL.mu_2)
        assert np.all(flow.shear_rate[k][mu < MATERIAL.mu_s] == 0)
        expected = [flow_rule(*pair) for pair in zip(p[flowing], mu[flowing], strict=True)]
        np.testing.assert_allclose(flow.shear_rate[k][flowing], expected, rtol=1e-8)


@pytest.mark.parametrize("angle_deg", [25.0, 34.0])
def test_momentum_and_energy_balance(angle_deg):
    """Momentum gain = weight - base friction; work of gravity = kinetic energy + dissipation."""
    times = np.linspace(0.1, 0.6, 201)
    flow = transient(angle_deg, HEIGHT, MATERIAL, times, cells=100, rtol=1e-7)
    drive = MATERIAL.rho_c * GRAVITY * math.sin(math.radians(angle_deg))
    dy = HEIGHT / 100
    momentum = MATERIAL.rho_c * flow.mean * HEIGHT
    # The stress is linear near the base: its value there from the two lowest cells.
    base = 1.5 * flow.shear_stress[:, 0] - 0.5 * flow.shear_stress[:, 1]
    impulse = np.trapezoid(drive * HEIGHT - base, times)
    assert momentum[-1] - momentum[0] == pytest.approx(impulse, rel=2e-3)
    lumped = np.full(101, dy)
    lumped[[0, -1]] /= 2
    kinetic = 0.5 * MATERIAL.rho_c * (flow.v**2 @ lumped)
    dissipated = np.trapezoid((flow.shear_stress * flow.shear_rate).sum(axis=1) * dy, times)
    work = np.trapezoid(drive * flow.mean * HEIGHT, times)
    assert dissipated > 0
    assert work == pytest.approx(kinetic[-1] - kinetic[0] + dissipated, rel=1e-5)


def test_beyond_mu_2_it_accelerates_towards_its_limit():
    angle = math.radians(34.0)
    limit = GRAVITY * (math.sin(angle) - MATERIAL.mu_2 * math.cos(angle))
    times = np.array([1.0, 5.0, 20.0, 80.0, 81.0])
    mean = transient(34.0, HEIGHT, MATERIAL, times).mean
    acceleration = np.diff(mean) / np.diff(times)
    assert np.all(acceleration > limit)
    assert np.all(np.diff(acceleration) < 0)
