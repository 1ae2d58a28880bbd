"""Flow between cylinders by the nonlocal law: Bessel functions, solve_bvp, limits."""

import math
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, solve_bvp

from granular import materials, theory

INNER, OUTER = 0.0999, 0.2001
BEADS = SimpleNamespace(
    mu_s=0.3819, mu_2=math.inf, A=0.48, d=0.004, b=(0.6435 - 0.3819) / 0.278, rho_s=2550.0, t0=1e-4
)


def material(**changes):
    return SimpleNamespace(**(vars(BEADS) | changes))


@pytest.mark.parametrize(
    ("beads", "walls"), [(BEADS, "rough"), (BEADS, "smooth"), (materials.couette_beads, "rough")]
)
def test_slow_flow_is_a_bessel_function_of_imaginary_order(beads, walls):
    """Solution if friction has no limit, over 8 decades: g = K_{i nu}(k r) + a Re I_{i nu}(k r).

    k = sqrt(mu_s)/(A d), nu = R_i sqrt(mu_w)/(A d); the outer cylinder determines a.
    """
    flow = theory.couette_quasi_static(INNER, OUTER, beads, walls=walls, points=401)
    reach = beads.A * beads.d
    k, order = math.sqrt(beads.mu_s) / reach, 1j * INNER * math.sqrt(flow.mu_wall) / reach

    def ending(f, r):  # value or slope that vanishes at a cylinder
        return f(r) if walls == "rough" else mpmath.diff(f, r, h=1e-9) * INNER / 30

    with mpmath.workdps(40):
        shrinking = lambda r: mpmath.re(mpmath.besselk(order, k * r))  # noqa: E731
        growing = lambda r: mpmath.re(mpmath.besseli(order, k * r))  # noqa: E731
        share = -ending(shrinking, mpmath.mpf(OUTER)) / ending(growing, mpmath.mpf(OUTER))
        g = lambda r: shrinking(r) + share * growing(r)  # noqa: E731
        top = flow.g.argmax()
        scale = flow.g[top] / g(flow.r[top])
        for i in (30, 100, 200, 300, 380, 395):
            assert flow.g[i] == pytest.approx(float(scale * g(flow.r[i])), rel=1e-8)
        assert abs(ending(g, mpmath.mpf(INNER)) * scale) < 1e-8 * flow.g[top]
    assert (flow.g[1:-1] > 0).all()  # the first mode has no zero
    assert flow.g[395] / flow.g[top] < 1e-7
    assert flow.error < 1e-7


def test_the_tail_falls_by_the_decay_length():
    """Far out g = q^(-1/2) exp(-integral of dr/length), q = r/length: the WKB form in ln r."""
    for mu_2 in (math.inf, 0.6435):
        beads = material(mu_2=mu_2)
        flow = theory.couette_quasi_static(INNER, 4 * INNER, beads, points=401)
        away = (flow.r > 2 * INNER) & (flow.r < 3.7 * INNER)
        r, lengths = flow.r[away], theory.couette_decay_length(flow.mu[away], beads)
        log_g = np.log(flow.g[away]) + np.log(r / lengths) / 2
        expected = -cumulative_trapezoid(1 / lengths, r, initial=0)
        next_term = (lengths / r).max() / 4
        np.testing.assert_allclose(log_g - log_g[0], expected, atol=next_term)
        assert expected[-1] < -30
    far = theory.couette_decay_length(0.0, material(mu_2=0.6435))
    assert far == pytest.approx(0.48 * 0.004 * math.sqrt(0.6435 / (0.3819 * (0.6435 - 0.3819))))
    assert theory.couette_decay_length(0.0, BEADS) == pytest.approx(
        0.48 * 0.004 / math.sqrt(0.3819)
    )
    assert theory.couette_decay_length(0.5, BEADS) == math.inf


