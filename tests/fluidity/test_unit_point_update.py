"""Point update of the nonlocal law: against 60 digits, bounds, limits, bad input."""

import math

import numpy as np
import oracle_fluidity as oracle
import pytest

from granular import _core

BEADS = {
    "G": 1e6 / 2.9, "mu_s": 0.3819, "mu_2": 0.6435, "I0": 0.279, "rho_s": 2450.0, "d": 0.005,
    "t0": 1e-3, "p_averaging": 0.0,
}  # fmt: skip
ISAS = oracle.available()
EPS = 2.0**-53


def update(q, dt, m, p, g_star, rate, isa=""):
    """Apply `_core.fluidity_update`; return mu and g."""
    given = [
        np.ascontiguousarray(np.broadcast_to(a, np.shape(m)), float) for a in (m, p, g_star, rate)
    ]
    mu, g = np.full(np.shape(m), math.nan), np.full(np.shape(m), math.nan)
    _core.fluidity_update(q, dt, *given, mu, g, isa)
    return mu, g


def logarithmic(rng, low, high, n):
    return 10 ** rng.uniform(math.log10(low), math.log10(high), n)


def states(rng, q, dt, n):
    """m, p, g_star and rate over their ranges, a third of m close to critical values."""
    p = logarithmic(rng, 1e-3, 1e5, n)
    f = dt / q["t0"] * (q["mu_2"] - q["mu_s"])
    special = np.array([q["mu_s"], q["mu_2"], (q["mu_2"] + f * q["mu_s"]) / (1 + f)])
    near = rng.choice(special, n) * (1 + rng.choice([-1, 1], n) * logarithmic(rng, 1e-9, 1e-1, n))
    kind = rng.integers(3, size=n)
    m = np.choose(kind, [rng.uniform(0, 60, n), logarithmic(rng, 1e-3, 60, n), near])
    g_star = np.where(rng.random(n) < 0.05, 0.0, logarithmic(rng, 1e-12, 1e3, n))
    rate = np.where(rng.random(n) < 0.1, 0.0, logarithmic(rng, 1e-9, 1e3, n))
    return np.minimum(m, 60.0), p, g_star, rate


def worst_errors(n_of_each, seed):
    """Largest relative errors of mu and X on any instruction set, and the number of states.

    X grows from zero at the critical friction. Close to it rounding of m alone may change X by more
    than 1e-12; there the error of X is given in units of that change.
    """
    rng = np.random.default_rng(seed)
    worst, count, residual, unclear = np.zeros(2), 0, 0.0, 0
    for mu_2 in (0.6435, 1.5, 50.0):
        for dt in logarithmic(rng, 1e-7, 1e-4, 8):
            q = BEADS | {"mu_2": mu_2, "G": 10 ** rng.uniform(5.5, 7)}
            given = states(rng, q, dt, n_of_each)
            exact = [oracle.point(q, dt, *state) for state in zip(*given, strict=True)]
            first = tuple(a[0] for a in given)
            residual = max(residual, oracle.residual(q, dt, *first, *exact[0][:2]))
            rounding = 8 * EPS / 1e-12 * np.array([float(e[2]) for e in exact])
            unclear += (rounding > 1).sum()
            for isa in ISAS:
                mu, g = update(q, dt, *given, isa)
                assert ((mu < mu_2) & (mu >= 0) & (g >= 0)).all()
                X = q["G"] * dt * g / given[1]
                for found, column in ((mu, 0), (X, 1)):
                    expected = np.array([float(e[column]) for e in exact])
                    error = abs(found - expected) / np.where(expected > 0, expected, 1.0)
                    error /= np.maximum(1.0, rounding * column)
                    worst[column] = max(worst[column], error.max())
            count += n_of_each
    assert unclear < 0.02 * count
    # the reference solves the fluidity equation, not only its quadratic form
    assert residual < 1e-40
    return worst, count


