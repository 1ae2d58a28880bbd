"""The finite-strain law in motion: shear, rotation, dissipation, start-up against scipy."""

import math

import numpy as np
import oracle_hencky as oracle
import pytest

from granular import _core

SAND = oracle.SAND
SHEAR = np.zeros((3, 3))
SHEAR[0, 1] = 1.0


# ---- shear at constant volume ----


def sheared(flow, q, rates, dt, gamma=5.0, p0=800.0, held=None):
    """Simple shear of one point for each rate until the slowest has reached gamma: stress, g.

    `held` is a fluidity for each point that diffusion would keep constant.
    """
    n = len(rates)
    step = oracle.gradients(np.asarray(rates)[:, None, None] * SHEAR * dt, 3)
    rows = oracle.components(np.tile(-p0 * np.eye(3), (n, 1, 1)), 3)
    c, g, rate = np.full(n, p0 / q["K"]), np.ones(n), np.zeros(n)
    for _ in range(math.ceil(gamma / (min(rates) * dt))):
        if held is not None:
            g[:] = held
        _core.hencky_update(flow, q, dt, step, c, rows, g, rate, "")
    return oracle.matrices(rows), g, rate


@pytest.mark.parametrize("flow", oracle.FLOWS[1:])
def test_shear_keeps_the_pressure_and_comes_to_the_friction_of_its_rate(flow):
    """Gamma = 5 at p0 = 800 Pa, where the published form loses all of the pressure."""
    rates, q = np.array([0.3, 1.0, 5.0]), SAND | {"t0": 1e-3}
    stress, g, rate = sheared(flow, q, rates, 1e-3)
    p = -np.trace(stress, axis1=1, axis2=2) / 3
    np.testing.assert_allclose(p, 800.0, rtol=1e-14)
    inertial = rates * q["d"] * np.sqrt(q["rho_s"] / 800.0)
    dmu = q["mu_2"] - q["mu_s"]
    expected = q["mu_s"] + {
        "drucker_prager": 0.0,
        "linear_mu_I": dmu * inertial / q["I0"],
        "linear_ngf": dmu * inertial / q["I0"],
        "mu_I": dmu * inertial / (inertial + q["I0"]),
        "ngf": dmu * inertial / (inertial + q["I0"]),
    }[flow] * np.ones(3)
    # the shear stress on the planes of shear; its axes are inclined by the elastic strain
    np.testing.assert_allclose(oracle.shear(stress) / p, expected, rtol=1e-4)
    np.testing.assert_allclose(stress[:, 0, 1] / p, expected, rtol=1e-4)
    np.testing.assert_allclose(rate, rates, rtol=1e-4)
    np.testing.assert_allclose(g, rates / expected, rtol=2e-4)


@pytest.mark.parametrize("flow", ["linear_ngf", "ngf"])
def test_with_the_fluidity_held_friction_is_shear_rate_over_fluidity(flow):
    """Below mu_s, the fluidity of neighbours makes a point flow that would not flow by itself.

    The steady g is then known from the equation of one step, as is mu = gdot/g.
    """
    rates, q, dt, held = np.array([0.3, 1.0, 5.0]), SAND | {"t0": 1e-3}, 1e-3, np.array([2, 8, 40])
    stress, g, rate = sheared(flow, q, rates, dt, gamma=2.0, held=held)
    mu = oracle.shear(stress) / 800.0
    np.testing.assert_allclose(mu * g, rates, rtol=1e-4)
    np.testing.assert_allclose(rate, rates, rtol=1e-4)
    assert (mu < q["mu_s"]).all()
    dmu, grain = q["mu_2"] - q["mu_s"], q["d"] * np.sqrt(q["rho_s"] / 800.0)
    drive = (q["mu_s"] - mu) * (1.0 if flow.startswith("linear") else dmu / (q["mu_2"] - mu))
    after = held / (1 + dt / q["t0"] * (drive + dmu / q["I0"] * grain * rates))
    np.testing.assert_allclose(g, after, rtol=1e-4)


# ---- rotation ----


