"""Flow between cylinders by the nonlocal law: Bessel functions, solve_bvp, limits."""

import math
from types import SimpleNamespace

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_bvp

from granular import theory

INNER, OUTER = 0.0999, 0.2001
BEADS = SimpleNamespace(
    mu_s=0.3819, mu_2=math.inf, A=0.48, d=0.004, b=(0.6435 - 0.3819) / 0.278, rho_s=2550.0, t0=1e-4
)


def material(**changes):
    return SimpleNamespace(**(vars(BEADS) | changes))


@pytest.mark.parametrize("walls", ["rough", "smooth"])
def test_slow_flow_is_a_bessel_function_of_imaginary_order(walls):
    """For an infinite mu_2 g = K_{i nu}(r sqrt(mu_s)/(A d)), nu = R_i sqrt(mu_w)/(A d), where the
    outer cylinder is far: over 20 decades of it."""
    flow = theory.couette_quasi_static(INNER, OUTER, BEADS, walls=walls, points=401)
    reach = BEADS.A * BEADS.d
    k, order = math.sqrt(BEADS.mu_s) / reach, 1j * INNER * mpmath.sqrt(flow.mu_wall) / reach

    def g(r):
        # scaled: the functions are about exp(-50)
        return float(mpmath.re(mpmath.besselk(order, k * r) * mpmath.mpf(10) ** 20))

    with mpmath.workdps(30):
        top = flow.g.argmax()
        scale = flow.g[top] / g(flow.r[top])
        for i in (30, 100, 200, 300, 380):
            assert flow.g[i] == pytest.approx(scale * g(flow.r[i]), rel=1e-7)
        at_wall = g(INNER) if walls == "rough" else mpmath.diff(g, INNER) * INNER / 20
        assert abs(at_wall * scale) < 1e-6 * flow.g[top]
    assert (flow.g[1:-1] > 0).all()  # the first mode has no node
    assert flow.g[380] / flow.g[top] < 1e-10
    assert flow.error < 1e-7


def test_the_tail_falls_by_the_decay_length():
    """d ln g/dr = -1/length - 1/(2 r) + ..., the next order of Bessel's functions."""
    for mu_2 in (math.inf, 0.6435):
        beads = material(mu_2=mu_2, d=0.002)
        flow = theory.couette_quasi_static(INNER, 4 * INNER, beads, points=4001)
        away = (flow.r > 2.5 * INNER) & (flow.r < 3.5 * INNER)
        slope = np.gradient(np.log(flow.g[away]), flow.r[away])[1:-1]
        r, mu = flow.r[away][1:-1], flow.mu[away][1:-1]
        lengths = theory.couette_decay_length(mu, beads)
        # WKB: g = q^(-1/2) exp(-int q dln r), q = r/length in ln r
        q = r / lengths
        wkb = -1 / lengths - np.gradient(np.log(q), r) / 2
        np.testing.assert_allclose(slope[2:-2], wkb[2:-2], rtol=1e-4)
    far = theory.couette_decay_length(0.0, material(mu_2=0.6435))
    assert far == pytest.approx(0.48 * 0.004 * math.sqrt(0.6435 / (0.3819 * (0.6435 - 0.3819))))
    assert theory.couette_decay_length(0.0, BEADS) == pytest.approx(
        0.48 * 0.004 / math.sqrt(0.3819)
    )
    assert theory.couette_decay_length(0.5, BEADS) == math.inf


@pytest.mark.parametrize(
    ("walls", "mu_2", "rate"), [("rough", math.inf, 1.0), ("smooth", 0.6435, 5.0)]
)
def test_flow_at_a_rate_against_solve_bvp(walls, mu_2, rate):
    """scipy's collocation in r with mu_w as its parameter; g, g' and omega."""
    beads, p = material(mu_2=mu_2), 500.0
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
        np.interp(r, flow.r, flow.g / size), np.interp(r, flow.r, np.gradient(flow.g, flow.r)) / size,
        np.interp(r, flow.r, flow.omega * rate),
    ])  # fmt: skip
    found = solve_bvp(rates, ends, r, start, p=[flow.mu_wall * 1.001], tol=1e-8, max_nodes=20_000)
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
        np.testing.assert_allclose(flow.g[1:-1], slow.g[1:-1], rtol=3e-3)  # the tail too


def test_fast_flow_of_tiny_grains_is_the_local_law():
    """A -> 0: gdot = (mu - mu_s) sqrt(p/rho_s)/(b d) where mu > mu_s, and rest outside."""
    beads, p, rate = material(A=0.01, d=0.004), 500.0, 20.0
    flow = theory.couette_flow(INNER, OUTER, beads, rate=rate, pressure=p, walls="smooth")
    over = np.maximum(flow.mu - beads.mu_s, 0) * math.sqrt(p / beads.rho_s) / (beads.b * beads.d)
    np.testing.assert_allclose(flow.shear_rate, over, atol=0.02 * over.max())
    yields = INNER * math.sqrt(flow.mu_wall / beads.mu_s)
    assert flow.omega[flow.r > yields * 1.02].max() < 1e-3
    # omega from the integral of gdot/r: mu_w (1 - (R_i/r)^2)/2 - mu_s ln(r/R_i), to the yield radius
    share = flow.mu_wall / beads.mu_s
    integral = beads.mu_s * (share - 1 - math.log(share)) / 2
    expected = integral * math.sqrt(p / beads.rho_s) / (beads.b * beads.d)
    assert rate == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"outer": 0.05}, "outer = 0.05 must exceed inner = 0.0999"),
        ({"inner": -1.0}, "inner = -1.0 must be a finite number > 0"),
        ({"walls": "sticky"}, "walls = 'sticky' must be one of 'rough', 'smooth'"),
        ({"points": 200}, "points = 200 must be odd"),
        ({"points": 11}, "points = 11 must be an integer from"),
        ({"rate": 0.0}, "rate = 0.0 must be"),
        ({"material": material(A=0.0)}, "A = 0.0 must be"),
        ({"material": material(mu_2=0.3)}, "mu_2 = 0.3 must exceed mu_s = 0.3819"),
    ],
)
def test_arguments_are_checked(change, text):
    given = {"inner": INNER, "outer": OUTER, "material": BEADS} | change
    with pytest.raises(ValueError, match=text):
        theory.couette_quasi_static(**given)


def test_pressure_decay_length_and_narrow_gaps():
    with pytest.raises(ValueError, match=r"pressure = -1\.0 must be"):
        theory.couette_flow(INNER, OUTER, BEADS, rate=1.0, pressure=-1.0)
    with pytest.raises(ValueError, match=r"mu = -0\.1 must be >= 0"):
        theory.couette_decay_length(-0.1, BEADS)
    with pytest.raises(RuntimeError, match=r"no slow flow: the gap of .* is too narrow"):
        theory.couette_quasi_static(INNER, INNER + 1e-5, material(mu_2=0.6435))
