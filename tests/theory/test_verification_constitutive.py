"""The constitutive reference against closed forms, itself, and a plain stepping scheme."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from granular.theory import appendix_b_velocity_gradient, plastic_shear_rate, reference


def material(E=1e4, nu=0.3, mu_s=0.3819, mu_2=0.6435, xi=1.1233):
    K, G = E / (3 * (1 - 2 * nu)), E / (2 * (1 + nu))
    return SimpleNamespace(mu_s=mu_s, mu_2=mu_2, xi=xi, K=K, G=G)


SOFT = material()
STICKY = material(mu_s=50.0, mu_2=60.0)  # elastic in every test that uses it
TIMES = np.linspace(0, 1.25, 26)
DISCONNECTED = {"p0": 0.0, "log_density0": -500 / SOFT.K}


def invariants(stress):
    p = -stress[:, :3].mean(axis=1)
    s = stress[:, :3] + p[:, None]
    return p, np.sqrt((s**2).sum(axis=1) / 2 + stress[:, 3] ** 2)


def test_hydrostatic_compression_is_logarithmic():

    def squeeze(t):
        return -0.1 * (1 + t) * np.eye(2)

    result = reference(STICKY, 100.0, TIMES, velocity_gradient=squeeze, breakpoints=(0.0,))
    # Integral of -tr L: ln(rho/rho_0) = 0.2 (t + t^2/2).
    log_density = 100 / STICKY.K + 0.2 * (TIMES + TIMES**2 / 2)
    np.testing.assert_allclose(result.log_density, log_density, rtol=1e-12)
    p, _ = invariants(result.stress)
    np.testing.assert_allclose(p, STICKY.K * log_density, rtol=1e-10)
    # Plane strain: Hooke's law out of plane, from the same logarithmic strain.
    lame = STICKY.K - 2 / 3 * STICKY.G
    strain = log_density - log_density[0]
    np.testing.assert_allclose(result.stress[:, 2], -100 - lame * strain, rtol=1e-9)


def test_elastic_simple_shear_has_the_jaumann_solution():

    def shear(t):
        return np.array([[0.0, 2.0], [0.0, 0.0]])

    result = reference(STICKY, 4000.0, TIMES, velocity_gradient=shear, breakpoints=(0.0,))
    angle = 2.0 * TIMES
    assert np.all(result.shear_rate == 0)
    tolerance = 1e-7 * STICKY.G
    for column, value in ((3, np.sin(angle)), (0, 1 - np.cos(angle)), (1, np.cos(angle) - 1)):
        isotropic = 0.0 if column == 3 else -4000.0
        expected = isotropic + STICKY.G * value
        np.testing.assert_allclose(result.stress[:, column], expected, atol=tolerance)


def test_rotation_turns_the_stress():
    """Stretch, then ten rigid turns: the stress is rotated, its invariants are unchanged."""
    turn = 20 * math.pi

    def gradient(t):
        return np.diag([-0.02, 0.02]) if t < 1 else np.array([[0.0, -turn], [turn, 0.0]])

    result = reference(
        SOFT, 500.0, [1.0, 1.0 + 1 / 80, 2.0], velocity_gradient=gradient, breakpoints=(0.0, 1.0)
    )
    start, eighth, end = result.stress
    np.testing.assert_allclose(end, start, atol=1e-5)
    # After 1/8 turn the deviator diag(-s, s) is pure shear: R diag(-s, s) R^T has xy = -s.
    difference = (start[1] - start[0]) / 2
    assert difference == pytest.approx(2 * SOFT.G * 0.02, rel=1e-8)
    np.testing.assert_allclose(eighth, [-500, -500, -500, -difference], atol=1e-5)


def test_pressure_is_that_of_the_density_while_dense():
    for start in ({"p0": 500.0}, {"p0": 100.0}, DISCONNECTED):
        result = reference(SOFT, times=TIMES, **start)
        p, tau = invariants(result.stress)
        expected = SOFT.K * np.maximum(result.log_density, 0)
        np.testing.assert_allclose(p, expected, atol=1e-6)
        assert np.all(tau <= SOFT.mu_2 * p)
        assert np.all(result.stress[~result.dense] == 0)


@pytest.mark.parametrize("stiffness", [1e5, 1e7])
def test_steady_shear_stress_is_mu_of_i(stiffness):
    """After large strain: exactly the flow rule, and mu(I) p of the imposed rate up to tau/G."""
    grains, rate, p0 = material(E=stiffness), 3.0, 200.0

    def shear(t):
        return np.array([[0.0, rate], [0.0, 0.0]])

    result = reference(grains, p0, [3.0], velocity_gradient=shear, breakpoints=(0.0,))
    p, tau = (value[0] for value in invariants(result.stress))
    assert p == pytest.approx(p0, rel=1e-9)

    def friction(gamma):
        inertial = gamma / (gamma + grains.xi * math.sqrt(p0))
        return grains.mu_s + (grains.mu_2 - grains.mu_s) * inertial

    assert tau == pytest.approx(friction(result.shear_rate[0]) * p0, rel=1e-7)
    assert result.stress[0, 3] == pytest.approx(friction(rate) * p0, rel=(tau / grains.G) ** 2)
    # Normal stress difference of the Jaumann rate, from D:s = rate s_xy = gp tau when steady.
    ratio = rate / result.shear_rate[0]
    normal = ratio * result.stress[0, 3] * tau / grains.G
    assert result.stress[0, 0] + p == pytest.approx(normal, rel=1e-5)


def test_self_convergence_with_the_tolerance():
    """Of the explicit integrator, towards an implicit one."""
    exact = reference(SOFT, 100.0, TIMES, rtol=1e-11, solver="Radau").stress
    tried = [reference(SOFT, 100.0, TIMES, rtol=r).stress for r in (1e-5, 1e-7, 1e-9)]
    error = [np.abs(stress - exact).max() / np.abs(exact).max() for stress in tried]
    assert error[2] < 1e-8
    assert error[2] < error[1] < error[0]


def test_explicit_and_implicit_integrators_agree_after_a_disconnected_start():
    explicit = reference(SOFT, times=TIMES, solver="RK45", rtol=1e-7, **DISCONNECTED)
    implicit = reference(SOFT, times=TIMES, solver="Radau", rtol=1e-7, **DISCONNECTED)
    largest = np.abs(explicit.stress).max()
    assert np.abs(explicit.stress - implicit.stress).max() < 1e-6 * largest


def test_events_of_the_disconnected_case():
    """ln(rho/rho_c) rises by 8 (t - 1/4)^2 at first and ends 8 (1 - t)^2 above its start."""
    result = reference(SOFT, times=TIMES, **DISCONNECTED)
    wait = math.sqrt(500 / SOFT.K / 8)
    assert [event.kind for event in result.events] == ["reconnect", "disconnect"]
    assert result.events[0].time == pytest.approx(0.25 + wait, abs=1e-12)
    assert result.events[1].time == pytest.approx(1 - wait, abs=1e-12)
    assert 0.25 + wait == pytest.approx(0.336603, abs=1e-6)
    between = (TIMES > 0.25 + wait) & (TIMES < 1 - wait)
    np.testing.assert_array_equal(result.dense, between)


def test_contact_under_pure_shear_starts_on_the_yield_surface():
    """Contact that elastically would exceed mu_2 is admissible from the first instant."""

    def gradient(t):
        return np.array([[-0.01, 1.0], [0.0, -0.01]])

    times = [0.501, 0.51, 0.6, 1.0]
    result = reference(
        SOFT, 0.0, times, log_density0=-0.01, velocity_gradient=gradient, breakpoints=(0.0,)
    )
    assert result.events[0].time == pytest.approx(0.5, rel=1e-12)
    p, tau = invariants(result.stress)
    np.testing.assert_allclose(p, SOFT.K * 0.02 * (np.array(times) - 0.5), rtol=1e-7)
    assert np.all((tau > SOFT.mu_s * p) & (tau < SOFT.mu_2 * p))


def stepping(steps, p0, midstep):
    """The stress update (3.10)-(3.16) of the paper with a fixed step, written for this test."""
    dt, m = 1.25 / steps, SOFT
    stress = np.diag([-p0] * 3).astype(float)
    out = [stress]
    for n in range(steps):
        L = np.zeros((3, 3))
        L[:2, :2] = appendix_b_velocity_gradient((n + (0.5 if midstep else 1.0)) * dt)
        D, W = (L + L.T) / 2, (L - L.T) / 2
        rate = 2 * m.G * D + (m.K - 2 / 3 * m.G) * np.trace(D) * np.eye(3)
        trial = stress + dt * (rate + W @ stress - stress @ W)
        p = -np.trace(trial) / 3
        s = trial + p * np.eye(3)
        tau = math.sqrt((s * s).sum() / 2)
        alpha = m.xi * m.G * dt * math.sqrt(p)
        if tau > m.mu_s * p:
            # p (mu_2 - mu)(tau_tr - tau) = alpha p (mu - mu_s), a quadratic in tau.
            b = m.mu_2 * p + tau + alpha
            h = m.mu_2 * p * tau + m.mu_s * p * alpha
            s = s * (min(np.roots([1.0, -b, h]).real) / tau)
        stress = s - p * np.eye(3)
        out.append(stress)
    out = np.array(out)
    return np.stack([out[:, 0, 0], out[:, 1, 1], out[:, 2, 2], out[:, 0, 1]], axis=1)


def test_a_first_order_scheme_converges_to_the_reference():
    error = []
    for steps in (1250, 2500, 5000):
        exact = reference(SOFT, 500.0, np.linspace(0, 1.25, steps + 1)).stress
        error.append(np.abs(stepping(steps, 500.0, False) - exact).max() / np.abs(exact).max())
    np.testing.assert_allclose(error, [3.31e-3, 1.66e-3, 8.27e-4], rtol=5e-3)
    exact = reference(SOFT, 500.0, np.linspace(0, 1.25, 1251)).stress
    mid = np.abs(stepping(1250, 500.0, True) - exact).max() / np.abs(exact).max()
    assert mid < error[0] / 100


def test_flow_rule_inverts_mu_of_i_and_velocity_gradient_of_appendix_b():
    rate, p = np.array([1e-6, 1.0, 1e3]), 300.0
    grown = SOFT.mu_s + (SOFT.mu_2 - SOFT.mu_s) / (SOFT.xi * math.sqrt(p) / rate + 1)
    np.testing.assert_allclose(plastic_shear_rate(p, grown * p, SOFT), rate, rtol=1e-8)
    assert np.all(plastic_shear_rate([p, 0.0, -1.0], [0.3 * p, 1.0, 1.0], SOFT) == 0)
    at = appendix_b_velocity_gradient(np.array([0.1, 0.375, 0.6, 0.8125, 1.1]))
    assert at.shape == (5, 2, 2)
    np.testing.assert_array_equal(at[:, 0, 0], [0, -1, 0, 0.5, 0])
    np.testing.assert_array_equal(at[:, 1, 1], at[:, 0, 0])
    assert np.all(at[:, 0, 1] == 0.05)
    assert np.all(at[:, 1, 0] == 0)
