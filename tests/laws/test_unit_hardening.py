"""Drucker-Prager law whose friction changes with plastic strain, in one step and in many."""

import math

import numpy as np
import oracle_hencky as oracle
import pytest
from oracle_fluidity import available
from same_bits import same_bits
from scipy.optimize import brentq

import granular as gr
from granular import DruckerPrager, HardeningDruckerPrager, MuI, _core, materials

LAW = "hencky_hardening_drucker_prager"
SOIL = HardeningDruckerPrager(E=1.2e6, nu=0.3, h0_deg=44.0, h1_deg=9.0, h2=0.2, h3_deg=9.0)
ANGLES = {"h0_deg": 44.0, "h1_deg": 9.0, "h2": 0.2, "h3_deg": 9.0}


def cone(angle):
    """Friction tau/p of the cone through triaxial compression, by the friction angle [rad]."""
    return 2 * math.sqrt(3) * np.sin(angle) / (3 - np.sin(angle))


def friction(q):
    """Friction at the friction angle phi(q)."""
    return cone(np.radians(44.0 + (9.0 * q - 9.0) * np.exp(-0.2 * q)))


def step(dim, gradient, c, stress, q, isa="", dt=1e-3):
    """Apply `_core.law_update` to matrices (n, 3, 3) in whole blocks.

    Returns stress, plastic shear rates and plastic strain.
    """
    n, lanes = len(c), _core.build_info(isa)["lanes"]
    rows, rate, q = oracle.components(stress, dim), np.zeros(n), q.copy()
    blocks = oracle.gradients(gradient, dim).reshape(dim * dim, n // lanes, lanes).swapaxes(0, 1)
    numbers = ANGLES | {"K": SOIL.K, "G": SOIL.G}
    blocks = np.ascontiguousarray(blocks)
    _core.law_update(LAW, dim, numbers, dt, 1, blocks, c, rows, rate, isa, None, None, q)
    return oracle.matrices(rows), rate, q


@pytest.mark.parametrize("isa", available())
def test_a_step_returns_to_the_cone_of_its_start(dim, isa):
    """Comparison with matrix functions of scipy; q grows by the norm of the plastic strain."""
    rng, n = np.random.default_rng(dim), 320
    gradient = np.zeros((n, 3, 3))
    gradient[:, :dim, :dim] = 1e-3 * rng.normal(size=(n, dim, dim))
    trace = np.trace(gradient, axis1=1, axis2=2)[:, None, None]
    gradient -= trace / dim * np.diag(np.arange(3) < dim)
    c = rng.choice([-1e-3, 1e-3], n, p=[0.1, 0.9]) * rng.uniform(0.1, 3.0, n)
    h = np.zeros((n, 3, 3))
    h[:, :dim, :dim] = 4e-4 * rng.normal(size=(n, dim, dim))
    h = oracle.deviator(h + h.swapaxes(1, 2))
    q = rng.choice([0.0, 1.0], n) * 10 ** rng.uniform(-4, 4, n)
    p = SOIL.K * c
    kirchhoff = 2 * SOIL.G * h - p[:, None, None] * np.eye(3)
    kirchhoff[c <= 0] = 0
    h[c <= 0] = 0
    cauchy = np.exp(c)[:, None, None] * kirchhoff
    found, rate, strain = step(dim, gradient, c, cauchy, q, isa)

    trial = 2 * SOIL.G * oracle.trial_strain(h, gradient)
    tau = oracle.shear(trial)
    limit = np.where(c > 0, np.minimum(tau, friction(q) * p), 0.0)
    expected = np.where(c > 0, limit / tau, 0)[:, None, None] * trial
    expected -= np.maximum(p, 0)[:, None, None] * np.eye(3)
    flows = (c > 0) & (limit < tau)
    assert 50 < np.count_nonzero(flows) < 280
    np.testing.assert_allclose(
        found, np.exp(c)[:, None, None] * expected, rtol=1e-11, atol=1e-11 * SOIL.G
    )
    plastic = np.where(flows, (tau - limit) / SOIL.G, 0.0)
    np.testing.assert_allclose(rate, plastic / 1e-3, rtol=1e-9, atol=1e-7)
    removed = np.linalg.norm((1 - limit / tau)[:, None, None] * trial, axis=(1, 2)) / (2 * SOIL.G)
    np.testing.assert_allclose(strain - q, np.where(c > 0, removed, 0), rtol=1e-7, atol=1e-12)


def test_shear_at_constant_volume_follows_the_curve():
    """tau = mu(q) p with sqrt(2) q = Gamma - tau/G, solved by scipy; errors fall with the step."""
    p, total = 800.0, 10.0
    errors = []
    for steps in (1000, 2000):
        gradient = np.zeros((8, 3, 3))
        gradient[:, 0, 1] = total / steps
        c, q = np.full(8, p / SOIL.K), np.zeros(8)
        stress = -p * np.exp(c)[:, None, None] * np.eye(3)
        worst = 0.0
        for made in range(1, steps + 1):
            stress, _, q = step(3, gradient, c, stress, q)
            if made % (steps // 20):
                continue
            gamma = total * made / steps
            tau = brentq(
                lambda t, gamma=gamma: t - p * friction((gamma - t / SOIL.G) / math.sqrt(2)),
                0.0,
                3 * p,
            )
            worst = max(worst, abs(oracle.shear(stress[0] / math.exp(c[0])) / tau - 1))
            assert -np.trace(stress[0]) / 3 == pytest.approx(p * math.exp(c[0]), rel=1e-12)
        errors.append(worst)
    assert errors[1] < 2e-3
    assert errors[1] < 0.6 * errors[0]
    assert q[0] > 6.0  # past the peak


def collapse(material):
    return gr.scenes.column_collapse(aspect=1.0, cell=0.02, material=material.replace(E=1e6))


@pytest.mark.parametrize("change", [{}, {"h1_deg": 0.0}, {"h1_deg": -9.0}, {"h3_deg": -9.0}])
def test_limiting_friction_is_the_largest_on_the_way(change):
    soil = SOIL.replace(**change)
    angles = np.radians([soil.friction_angle_deg(q) for q in np.linspace(0.0, 200.0, 20001)])
    assert soil.limiting_friction == pytest.approx(cone(angles.max()), rel=1e-6)


def test_without_hardening_it_is_drucker_prager():
    mu = cone(math.radians(30.0))
    even = HardeningDruckerPrager(h0_deg=30.0, h1_deg=0.0, h2=1.0, h3_deg=0.0)
    plain = DruckerPrager(mu=mu, elasticity="hencky")
    sims = [gr.Simulation(collapse(m), threads=1) for m in (even, plain)]
    for sim in sims:
        sim.step(150)
    assert sims[0].state.plastic_strain.max() > 1e-3
    for name in ("x", "v", "stress"):
        first, second = (getattr(sim.state, name) for sim in sims)
        np.testing.assert_allclose(first, second, rtol=0, atol=1e-9 * abs(second).max())


def test_only_this_law_pays_for_the_plastic_strain():
    for material in (MuI(), DruckerPrager(elasticity="hencky"), materials.grc_1):
        assert "plastic_strain" not in gr.Simulation(collapse(material), threads=1).buffers


def test_bits_do_not_depend_on_threads_or_restarts():
    assert same_bits(collapse(SOIL), 60, 60).state.plastic_strain.any()


def test_the_soil_of_the_excavation():
    """Friction angle 35 to 44 degrees, peak 57.6, as in section 4.2 of Haeri & Skonieczny 2021."""
    soil = materials.grc_1_hardening
    assert soil.friction_angle_deg(0.0) == 35.0
    assert soil.friction_angle_deg(math.inf) == soil.friction_angle_deg(1e4) == 44.0
    assert soil.friction_angle_deg(6.0) == pytest.approx(44.0 + 45.0 * math.exp(-1.2))
    scene = gr.scenes.excavation(
        width=0.05, blade=(0.05, 0.05, 0.457), length=0.8, cell=0.025, travel=0.1, speed=0.2,
        dive_speed=0.1, settle=0.02, ramp=0.01, material=soil.replace(E=0.15e6),
    )  # fmt: skip
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.15, monitor=False)
    assert sim.bodies[0].impulse[0] < 0.0
    assert sim.state.plastic_strain.max() > 0.01


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"elasticity": "hypoelastic"}, ValueError, "elasticity = 'hypoelastic' must be"),
        ({"h2": 0.0}, ValueError, "h2 = 0.0"),
        ({"h0_deg": math.nan}, ValueError, "h0_deg = nan"),
        ({"h1_deg": "9"}, TypeError, "h1_deg = '9'"),
        ({"h0_deg": 95.0}, ValueError, r"angles of 85 to .* must be in \(0, 90\)"),
        ({"h3_deg": 36.0}, ValueError, "angles of -1 to"),
        ({"h1_deg": 40.0}, ValueError, "h1_deg = 40.0"),
        ({"h1_deg": -30.0, "h2": 0.1}, ValueError, "h1_deg = -30.0"),
        ({"rho_c": 2500.0}, ValueError, "rho_c = 2500.0 must not exceed"),
        ({"mu": 0.4}, TypeError, "mu"),
    ],
)
def test_bad_numbers_are_named(arguments, error, message):
    with pytest.raises(error, match=message):
        HardeningDruckerPrager(**arguments)
