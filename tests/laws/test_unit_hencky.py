"""Finite-strain laws: one step against matrix functions, flow rules, points of the engine."""

import math

import mpmath
import numpy as np
import oracle_hencky as oracle
import pytest
from oracle_fluidity import available
from oracle_hencky import FLOW_OF

from granular import _core

ISAS = available()
SAND = oracle.SAND


def norm(a):
    return np.sqrt((a * a).sum(axis=(-2, -1)))


def random_states(rng, n, dim, strain, step):
    """Deviatoric strains h and increments L dt with norms up to the given ones.

    The norm of L dt is that of its deviator. A tenth of the strains has two eigenvalues that are
    (nearly) equal.
    """
    L, h = rng.normal(size=(2, n, 3, 3))
    h = h + np.swapaxes(h, 1, 2)
    axis = rng.normal(size=(n // 10, 3))
    h[: n // 10] = axis[:, :, None] * axis[:, None, :] + 1e-9 * h[: n // 10]
    if dim == 2:
        h[:, 2, :2] = h[:, :2, 2] = L[:, 2, :] = L[:, :2, 2] = 0
    h = oracle.deviator(h)
    h *= (strain * rng.random(n) / norm(h))[:, None, None]
    L *= (step * rng.random(n) / norm(oracle.deviator(L)))[:, None, None]
    return h, L


def trial(h, step, dim, isa):
    """Strain after an elastic step; with G = 1/2 the stress deviator equals the strain."""
    q = SAND | {"G": 0.5}
    return oracle.update("elastic", q, 1.0, step, 0.0, h, 0.0, 0.0, dim=dim, isa=isa)[0]


# ---- the strain ----


def test_trial_strain_of_ten_thousand_states_against_scipy(dim):
    rng = np.random.default_rng(dim)
    count = 0
    for strain, step in ((1e-3, 1e-3), (1e-2, 0.2), (0.1, 0.1), (0.3, 0.6), (0.5, 0.5)):
        h, L = random_states(rng, 2_000, dim, strain, step)
        expected = oracle.trial_strain(h, L)
        for isa in ISAS:
            found = trial(h, L, dim, isa)
            assert np.abs(found - expected).max() <= 1e-12
            assert np.abs(np.trace(found, axis1=1, axis2=2)).max() <= 4e-16
        count += len(h)
    assert count == 10_000


@pytest.mark.parametrize(("strain", "step"), [(1.0, 1.0), (1.0, 2.0)])
def test_large_strains_lose_no_more_than_the_condition(dim, strain, step):
    h, L = random_states(np.random.default_rng(5), 2000, dim, strain, step)
    condition = np.exp(4 * (norm(h) + norm(oracle.deviator(L))))
    error = np.abs(trial(h, L, dim, ISAS[-1]) - oracle.trial_strain(h, L)).max(axis=(1, 2))
    assert (error <= 1e-15 * condition + 1e-14).all()


def exact_strain(h, step):
    """`oracle.trial_strain` of one point, in 40 digits."""
    with mpmath.workdps(40):
        half = mpmath.matrix(h.tolist())
        gradient = mpmath.matrix(step.tolist())
        mean = (gradient[0, 0] + gradient[1, 1] + gradient[2, 2]) / 3
        F = mpmath.expm(gradient - mean * mpmath.eye(3))
        trace = (half[0, 0] + half[1, 1] + half[2, 2]) / 3
        b = F * mpmath.expm(2 * (half - trace * mpmath.eye(3))) * F.T
        value, vector = mpmath.eigsy((b + b.T) / 2)
        logs = [mpmath.log(v) / 2 for v in value]
        middle = sum(logs) / 3
        out = vector * mpmath.diag([v - middle for v in logs]) * vector.T
        return np.array([[float(out[i, j]) for j in range(3)] for i in range(3)])


def test_strain_has_all_digits_however_small():
    """Relative to the strain, in 40 digits; LAPACK's logarithm only keeps 1e-16 of 1 + strain."""
    rng = np.random.default_rng(6)
    for size in (1e-12, 1e-8, 1e-4, 1e-2, 0.06, 0.12):
        for dim in (2, 3):
            h, L = random_states(rng, 12, dim, size, size)
            scale = np.maximum(norm(h), norm(oracle.deviator(L)))
            exact = np.array([exact_strain(a, b) for a, b in zip(h, L, strict=True)])
            for isa in ISAS:
                assert (norm(trial(h, L, dim, isa) - exact) / scale).max() <= 2e-15


def test_2d_is_3d_without_its_third_axis():
    h, L = random_states(np.random.default_rng(7), 500, 2, 0.2, 0.4)
    for isa in ISAS:
        np.testing.assert_allclose(trial(h, L, 2, isa), trial(h, L, 3, isa), atol=2e-15)


def test_determinant_stays_one_over_a_hundred_thousand_steps():
    """Loads of random direction, also beyond the short series; plastic flow limits the strains."""
    rng = np.random.default_rng(8)
    q, stress, g, rate = SAND | {"K": 1e4}, np.tile(-800.0 * np.eye(3), (8, 1, 1)), 1.0, 0.0
    steps = rng.normal(size=(64, 8, 3, 3)) * np.geomspace(1e-4, 0.1, 8)[:, None, None]
    rows = oracle.components(stress, 3)
    g, rate = np.ones(8), np.zeros(8)
    c, all_steps = np.full(8, 0.08), [oracle.gradients(step, 3) for step in steps]
    for k in range(100_000):
        _core.hencky_update("linear_ngf", q, 1e-4, all_steps[k % 64], c, rows, g, rate, "")
    strain = (oracle.matrices(rows) + 800.0 * np.eye(3)) / (2 * q["G"])
    assert norm(strain).max() > 1e-4
    determinant = np.linalg.det(oracle.function_of(2 * strain, np.exp))
    assert np.abs(determinant - 1).max() <= 1e-14
    assert np.abs(-rows[:3].sum(axis=0) / 3 / 800.0 - 1).max() <= 1e-14


# ---- the flow ----


def states(rng, n):
    """p, g*, rate and velocity gradients of points that load, unload and flow."""
    p = 10 ** rng.uniform(0, 4, n)
    tau = p * rng.uniform(0, 1.5, n)
    s = rng.normal(size=(n, 3, 3))
    s = oracle.deviator(s + np.swapaxes(s, 1, 2))
    s *= (tau / oracle.shear(s))[:, None, None]
    step = rng.normal(size=(n, 3, 3)) * (10 ** rng.uniform(-7, -2, n))[:, None, None]
    g_star, rate = 10 ** rng.uniform(-6, 3, n), 10 ** rng.uniform(-6, 3, n)
    return p, s - p[:, None, None] * np.eye(3), step, g_star, rate


@pytest.mark.parametrize("flow", oracle.FLOWS[1:])
@pytest.mark.parametrize("isa", ISAS)
def test_flow_against_bisection(flow, isa):
    n, dt = 150, 1e-4
    p, stress, step, g_star, rate = states(np.random.default_rng(9), n)
    found, g, shear_rate = oracle.update(
        flow, SAND, dt, step, p / SAND["K"], stress, g_star, rate, isa=isa
    )
    # the trial state of the core, checked above; that of LAPACK is not accurate enough
    trial, _, _ = oracle.update("elastic", SAND, dt, step, p / SAND["K"], stress, 0.0, 0.0, isa=isa)
    tau = oracle.shear(trial)
    for k in range(n):
        mu, fluidity = oracle.friction(flow, SAND, dt, tau[k] / p[k], p[k], g_star[k], rate[k])
        share = mu * p[k] / tau[k]
        expected = oracle.deviator(trial[k]) * share - p[k] * np.eye(3)
        np.testing.assert_allclose(found[k], expected, atol=1e-12 * p[k])
        # in slow flow of the local laws g is the small difference of tau and its trial value
        lost = 1e-15 * tau[k] / (SAND["G"] * dt * mu * p[k]) * p[k] / mu
        assert g[k] == pytest.approx(fluidity, rel=1e-11, abs=20 * lost)
        assert shear_rate[k] == pytest.approx(mu * g[k], rel=1e-12)


@pytest.mark.parametrize("flow", oracle.FLOWS)
@pytest.mark.parametrize("isa", ISAS)
def test_any_number_of_points_gives_the_same(flow, isa, dim):
    """Same bits whoever the neighbours are: small and large strains, dense and disconnected."""
    rng = np.random.default_rng(10)
    h, L = random_states(rng, 37, dim, 0.2, 0.5)
    stress = 2 * SAND["G"] * h - np.eye(3)
    c, g, rate = rng.uniform(-0.3, 1, 37), rng.random(37), rng.random(37)
    stress[::5] = 0
    L[::3] *= 1e-3
    h[::2] *= 1e-3
    whole = oracle.update(flow, SAND, 1e-4, L, c, stress, g, rate, dim=dim, isa=isa)
    for n in range(20):
        order = rng.permutation(37)[:n]
        part = oracle.update(
            flow, SAND, 1e-4, L[order], c[order], stress[order], g[order], rate[order], dim=dim,
            isa=isa,
        )  # fmt: skip
        assert all((a == b[order]).all() for a, b in zip(part, whole, strict=True))


def test_disconnected_points_are_stress_free_and_reconnect_by_their_shear_rate():
    L = np.array([[[2.0, 5.0, 0.0], [1.0, -3.0, 0.0], [0.0, 0.0, 0.5]]])
    dt, p = 1e-3, 50.0
    step, D = L * dt, (L[0] + L[0].T) / 2
    stress = -10.0 * np.eye(3)[None]
    loose = oracle.update("linear_ngf", SAND, dt, step, -1e-6, stress, 3.0, 4.0)
    assert not any(part.any() for part in loose)
    for reconnect_fluidity in (0.0, 1.0):
        q = SAND | {"reconnect_fluidity": reconnect_fluidity}
        found, g, rate = oracle.update("linear_ngf", q, dt, step, p / q["K"], *loose)
        expected = reconnect_fluidity * math.sqrt(2 * (D * D).sum()) / q["mu_2"]
        assert g[0] == pytest.approx(expected, rel=1e-14)
        h = oracle.trial_strain(np.zeros((1, 3, 3)), step)[0]
        s = 2 * q["G"] * h / (1 + q["G"] * dt / p * expected)
        np.testing.assert_allclose(found[0], s - p * np.eye(3), rtol=1e-11, atol=1e-12)
        assert rate[0] == pytest.approx(oracle.shear(s) / p * expected, rel=1e-11)


def test_elastic_material_bears_tension():
    found, _, _ = oracle.update(
        "elastic", SAND, 1e-3, np.zeros((1, 3, 3)), -1e-3, np.zeros((1, 3, 3)), 0.0, 0.0
    )
    np.testing.assert_allclose(found[0], 1e-3 * SAND["K"] * np.eye(3), rtol=1e-15)


@pytest.mark.parametrize("flow", oracle.FLOWS)
@pytest.mark.parametrize("isa", ISAS)
def test_extreme_numbers_stay_finite(flow, isa, dim):
    rng = np.random.default_rng(11)
    n = 4000
    sizes = np.array([0.0, 1e-300, 1e-60, 1e-9, 0.1, 0.126, 1.0, 2.0, 2.1, 10.0, 1e3, 1e30, 1e60])
    step = rng.uniform(-1, 1, (n, 3, 3)) * rng.choice(sizes, (n, 1, 1))
    stress = rng.uniform(-1, 1, (n, 3, 3)) * rng.choice(sizes, (n, 1, 1))
    stress = np.tril(stress) + np.swapaxes(np.tril(stress, -1), 1, 2)
    c = rng.choice([-1.0, 1.0, 1.0], n) * rng.choice(sizes, n)
    g, rate = rng.choice(sizes, n), rng.choice(sizes, n)
    if dim == 2:
        stress[:, 2, :2] = stress[:, :2, 2] = 0
    for dt in (1e-12, 1e-4):
        found, fluidity, shear_rate = oracle.update(
            flow, SAND, dt, step, c, stress, g, rate, dim=dim, isa=isa
        )
        assert np.isfinite(found).all()
        for values in (fluidity, shear_rate):
            assert (np.isfinite(values) & (values >= 0)).all()


# ---- at the points of the engine ----

PARAMETERS = oracle.SAND | {"A": 0.48, "reconnect_fluidity": 0.0}


def parameters(law):
    sizes = PARAMETERS["d"] * np.sqrt(PARAMETERS["rho_s"])
    known = PARAMETERS | {"mu": PARAMETERS["mu_s"], "xi": PARAMETERS["I0"] / sizes}
    return {name: known[name] for name, _, _ in _core.laws()[law][1]}


@pytest.mark.parametrize("local", [False, True])
@pytest.mark.parametrize("isa", ISAS)
@pytest.mark.parametrize("law", FLOW_OF)
def test_the_law_is_the_kernel_with_cauchy_stress(law, dim, isa, local):
    """Cauchy stress is rho/rho_c times Kirchhoff stress, before the step and after it."""
    nonlocal_law = "ngf" in law
    flow = FLOW_OF[law][local or not nonlocal_law]
    lanes, blocks, dt = _core.build_info(isa)["lanes"], 5, 1e-4
    n = blocks * lanes
    rng = np.random.default_rng(dim)
    step = np.zeros((n, 3, 3))
    step[:, :dim, :dim] = rng.normal(size=(n, dim, dim)) * 1e-3
    c = rng.uniform(-1e-3, 3e-3, n)
    before = c + np.trace(step, axis1=1, axis2=2)
    h = rng.normal(size=(n, 3, 3)) * 1e-4
    if dim == 2:
        h[:, 2, :2] = h[:, :2, 2] = 0
    kirchhoff = 2 * PARAMETERS["G"] * oracle.deviator(h + h.swapaxes(1, 2))
    kirchhoff -= (PARAMETERS["K"] * before)[:, None, None] * np.eye(3)
    kirchhoff[before <= 0] = 0
    rate, g_star = rng.uniform(0, 5, n), rng.uniform(0, 3, blocks)
    spread = np.repeat(g_star, lanes)
    expected, g, rates = oracle.update(
        flow, PARAMETERS, dt, step, c, kirchhoff, spread, rate, dim=dim, isa=isa
    )
    rows = oracle.components(kirchhoff * np.exp(before)[:, None, None], dim)
    gradient = oracle.gradients(step, dim).reshape(dim * dim, blocks, lanes).swapaxes(0, 1)
    found, shear = np.full(n, 7.0), rate.copy()
    extra = (None if local or not nonlocal_law else spread, found)
    gradient = np.ascontiguousarray(gradient)
    _core.law_update(law, dim, parameters(law), dt, 1, gradient, c, rows, shear, isa, *extra)
    cauchy = oracle.components(expected * np.exp(c)[:, None, None], dim)
    np.testing.assert_allclose(rows, cauchy, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(shear, rates, rtol=1e-11, atol=1e-11)
    if nonlocal_law:
        np.testing.assert_allclose(found, g, rtol=1e-11, atol=1e-11)


# ---- bad input ----


def arguments(n=5, dim=3):
    return [
        "linear_ngf", SAND, 1e-4, np.zeros((dim * dim, n)), np.full(n, 1e-3),
        np.full((4 if dim == 2 else 6, n), -1.0), np.ones(n), np.ones(n), "",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"K": 0.0}, "K = 0 must be positive"),
        ({"G": -1.0}, "G = -1 must be positive"),
        ({"reconnect_fluidity": -1e-6}, "reconnect_fluidity = -1e-06 must be zero or positive"),
        ({"reconnect_fluidity": math.nan}, "fluidity = nan must be zero or positive and finite"),
        ({"mu_2": 0.3}, "mu_2 = 0.3 must exceed mu_s = 0.3819"),
        ({"rho_s": math.inf}, "rho_s = inf must be positive and finite"),
    ],
)
def test_parameters_are_checked(change, text):
    given = arguments()
    given[1] = SAND | change
    with pytest.raises(ValueError, match=text):
        _core.hencky_update(*given)


def test_missing_parameters_flows_and_steps_are_named():
    for place, value, text in (
        (1, {k: v for k, v in SAND.items() if k != "t0"}, "the parameter t0 is missing"),
        (0, "plastic", 'no flow "plastic": it must be one of elastic drucker_prager linear_mu_I'),
        (2, math.nan, "dt = nan must be positive and finite"),
        (2, 0.0, "dt = 0 must be positive"),
        (8, "sse9", 'instruction set "sse9" is not available'),
        (3, np.zeros((5, 5)), "axis 0 of gradient has length 5, but 4 or 9 is needed"),
        (5, np.zeros((4, 5)), "axis 0 of stress has length 4, but 6 is needed"),
    ):
        given = arguments()
        given[place] = value
        with pytest.raises(ValueError, match=text):
            _core.hencky_update(*given)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e61])
@pytest.mark.parametrize("place", range(3, 8))
def test_values_are_checked(place, bad):
    given = arguments()
    given[place][..., -1] = bad
    before = [np.copy(a) for a in given[3:8]]
    with pytest.raises(ValueError, match=r"\] = .* is outside the range"):
        _core.hencky_update(*given)
    assert all(
        np.array_equal(a, b, equal_nan=True) for a, b in zip(given[3:8], before, strict=True)
    )
