"""Runs that fail without an error are reported by the diagnostics; sound runs are not."""

import math
import warnings

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Box, Elastic, Fill, Grid
from granular.mpm import limits
from granular.run.monitor import SPACING

BEADS = gr.materials.glass_beads.replace(E=1e6)


def incline(columns=8, **options):
    settings = {"cell": 0.02, "columns": columns, "jitter": 0.6, "material": BEADS}
    return gr.scenes.incline(**(settings | options))


def test_the_default_scheme_is_ok_in_two_dimensions():
    health = gr.Simulation(incline(), threads=1).run(until=3.0, every=0.1).health()
    assert health.ok, str(health)
    assert health["disconnected"].value < 0.03
    assert health["ill_posed"].value < 0.1


def test_the_published_scheme_is_not_ok():
    """The bulk is disconnected, and the layer compacts although the densities do not show it."""
    scene = incline(scheme=gr.schemes.dunatunga_kamrin_2015.replace(dt=None))
    health = gr.Simulation(scene, threads=1).run(until=4.0, every=0.1).health()
    assert health["disconnected"].verdict == "suspect"
    assert health["density_drift"].verdict == "suspect"


def test_too_large_a_step_makes_energy(monkeypatch):
    """Linear FLIP at c dt/dx = 0.9 gains energy without NaN; refused unless the limit is lifted."""
    step = 0.9 * 0.02 / BEADS.wave_speed
    scene = incline(columns=1, jitter=0.0, scheme=gr.schemes.dunatunga_kamrin_2015.replace(dt=step))
    with pytest.raises(ValueError, match="dt = "):
        gr.Simulation(scene)
    monkeypatch.setattr(limits, "courant_limit", lambda scene: math.inf)
    sim = gr.Simulation(scene, threads=1).run(until=6.0, every=0.1)
    assert np.isfinite(sim.state.v).all()
    assert sim.health()["energy_created"].verdict == "suspect"


def test_a_fall_while_gravity_is_switched_on_creates_no_energy():
    sim = gr.Simulation(gr.scenes.hourglass(kind="sloped", E=1e6), threads=1).run(until=0.7)
    assert sim.health()["energy_created"].value < 0.01, str(sim.health())


def test_an_impact_between_two_tallies_creates_no_energy():
    """A sum over all steps gives 0.001; with tallies every 64 steps it was 0.11."""
    sim = gr.Simulation(gr.scenes.tumbling_block(), threads=1).run(until=0.6)
    assert sim.health()["energy_created"].value < 0.01, str(sim.health())


def test_the_verdict_is_no_lottery_of_the_duration():
    """A hopper that pulsates: by one or two samples its verdict changed with the duration."""
    scene = gr.scenes.hopper(
        angle_deg=45.0, orifice=0.1, width=0.4, fill_height=0.6, friction=0.5, cell=0.01,
        opens_at=0.0, E=1e6, mu_s=0.5, duration=0.8,
    )  # fmt: skip
    seen = []
    gr.Simulation(scene, threads=1).run(every=0.04, hooks=(lambda sim: seen.append(sim.health()),))
    assert len(seen) == 21
    later = seen[5:]
    assert {health.ok for health in later} == {True}, [str(health) for health in later]
    assert min(health.samples for health in later) >= 40
    assert max(health["disconnected"].value for health in later) < 0.1


def springs(dt, parameters, gradient, log_density, stress, shear_rate, history):
    """A user-defined law: the stress is that of the elastic predictor."""


MATERIALS = {
    "grains": BEADS,
    "elastic": Elastic(E=1e6, rho_c=1500.0),
    "own": gr.materials.from_function(springs, E=1e6, rho_c=1500.0),
    "own, elastic": gr.materials.from_function(springs, E=1e6, rho_c=1500.0, bears_tension=True),
}


@pytest.mark.parametrize("material", MATERIALS)
def test_nonsense_of_any_material_is_suspect(material):
    """Density of 2.5e15 kg/m3, void ratio of 1e115, speeds of waves and strains of a step."""
    chosen = MATERIALS[material]
    scene = scene_with(
        grid=Grid((0.0, 0.0), 0.1, (8, 8), periodic=(True, True)),
        fills=(Fill(Box((0.0, 0.0), (0.8, 0.8)), 4),),
        material=chosen,
        scheme=gr.Scheme(dt=1e-4),
        gravity=0.0,
    )

    def suspect(field, change):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", gr.StabilityWarning)
            sim = gr.Simulation(scene, threads=1)
        sim.step(2 * SPACING - 1)  # the next one ends with a tally
        at = np.flatnonzero(sim.buffers["id"] >= 0)
        sim.buffers[field][..., at] = change(sim.buffers["x"][:, at], sim.buffers[field][..., at])
        sim.step(1)
        seen = sim.health()
        assert all(indicator.remedy in seen.verdict for indicator in seen.suspect)
        return {indicator.name for indicator in seen.suspect}

    waves = chosen.wave_speed
    assert suspect("log_density", lambda _, c: c) == set()
    if chosen.granular is False:
        assert suspect("log_density", lambda _, c: c - 0.8) >= {"dilution"}
    assert "compression" in suspect("log_density", lambda _, c: c + math.log(2.5e15 / 1500.0))
    assert "dilution" in suspect("log_density", lambda _, c: c - 115 * math.log(10.0))
    assert "mach" in suspect("v", lambda _, v: v + 0.4 * waves)
    shear = 0.8 / 1e-4  # 1/s
    layer = suspect(
        "v", lambda x, v: np.array([shear * (x[1] - 0.4), 0 * v[1]]) * (abs(x[1] - 0.4) < 0.1)
    )
    assert "strain_step" in layer


def test_slow_flow_is_ill_posed_and_reported():
    health = gr.Simulation(incline(angle_deg=21.2), threads=1).run(until=2.0, every=0.1).health()
    assert health["ill_posed"].value > 0.5
    assert health["ill_posed"].verdict == "reported"


def test_a_bar_that_is_torn_by_the_grid():
    """Four points per cell: a bar stretched to twice its length has points a cell apart."""
    scene = scene_with(
        grid=Grid((0.0, 0.0), 0.1, (40, 3)),
        fills=(Fill(Box((1.5, 0.1), (2.5, 0.2)), 4),),
        material=Elastic(E=1.0, nu=0.0),
        scheme=gr.Scheme(basis="linear", dt=2e-3),
        gravity=0.0,
        duration=2.0,
    )
    sim = gr.Simulation(scene, threads=1)
    ids = sim.buffers["id"]
    at = np.flatnonzero(ids >= 0)
    sim.buffers["v"][0, at] = sim.buffers["x"][0, at] - 2.0
    sim.run(until=0.9, every=0.1)
    assert sim.health()["gaps"].verdict == "ok"
    sim.run(until=1.5, every=0.1)
    assert sim.health()["gaps"].verdict == "suspect"
