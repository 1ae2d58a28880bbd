"""DilatantMuI at a point: against scipy, closed forms and its definition; well-behaved anywhere."""

import math

import numpy as np
import pytest
import scipy
from dilatant_point import Point, critical_packing, rates

import granular as gr
from granular import DilatantMuI

SAND = DilatantMuI(E=1e7)
SHEAR = np.array([[0.0, 0.5], [0.5, 0.0]])  # a shear rate of 1, without rotation


def undrained(material, packing, p, gdot, end):
    """Shear stress, pressure and packing after a shear at a constant volume, by scipy."""

    def rate(_, y):
        tau, pressure, log_packing = y
        plastic, psi = rates(material, math.exp(min(log_packing, 0.0)), pressure, tau)
        G, K = material.G, material.K
        return G * (gdot - plastic), K * psi * plastic, -psi * plastic

    start = (0.0, p, math.log(packing))
    found = scipy.integrate.solve_ivp(
        rate, (0.0, end), start, method="Radau", rtol=1e-10, atol=(1e-6, 1e-6, 1e-12)
    )
    tau, pressure, log_packing = found.y[:, -1]
    return tau, pressure, math.exp(log_packing)


@pytest.mark.parametrize("packing", [0.56, 0.585, 0.6])
def test_shear_at_constant_volume_converges_to_the_rate_equations(packing):
    """Dense material gains pressure, loose loses it; the error falls with the first power of dt."""
    p, gdot, end = 20e3, 1.0, 0.02
    exact = np.array(undrained(SAND, packing, p, gdot, end))
    errors = []
    for steps in (100, 200, 400):
        point = Point(SAND, packing, p)
        for _ in range(steps):
            point.step(SHEAR * gdot * end / steps, end / steps)
        found = np.array([point.tau[0], point.p[0], point.packing[0]])
        errors.append(abs(found / exact - 1).max())
    if packing == SAND.phi_c:  # hardly anything happens there
        assert max(errors) < 2e-6
        return
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[-1] < 5e-4, errors
    assert orders == pytest.approx(1.0, abs=0.05), errors


def test_dissipation_is_that_of_mu_I():
    """tau dgamma - psi p dgamma = mu(I) p dgamma, whatever the packing."""
    rng, dt = np.random.default_rng(1), 1e-4
    n = 400
    packing = rng.uniform(0.54, 0.64, n)
    point = Point(SAND, packing, 1e3, n=n)
    for _ in range(30):
        before = point.packing
        point.step(SHEAR * 10 ** rng.uniform(-1, 2, (n, 1, 1)) * dt, dt)
        flows = (point.rate[:n] > 0) & (point.p > 1)
        gamma = point.rate[:n] * dt
        psi_gamma = np.log(before / point.packing)
        work = point.tau * gamma - point.p * psi_gamma
        inertial = point.rate[:n] * SAND.d * np.sqrt(SAND.rho_s / np.maximum(point.p, 1e-9))
        least = SAND.friction(inertial) * point.p * gamma
        assert work[flows] == pytest.approx(least[flows], rel=1e-6)
    assert flows.sum() > 0.5 * n


def test_material_that_opens_rests_at_the_packing_that_it_has():
    """Dense material that was pulled apart by more than 0.02 of its volume is looser when it is
    pressed together again, down to the critical packing; loose material keeps its own."""
    wide = SAND.replace(phi_c=0.3, phi_fast=0.3, dilatancy=1.0)
    for sand, packing, opening, at_rest in (
        (SAND, 0.62, 0.02, 0.62), (SAND, 0.62, 0.04, 0.62 * math.exp(-0.02)),
        (SAND, 0.62, 0.3, 0.585), (SAND, 0.56, 0.1, 0.56),
        (wide, 0.8, 0.5, 0.8 * math.exp(-0.48)), (wide, 0.8, 2.0, 0.3),
    ):  # fmt: skip
        point = Point(sand, packing, 1e3)
        density = math.log(packing) + point.c[0]
        for sign in (1.0, -1.0):
            for _ in range(100):
                point.step(sign * np.eye(2) * opening / 200, 1e-4)
                density -= sign * opening / 100
                assert math.log(point.packing[0]) + point.c[0] == pytest.approx(density, abs=1e-12)
            if sign > 0:
                assert point.p[0] == 0
        assert point.packing[0] == pytest.approx(at_rest, rel=1e-3)


