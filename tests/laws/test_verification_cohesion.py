"""Cohesive material against limit analysis and elasticity: cliffs, and a bar that breaks."""

import numpy as np
import pytest

import granular as gr
from granular import measure, theory

MU, COHESION, DENSITY = 0.3819, 400.0, 1500.0
SOIL = gr.DruckerPrager(E=1e6, mu=MU, cohesion=COHESION, rho_c=DENSITY)
LIMITS = theory.cliff_height(cohesion=COHESION, mu=MU, density=DENSITY, gravity=9.8)


def test_limit_heights_by_hand():
    """c tan(45 deg + phi/2) is c/(1 - mu) on the circle, and c (mu + sqrt(1 + mu^2)) on a band."""
    weight = DENSITY * 9.8
    assert LIMITS.coaxial == pytest.approx(4 * COHESION / weight / (1 - MU), rel=1e-12)
    band = 4 * COHESION / weight * (MU + np.hypot(1, MU))
    assert LIMITS.band == pytest.approx(band, rel=1e-12)
    assert LIMITS.coaxial_cohesion == pytest.approx(COHESION / np.sqrt(1 - MU**2), rel=1e-12)
    for bad in ({"mu": 1.0}, {"cohesion": -1.0}, {"density": 0.0}, {"gravity": 0.0}):
        with pytest.raises(ValueError, match="must be"):
            theory.cliff_height(**{"cohesion": 1.0, "mu": 0.4, "density": 1e3} | bad)


def crest(state):
    """Number of the point that was nearest to the crest at the start."""
    return int(np.argmax(state.x.sum(axis=1)))


@pytest.mark.parametrize("material", [SOIL, gr.MuI(E=1e6, mu_s=MU, cohesion=COHESION)])
def test_low_cliff_stands_and_high_cliff_falls(material):
    """The low one is 0.95 of the bound for bands, whose factor is 3.83 for curved surfaces."""
    moved = {}
    for height in (0.15, 0.25):
        scene = gr.scenes.cohesive_cliff(height=height, cell=0.025, material=material)
        sim = gr.Simulation(scene)
        top, start = crest(sim.state), sim.state.x.copy()
        sim.run(monitor=False)
        moved[height] = start[top, 1] - sim.state.x[top, 1]
    assert 0.15 < LIMITS.band < LIMITS.coaxial < 0.25
    elastic = DENSITY * 9.8 * 0.15**2 / 2 / 1e6
    assert elastic / 2 < moved[0.15] < 4 * elastic
    assert moved[0.25] > 0.05


def critical_height(cell, material, ramp=10.0, height=0.2, full=25.0):
    """Height [m] of a cliff that fails under 9.8 m/s2, from one under a gravity that grows slowly.

    It fails where its crest has sunk three times as far as by elasticity: the settlement per
    gravity, which is constant up to half of the critical gravity.
    """
    scene = gr.scenes.cohesive_cliff(
        height=height, cell=cell, gravity=full, ramp=ramp, duration=ramp, material=material
    )
    sim = gr.Simulation(scene)
    top, start = crest(sim.state), sim.state.x.copy()
    elastic = None
    for gravity in np.arange(2.0, full, 0.25):
        sim.run(until=ramp * gravity / full, monitor=False)
        sunk = start[top, 1] - sim.state.x[top, 1]
        elastic = elastic or sunk / gravity
        if sunk > 3 * elastic * gravity:
            return height * gravity / 9.8
    raise AssertionError("the cliff stands")


@pytest.mark.slow
@pytest.mark.parametrize("material", [SOIL, SOIL.replace(E=4e6), gr.MuI(E=1e6, cohesion=COHESION)])
@pytest.mark.parametrize("cell", [0.0125, 0.00625])
def test_critical_height_of_a_cliff(cell, material):
    """Between limit analysis for a curved surface, with bands, and for a plane, on the circle."""
    assert 3.83 / 4 * LIMITS.band <= critical_height(cell, material) <= LIMITS.coaxial


@pytest.mark.slow
def test_cliff_without_tensile_strength_is_lower():
    """Without tension limit analysis gives half the height as the one that surely stands."""
    whole = critical_height(0.0125, SOIL)
    torn = critical_height(0.0125, SOIL.replace(tensile_strength=0.0))
    assert LIMITS.band / 2 < torn < 0.97 * whole


def test_hanging_bar_breaks_at_its_tensile_strength():
    """A bar under its own weight breaks at its top, at the load by elasticity in plane strain.

    There the largest stress is T = rho g L and p = -(1 + nu) T/3, until p = -p_t. It takes no
    shear strength: tau = T sqrt((1 - nu + nu^2)/3) is below yield.
    """
    strength, nu, length, cell = 80.0, 0.3, 0.4, 0.025
    tension = 3 * strength / (1 + nu)
    assert tension * np.sqrt((1 - nu + nu**2) / 3) < COHESION - MU * strength
    expected = tension / (DENSITY * length)
    full, ramp = 1.3 * expected, 3.0
    scene = gr.Scene(
        name="bar",
        grid=gr.Grid((0.0, 0.0), cell, (4, 24)),
        fills=[gr.Fill(gr.Box((0.025, 0.2), (0.075, 0.2 + length)), 16)],
        material=SOIL.replace(tensile_strength=strength),
        walls=[gr.Wall(1, 0.6, kind="free_slip")],
        gravity=gr.Gravity((0.0, ramp), ((0.0, 0.0), (0.0, -full))),
        duration=ramp,
    )
    sim = gr.Simulation(scene)
    broken = None
    for gravity in np.linspace(0.7, 1.3, 61) * expected:
        sim.run(until=ramp * gravity / full, monitor=False)
        if sim.state.separated.any():
            broken = gravity
            break
        # what is in tension is neither free of stress nor under pressure
        assert measure.disconnected_fraction(sim.state) == 0
        assert sim.state.pressure.max() < strength / 10
    assert broken == pytest.approx(expected, rel=0.06)
    assert sim.state.x[sim.state.separated > 0, 1].min() > 0.6 - 3 * cell
    sim.run(monitor=False)
    assert sim.state.speed.mean() > 0.05  # it falls
