"""Runs that fail without an error are reported by the diagnostics; sound runs are not."""

import math

import numpy as np
import pytest

import granular as gr
from granular import diagnostics
from granular.geometry import Box, Fill, Grid
from granular.gravity import Gravity
from granular.materials import Elastic
from granular.mpm import limits

BEADS = gr.materials.glass_beads.replace(E=1e6)


@pytest.fixture(autouse=True)
def often(monkeypatch):
    """Diagnostics that sample at every frame, whatever the cost."""
    monkeypatch.setattr(diagnostics, "STEPS", 1)
    monkeypatch.setattr(diagnostics, "POINT_STEPS", 0)


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


def test_a_fall_between_two_samples_creates_no_energy(monkeypatch):
    """Samples 0.5 s apart of grains that fall through an opening while gravity is switched on."""
    monkeypatch.setattr(diagnostics, "STEPS", 3000)
    sim = gr.Simulation(gr.scenes.hourglass(kind="sloped", E=1e6), threads=1).run(until=0.7)
    assert np.isfinite(sim._monitor.columns()["created"]).sum() == 1
    assert sim.health()["energy_created"].verdict == "ok", str(sim.health())


def test_slow_flow_is_ill_posed_and_reported():
    health = gr.Simulation(incline(angle_deg=21.2), threads=1).run(until=2.0, every=0.1).health()
    assert health["ill_posed"].value > 0.5
    assert health["ill_posed"].verdict == "reported"


def test_a_bar_that_is_torn_by_the_grid():
    """Four points per cell: a bar stretched to twice its length has points a cell apart."""
    scene = gr.Scene(
        name="drawn",
        grid=Grid((0.0, 0.0), 0.1, (40, 3)),
        fills=(Fill(Box((1.5, 0.1), (2.5, 0.2)), 4),),
        material=Elastic(E=1.0, nu=0.0),
        scheme=gr.Scheme(basis="linear", dt=2e-3),
        gravity=Gravity((0.0,), ((0.0, 0.0),)),
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