def test_ten_turns_leave_the_invariants_and_come_back():
    """A rigid rotation is exact for any step, as the exponential of a constant L is."""
    start = np.array([[-900.0, 120.0, 40.0], [120.0, -700.0, -60.0], [40.0, -60.0, -800.0]])
    axis = np.array([1.0, 2.0, -2.0]) / 3
    spin = np.cross(np.eye(3), axis)
    for steps in (60, 6283):
        stress = start[None]
        for _ in range(steps):
            turn = spin[None] * (20 * math.pi / steps)
            stress, _, _ = oracle.update("elastic", SAND, 1e-3, turn, 8e-4, stress, 0.0, 0.0)
        for k in (1, 2, 3):
            np.testing.assert_allclose(
                np.trace(np.linalg.matrix_power(stress[0], k)),
                np.trace(np.linalg.matrix_power(start, k)),
                rtol=1e-10,
            )
        np.testing.assert_allclose(stress[0], start, rtol=1e-9)


def test_orientation_converges_with_the_square_of_the_step_where_the_spin_changes():
    """Rotation about an axis that itself rotates, with L taken in the middle of each step."""

    def spin(t):
        return np.cross(np.eye(3), [math.cos(2 * t), math.sin(2 * t), 0.5])

    start = np.diag([-900.0, -700.0, -800.0])[None]
    found = []
    for steps in (50, 100, 200, 3200):
        stress, dt = start, 3.0 / steps
        for k in range(steps):
            turn = spin((k + 0.5) * dt)[None] * dt
            stress, _, _ = oracle.update("elastic", SAND, dt, turn, 8e-4, stress, 0.0, 0.0)
        found.append(stress[0])
    errors = [np.abs(a - found[-1]).max() for a in found[:-1]]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.05)
    assert errors[-1] < 0.1


# ---- energy ----


def energy(strain, c, q):
    return q["G"] * (strain * strain).sum(axis=(1, 2)) + q["K"] * c**2 / 2


def strained(rng, n, low, high):
    """Strain, L dt and c before and after a step, of points that stay dense."""
    c0 = 10 ** rng.uniform(low, high, n)
    h = oracle.deviator(rng.normal(size=(n, 3, 3)))
    h = h + np.swapaxes(h, 1, 2)
    h *= (c0 * rng.uniform(0, 1.5, n) / np.sqrt((h * h).sum(axis=(1, 2))))[:, None, None]
    step = rng.normal(size=(n, 3, 3)) * (c0 * 10 ** rng.uniform(-3, 1, n))[:, None, None]
    trace = np.trace(step, axis1=1, axis2=2)
    step[:, range(3), range(3)] += ((np.minimum(trace, 0.5 * c0) - trace) / 3)[:, None]
    return h, step, c0, c0 - np.trace(step, axis1=1, axis2=2)


def test_elastic_work_is_stored():
    """stress : D dt along b = exp(L t) b exp(L t)^T, by scipy and Gauss's rule."""
    q = SAND
    h, step, c0, c = strained(np.random.default_rng(13), 400, -2.5, -1.3)
    stress = 2 * q["G"] * h - (q["K"] * c0)[:, None, None] * np.eye(3)
    found, _, _ = oracle.update("elastic", q, 1e-4, step, c, stress, 0.0, 0.0)
    node, weight = np.polynomial.legendre.leggauss(10)
    work = np.zeros(len(c))
    for x, w in zip((node + 1) / 2, weight / 2, strict=True):
        trace = np.trace(step, axis1=1, axis2=2)
        s = 2 * q["G"] * oracle.trial_strain(h, x * step)
        work += w * ((s * step).sum(axis=(1, 2)) - q["K"] * (c0 - x * trace) * trace)
    gained = energy(oracle.deviator(found) / (2 * q["G"]), c, q) - energy(h, c0, q)
    np.testing.assert_allclose(work, gained, atol=1e-11 * np.abs(gained).max(), rtol=1e-9)


@pytest.mark.parametrize("flow", oracle.FLOWS[1:])
def test_dissipation_is_not_negative_in_a_hundred_thousand_states(flow):
    """The dissipation is the excess energy of the elastic step, and stress times plastic strain."""
    rng, n, dt, q = np.random.default_rng(12), 100_000, 1e-4, SAND
    h, step, c0, c = strained(rng, n, -5, -2)
    stress = 2 * q["G"] * h - (q["K"] * c0)[:, None, None] * np.eye(3)
    fluidity, slip = 10 ** rng.uniform(-3, 3, (2, n))
    found, _, rate = oracle.update(flow, q, dt, step, c, stress, fluidity, slip)
    trial, _, _ = oracle.update("elastic", q, dt, step, c, stress, 0.0, 0.0)
    stored = [energy(oracle.deviator(s) / (2 * q["G"]), c, q) for s in (trial, found)]
    lost = stored[0] - stored[1]
    assert (lost >= 0).all()
    assert (lost > 1e-6 * stored[0]).mean() > 0.1  # some of the states flow
    mean = (oracle.shear(trial) + oracle.shear(found)) / 2
    np.testing.assert_allclose(lost, mean * rate * dt, atol=1e-13 * stored[0].max(), rtol=1e-6)