@pytest.mark.parametrize("states", [10_000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_update_against_sixty_digits(states):
    (mu, X), count = worst_errors(states * 42 // 1000, seed=1)
    assert count >= states
    assert mu <= 1e-14
    assert X <= 1e-12


@pytest.mark.parametrize("isa", ISAS)
def test_any_number_of_points_gives_the_same(isa):
    rng = np.random.default_rng(3)
    given = states(rng, BEADS, 1e-5, 37)
    whole = update(BEADS, 1e-5, *given, isa)
    for n in range(20):
        part = update(BEADS, 1e-5, *(a[:n].copy() for a in given), isa)
        assert all((a == b[:n]).all() for a, b in zip(part, whole, strict=True))


@pytest.mark.parametrize("isa", ISAS)
def test_without_fluidity_friction_is_bounded_by_what_the_step_lets_pass(isa):
    """For g* = 0 without shear, mu = min(m, mu_c) with mu_c = (mu_2 + f mu_s)/(1 + f)."""
    dt = 1e-4
    f = dt / BEADS["t0"] * (BEADS["mu_2"] - BEADS["mu_s"])
    critical = (BEADS["mu_2"] + f * BEADS["mu_s"]) / (1 + f)
    m = np.linspace(0, 5, 1001)
    mu, g = update(BEADS, dt, m, 100.0, 0.0, 0.0, isa)
    np.testing.assert_allclose(mu, np.minimum(m, critical), rtol=1e-14)
    assert not g[m < critical].any()
    assert (g[m > critical] > 0).all()


@pytest.mark.parametrize("isa", ISAS)
def test_extreme_states_stay_finite_and_below_the_bound(isa):
    extremes = (0.0, 1e-60, 1e-30, 1.0, 1e30, 1e60)
    m, p, g_star, rate = (
        a.ravel().copy() for a in np.meshgrid(extremes, extremes[1:], (-1e60, *extremes), extremes)
    )
    for dt in (1e-12, 1e-4, 1e3):
        mu, g = update(BEADS, dt, m, p, g_star, rate, isa)
        assert ((mu < BEADS["mu_2"]) & (mu >= 0) & np.isfinite(g) & (g >= 0)).all()


def test_steady_flow_is_the_local_rheology():
    """Repeated steps at a fixed shear rate without diffusion end in mu = mu_s + dmu I/(I + I0)."""
    p, rate, dt = 1000.0, 5.0, 1e-4
    mu = g = np.array([0.4])
    for _ in range(4000):
        last = mu * g
        mu, g = update(BEADS, dt, mu + BEADS["G"] * dt * rate / p, p, g, last)
    inertial = rate * BEADS["d"] * math.sqrt(BEADS["rho_s"] / p)
    dmu = BEADS["mu_2"] - BEADS["mu_s"]
    expected = BEADS["mu_s"] + dmu * inertial / (inertial + BEADS["I0"])
    assert mu[0] == pytest.approx(expected, rel=1e-9)
    assert (mu * g)[0] == pytest.approx(rate, rel=1e-9)


def test_the_sink_takes_the_mean_of_the_root_over_the_depth_that_a_point_stands_for():
    p, g_star, rate, m = 8.0, 3.0, 1.0, np.array([0.5])
    for spread in (0.5, 8.0, 20.0):
        low = max(p - spread, 0.0)
        mean = 2.0 / (math.sqrt(p + spread) + math.sqrt(low))  # integral of p^-1/2 over 2 spread
        if spread <= p:
            x = np.linspace(0.0, 1.0, 100_001)[1:] - 0.5e-5
            assert mean == pytest.approx(np.mean((low + 2 * spread * x) ** -0.5), rel=2e-3)
        found = update(BEADS | {"p_averaging": spread}, 1e-5, m, p, g_star, rate)
        expected = update(BEADS, 1e-5, m, p, g_star, rate * mean * math.sqrt(p))
        np.testing.assert_allclose(found, expected, rtol=1e-14)


# ---- bad input ----


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"G": 0.0}, "G = 0 must be positive"),
        ({"t0": -1.0}, "t0 = -1 must be positive"),
        ({"d": 0.0}, "d = 0 must be positive"),
        ({"I0": math.nan}, "I0 = nan must be positive and finite"),
        ({"rho_s": math.inf}, "rho_s = inf must be positive and finite"),
        ({"mu_s": -0.1}, "mu_s = -0.1 must be zero or positive"),
        ({"mu_2": 0.3}, "mu_2 = 0.3 must exceed mu_s = 0.3819"),
        ({"p_averaging": -1.0}, "p_averaging = -1 must be zero or positive"),
    ],
)
def test_parameters_are_checked(change, text):
    with pytest.raises(ValueError, match=text):
        update(BEADS | change, 1e-5, np.array([0.5]), 1.0, 1.0, 0.0)
    for dt in (0.0, -1e-5, math.nan, math.inf):
        with pytest.raises(ValueError, match=r"dt = .* must be positive and finite"):
            update(BEADS, dt, np.array([0.5]), 1.0, 1.0, 0.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e61, -1.0])
@pytest.mark.parametrize("name", ["mu_trial", "p", "g_star", "shear_rate"])
def test_values_are_checked(name, bad):
    given = dict.fromkeys(("mu_trial", "p", "g_star", "shear_rate"), 1.0)
    arrays = [np.full(3, bad if key == name else value) for key, value in given.items()]
    arrays[list(given).index(name)][:2] = 1.0
    if name == "g_star" and bad == -1.0:
        update(BEADS, 1e-5, *arrays)  # negative values are taken for zero
        return
    with pytest.raises(ValueError, match=rf"{name}\[2\] = .* is outside the range"):
        update(BEADS, 1e-5, *arrays)