@pytest.mark.parametrize("dim", [2, 3])
def test_any_input_gives_a_state_of_the_law(dim):
    """Nothing but finite numbers, no tension, no stress beyond the cone; the same bits with every
    instruction set and with any neighbours."""
    n, rng = 600, np.random.default_rng(dim)
    found = {}
    for isa in ("one_lane", "avx2", "avx512"):
        try:
            gr._core.build_info(isa)
        except ValueError:
            continue
        rng = np.random.default_rng(dim)
        point = Point(SAND, rng.uniform(0.5, 0.66, n), 1.0, dim=dim, n=n, isa=isa)
        point.c[:n] = rng.choice([1.0, -1.0], n, p=[0.8, 0.2]) * 10 ** rng.uniform(-9, -0.7, n)
        point.stress[:, :n] = rng.normal(size=(len(point.stress), n)) * 10 ** rng.uniform(-6, 6, n)
        for _ in range(3):
            L = rng.normal(size=(n, dim, dim)) * 10 ** rng.uniform(-9, -0.5, (n, 1, 1))
            before = point.packing
            point.step(L, 10 ** rng.uniform(-7, -3))
            assert all(np.isfinite(a).all() for a in (point.stress, point.c, point.bulking))
            assert (point.p >= -1e-12 * (1 + point.tau)).all() and (point.rate >= 0).all()
            assert (point.packing > 0.3).all() and (point.packing < 0.9).all()
            psi = SAND.dilatancy * (before - SAND.phi_fast)
            most = np.maximum(SAND.mu_2 + psi, 0) * point.p
            assert (point.tau <= most * (1 + 1e-6) + 1e-9 * SAND.K).all()
        found[isa] = [a[..., :n].tobytes() for a in (point.stress, point.c, point.bulking)]
        alone = Point(SAND, 0.6, 1e3, dim=dim, isa=isa)
        several = Point(SAND, np.array([0.6, 0.5, 0.64, 0.6]), 1e3, dim=dim, n=4, isa=isa)
        for _ in range(5):
            for each in (alone, several):
                L = np.zeros((dim, dim))
                L[0, 1] = 1e-3
                each.step(L, 1e-4)
        assert several.stress[:, 0].tobytes() == alone.stress[:, 0].tobytes()
    assert len(set(map(tuple, found.values()))) == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"phi_c": 0.9}, "phi_c = 0.9 must be"),
        ({"phi_fast": 0.6}, "phi_fast = 0.6 must be .* 0.585"),
        ({"dilatancy": -1.0}, "dilatancy = -1.0 must be"),
        ({"mu_2": 0.3}, "mu_2 = 0.3 must exceed mu_s"),
        ({"csl_slope": -0.01}, "csl_slope = -0.01 must be"),
        ({"csl_slope": 0.02, "csl_exponent": 0.0}, "csl_exponent = 0.0 must be"),
        ({"rho_c": 1500.0}, r"rho_c = 1500.0 must be phi_c rho_s = 1550.25"),
        ({"elasticity": "hencky"}, "hypoelastic"),
        ({"d": 0.0}, "d = 0.0"),
    ],
)
def test_refusals(changes, message):
    with pytest.raises(ValueError, match=message):
        DilatantMuI(**changes)


def test_the_critical_state_line():
    """Of the void ratio; what depends on the pressure is not known without one."""
    sand = SAND.replace(csl_slope=0.05)
    for p in (0.0, 1e3, 1e5, 1e6):
        assert sand.critical_packing(p) == pytest.approx(critical_packing(sand, p), rel=1e-12)
        share = (sand.phi_c - sand.packing(sand.I0, 0.0)) / (sand.phi_c - sand.phi_fast)
        between = critical_packing(sand, p) * (1 - share) + sand.phi_fast * share
        assert sand.packing(sand.I0, p) == pytest.approx(between, rel=1e-12)
        most = sand.mu_s + sand.dilatancy * (0.62 - critical_packing(sand, p))
        assert sand.peak_friction(0.62, p) == pytest.approx(most, rel=1e-12)
    assert sand.critical_packing(1e9) == 0.8
    assert SAND.peak_friction(0.62, [1e3, 1e6]) == pytest.approx([SAND.peak_friction(0.62)] * 2)
    for call in (sand.critical_packing, lambda: sand.packing(0.1), lambda: sand.peak_friction(0.6)):
        with pytest.raises(ValueError, match="pressure = None must be given"):
            call()
    with pytest.raises(ValueError, match=r"pressure = -1\.0 must be >= 0"):
        sand.packing(0.1, -1.0)


def test_theories_of_constant_density_refuse_it():
    for theory, arguments in (
        (gr.theory.bagnold_profile, (0.01, 24.0, 0.05, SAND)),
        (gr.theory.well_posed_range, (SAND,)),
        (gr.theory.ill_posedness, (0.1, SAND)),
        (gr.theory.plastic_shear_rate, (1e3, 450.0, SAND)),
        (gr.theory.layer_waves, (24.0, 0.05, SAND, 0.1)),
    ):
        with pytest.raises(TypeError, match="must be of a law without dilation"):
            theory(*arguments)


def test_it_is_written_and_replaced():
    assert SAND.replace(phi_c=0.6).rho_c == pytest.approx(0.6 * SAND.rho_s)
    assert SAND.friction(0.0) == SAND.mu_s and SAND.packing(0.0) == SAND.phi_c
    assert SAND.phi_fast == 0.53 and "phi_fast" not in SAND.arguments()
    assert SAND.replace(phi_c=0.5).phi_fast == pytest.approx(0.445, abs=1e-12)
    assert SAND.replace(phi_fast=0.5).replace(phi_c=0.6).phi_fast == 0.5
    assert SAND.packing(SAND.I0) == pytest.approx((SAND.phi_c + SAND.phi_fast) / 2)
    with pytest.raises(ValueError, match=r"I = -1\.0"):
        SAND.friction(-1.0)