@pytest.mark.parametrize(
    ("beads", "walls", "mu_2", "rate"),
    [
        (BEADS, "rough", math.inf, 1.0),
        (material(mu_2=0.6435), "smooth", 0.6435, 5.0),
        (materials.couette_beads, "rough", math.inf, 1.0),
    ],
)
def test_flow_at_a_rate_against_solve_bvp(beads, walls, mu_2, rate):
    """scipy's collocation in r with mu_w as its parameter; compares g, g' and omega."""
    p = 500.0
    flow = theory.couette_flow(INNER, OUTER, beads, rate=rate, pressure=p, walls=walls)
    grain = beads.d * math.sqrt(beads.rho_s / p)
    size = flow.g.max()

    def rates(r, y, parameters):
        mu = parameters[0] * (INNER / r) ** 2
        lam = mu - beads.mu_s
        if not math.isinf(mu_2):
            lam = lam * (mu_2 - beads.mu_s) / (mu_2 - mu)
        g = y[0] * size
        pull = lam * g - beads.b * grain * mu * g**2
        return np.array([y[1], -y[1] / r - pull / (beads.A * beads.d) ** 2 / size, -g * mu / r])

    def ends(a, b, parameters):
        held = 0 if walls == "rough" else 1
        return np.array([a[held], b[held], a[2] - rate, b[2]])

    r = np.linspace(INNER, OUTER, 201)
    start = np.array([
        np.interp(r, flow.r, flow.g / size),
        np.interp(r, flow.r, np.gradient(flow.g / size, flow.r)),
        np.interp(r, flow.r, flow.omega * rate),
    ])  # fmt: skip
    found = solve_bvp(rates, ends, r, start, p=[flow.mu_wall * 1.001], tol=1e-6, max_nodes=20_000)
    assert found.success, found.message
    assert flow.mu_wall == pytest.approx(found.p[0], rel=1e-5)
    g, _, omega = found.sol(flow.r)
    np.testing.assert_allclose(flow.g, g * size, atol=2e-5 * size)
    np.testing.assert_allclose(flow.omega, omega / rate, atol=2e-5)
    np.testing.assert_allclose(flow.shear_rate, flow.g * flow.mu)
    assert flow.error < 1e-4


def test_slow_is_the_limit_of_the_rate():
    for mu_2 in (math.inf, 0.6435):
        slow = theory.couette_quasi_static(INNER, OUTER, material(mu_2=mu_2), rate=1e-5)
        flow = theory.couette_flow(
            INNER, OUTER, material(mu_2=mu_2), rate=1e-5, pressure=500.0, points=2001
        )
        assert flow.mu_wall == pytest.approx(slow.mu_wall, rel=1e-6)
        np.testing.assert_allclose(flow.omega, slow.omega, atol=1e-6)
        np.testing.assert_allclose(flow.g[1:-1], slow.g[1:-1], rtol=3e-3)  # the tail is included


def test_fast_flow_of_tiny_grains_is_the_local_law():
    """A -> 0: gdot = (mu - mu_s) sqrt(p/rho_s)/(b d) where mu > mu_s, and no flow outside."""
    beads, p, rate = material(A=0.02), 500.0, 20.0
    flow = theory.couette_flow(INNER, OUTER, beads, rate=rate, pressure=p, walls="smooth")
    over = np.maximum(flow.mu - beads.mu_s, 0) * math.sqrt(p / beads.rho_s) / (beads.b * beads.d)
    np.testing.assert_allclose(flow.shear_rate, over, atol=0.02 * over.max())
    yields = INNER * math.sqrt(flow.mu_wall / beads.mu_s)
    assert flow.omega[flow.r > yields * 1.02].max() < 1e-3
    # omega is the integral of gdot/r, mu_w (1 - (R_i/r)^2)/2 - mu_s ln(r/R_i), up to there
    share = flow.mu_wall / beads.mu_s
    integral = beads.mu_s * (share - 1 - math.log(share)) / 2
    expected = integral * math.sqrt(p / beads.rho_s) / (beads.b * beads.d)
    assert rate == pytest.approx(expected, rel=0.01)


def test_no_friction_drives_a_flow_in_too_narrow_a_gap():
    with pytest.raises(
        RuntimeError, match=r"no friction up to mu_wall = 0\.643.* in a gap of 1e-05 m"
    ):
        theory.couette_quasi_static(INNER, INNER + 1e-5, material(mu_2=0.6435))