# ---- against the continuous law ----


def path(t):
    """Smooth path of start-up, stop and reversed shear, with compression in between."""
    L = 2.0 * math.sin(2 * math.pi * t / 0.5) * SHEAR
    return L - 0.02 * math.sin(math.pi * t / 0.5) * np.diag([1.0, 0.5, 0.2])


@pytest.mark.parametrize("flow", oracle.FLOWS[2:])
def test_start_up_and_return_converge_to_the_continuous_law(flow):
    """First order, as flow is implicit; extrapolated, the steps converge to scipy's Radau."""
    q = SAND | {"t0": 0.02}
    times = np.linspace(0.0, 0.5, 10)
    expected, g_expected = oracle.continuous(flow, q, path, times, p0=2000.0, g0=2.0, rtol=1e-8)
    errors, fluidities = [], []
    for substeps in (40, 80, 160):
        found, g, _ = oracle.stepped(flow, q, path, times, p0=2000.0, g0=2.0, substeps=substeps)
        errors.append((found - expected) / 2000.0)
        fluidities.append(g)
    sizes = [np.sqrt((e**2).sum(axis=(1, 2)).mean()) for e in errors]
    orders = np.log2(np.array(sizes[:-1]) / sizes[1:])
    np.testing.assert_allclose(orders, 1.0, atol=0.1)
    extrapolated = 2 * errors[-1] - errors[-2]
    # the median over times: near the reversal yield occurs within a step, not at its end
    assert np.median(np.abs(extrapolated).max(axis=(1, 2))) < 0.02 * sizes[-1]
    if flow.endswith("ngf"):
        g = 2 * fluidities[-1] - fluidities[-2]
        np.testing.assert_allclose(g, g_expected, rtol=0.01)


def test_elastic_path_converges_with_the_square_of_the_step():
    """Elastic path (a fluidity of zero) through strains of a tenth."""
    times = np.linspace(0.0, 0.5, 11)

    def gradient(t):
        return path(t) * 0.2 + 0.3 * math.cos(9 * t) * np.diag([1.0, -1.0, 0.0])

    expected, _ = oracle.continuous("linear_ngf", SAND | {"I0": 1e9, "mu_s": 0.0, "t0": 1e9},
                                    gradient, times, p0=5e4, g0=1e-12)  # fmt: skip
    errors = []
    for substeps in (5, 10, 20):
        found, _, _ = oracle.stepped("elastic", SAND, gradient, times, p0=5e4, substeps=substeps)
        errors.append(np.abs(found - expected).max() / 5e4)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.1)


def test_disconnection_and_reconnection_forget_the_shear_stress():
    """Expansion past c = 0 and back: stress-free between, pressure K c again, friction regained."""
    q, dt = SAND, 1e-4
    c, stress, g, rate = 1e-3, -1000.0 * np.eye(3)[None], 1.0, 0.0
    L = 5.0 * SHEAR
    pressures, frictions = [], []
    for k in range(3000):
        opening = 5.0 if k < 1000 else (-5.0 if k < 2000 else 0.0)
        step = (L + opening / 3 * np.eye(3))[None] * dt
        c -= opening * dt
        stress, g, rate = oracle.update("ngf", q, dt, step, c, stress, g, rate)
        pressures.append(-np.trace(stress[0]) / 3)
        frictions.append(oracle.shear(stress)[0] / max(pressures[-1], 1e-300))
    pressures, frictions = np.array(pressures), np.array(frictions)
    loose = pressures == 0
    assert loose[2:1997].all()
    assert not loose[2001:].any()
    assert not (frictions[loose] > 0).any()
    assert frictions.max() < q["mu_2"]
    np.testing.assert_allclose(pressures[2000:], 1000.0, rtol=1e-9)
    inertial = 5.0 * q["d"] * math.sqrt(q["rho_s"] / 1000.0)
    steady = q["mu_s"] + (q["mu_2"] - q["mu_s"]) * inertial / (inertial + q["I0"])
    assert frictions[-1] == pytest.approx(steady, rel=1e-4)
