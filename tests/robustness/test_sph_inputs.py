"""Wrong arguments to SPH raise exceptions that name them; no crash."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from granular import _core, scenes, sph
from granular.geometry import Box, Fill
from granular.gravity import Gravity
from granular.sph.simulation import _build

SCENE = scenes.incline_sph(height=0.04, columns=6)
DOCUMENTED = (TypeError, ValueError, OverflowError, RuntimeError, MemoryError)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda: sph.Viscoplastic(rho0=0.0), r"rho0 = 0\.0 must be a finite number > 0"),
        (lambda: sph.Viscoplastic(rho0=-1550.0), "rho0 = -1550"),
        (lambda: sph.Viscoplastic(mu_l=-0.1), r"mu_l = -0\.1"),
        (lambda: sph.Viscoplastic(D_star=0.0), "D_star"),
        (lambda: sph.Viscoplastic(dilation=2.0), r"dilation = 2\.0 must be in \[0\.0, 1\.0\]"),
        (lambda: sph.Viscoplastic(nu=0.6), r"nu = 0\.6 must be in \[0\.0, 0\.5\]"),
        (lambda: sph.Viscoplastic(nu=math.nan), "nu = nan"),
        (lambda: sph.Numerics(wall_density=0.5), r"wall_density = 0\.5 must be in \[0\.9, 1\.0\]"),
        (lambda: sph.Numerics(z_max=0.5), r"z_max = 0\.5 must be in \[1\.0, 2\.0\]"),
        (lambda: sph.Numerics(smoothing=0.5), r"smoothing = 0\.5 must be in \[1\.0, 2\.0\]"),
        (lambda: sph.Numerics(regularisation=2.0), "regularisation"),
        (lambda: sph.Numerics(dt=-1.0), "dt = -1"),
        (lambda: sph.Wall(0, 0.0, 0), "side = 0 must be one of"),
        (lambda: sph.Wall(0, math.nan, 1), "at = nan"),
        (
            lambda: SCENE.replace(walls=(sph.Wall(1, 0.0, 1, layers=2),)),
            r"walls\[0\].layers = 2 must be at least 3",
        ),
        (lambda: SCENE.replace(walls=(sph.Wall(0, 0.0, 1),)), "must not be a periodic one"),
        (lambda: SCENE.replace(walls=(sph.Wall(1, 0.0033, 1),)), r"walls\[0\].at = 0\.0033"),
        (lambda: SCENE.replace(numerics=sph.Numerics(dt=0.01)), r"dt = 0\.01 must be at most"),
        (
            lambda: SCENE.replace(fills=(Fill(Box((0.0, 0.0), (0.06, 0.04)), 4),)),
            "points_per_cell = 4 must be 1",
        ),
        (lambda: SCENE.replace(gravity=Gravity((0.0,), ((0.0, 0.0, -9.8),))), "dimension 3"),
        (lambda: SCENE.replace(material=None), "material = None"),
        (lambda: SCENE.replace(duration=0.0), "duration"),
        (lambda: scenes.incline_sph(columns=2), "the period 0.02 of x must exceed"),
        (lambda: sph.Simulation(None), "scene = None"),
        (lambda: sph.Simulation(SCENE, threads=0), "threads = 0"),
        (lambda: sph.Simulation(SCENE, isa="mmx"), "mmx"),
        (lambda: sph.Simulation(SCENE).step(-1), "n = -1"),
        (lambda: sph.Simulation(SCENE).run(-1.0), "until = -1"),
    ],
)
def test_wrong_arguments_are_named(change, words):
    with pytest.raises((TypeError, ValueError), match=words):
        change()


def test_elastic_particles_need_their_elastic_stress():
    """Elastic particles need a stress buffer, also in a checkpoint; others have none."""
    simulation = sph.Simulation(SCENE)
    buffers, rows = simulation.buffers, simulation._rows
    del buffers["elastic_stress"]
    with pytest.raises(ValueError, match="the buffer elastic_stress is missing"):
        simulation._engine.bind(buffers, rows.grains, rows.wall_first, rows.walls, True)
    without = SCENE.replace(material=SCENE.material.replace(nu=0.5))
    other = sph.Simulation(without)
    assert "elastic_stress" not in other.buffers
    with pytest.raises(ValueError, match="does not hold elastic_stress"):
        sph.Simulation._restored(SCENE, other.checkpoint(), None, None)


def test_checkpoint_of_another_scene_is_refused():
    checkpoint = sph.Simulation(SCENE).checkpoint()
    with pytest.raises(ValueError, match="does not hold"):
        sph.Simulation.from_checkpoint(
            scenes.incline_sph(height=0.04, columns=6, columns_across=5), checkpoint
        )


def test_engine_without_points_does_not_step():
    engine = _build(SCENE, "")
    with pytest.raises(RuntimeError, match="call bind first"):
        engine.advance(1, 1.0, 1)


NUMBERS = st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -1.0, 1e300, -1e300, 5e-324, 1e30])


@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
@given(
    field=st.sampled_from(["x", "v", "a", "anchor", "normal", "depth", "mass", "rho", "stress"]),
    place=st.integers(0, 70),
    value=NUMBERS,
    fresh=st.booleans(),
)
def test_any_number_in_the_buffers_is_survived(field, place, value, fresh):
    """The core stops with an error or continues with any value; it does not crash."""
    simulation = sph.Simulation(SCENE)
    simulation.step(1)
    simulation.buffers[field][0, place] = value
    try:
        if fresh:
            simulation._bind(simulation._rows, fresh=fresh)
        simulation.step(3)
        simulation.step(3)
    except DOCUMENTED:
        pass


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    counts=st.tuples(*[st.integers(-3, 90)] * 3),
    spoil=st.sampled_from(
        ["none", "float32", "short", "missing", "overlapping", "read-only", "text"]
    ),
    name=st.sampled_from(["x", "mass", "stress", "id"]),
)
def test_any_binding_is_refused_or_works(counts, spoil, name):
    simulation = sph.Simulation(SCENE)
    buffers = {k: v.copy() for k, v in simulation.buffers.items()}
    if spoil == "float32":
        buffers[name] = buffers[name].astype(np.float32)
    elif spoil == "short":
        buffers[name] = buffers[name][..., :-1].copy()
    elif spoil == "missing":
        del buffers[name]
    elif spoil == "overlapping":
        buffers["v"] = buffers["x"]
    elif spoil == "read-only":
        buffers[name].flags.writeable = False
    elif spoil == "text":
        buffers[name] = "array"
    engine = _build(SCENE, "")
    try:
        engine.bind(buffers, *counts, True)
        assert spoil == "none"
        engine.advance(2, math.inf, 1)
    except DOCUMENTED:
        pass


@pytest.mark.parametrize(
    "change",
    [
        {"dim": 4},
        {"lower": (0.0,)},
        {"upper": (-1.0, 1.0)},
        {"upper": (math.nan, 1.0)},
        {"periodic": "xy"},
        {"isa": "mmx"},
        {"parameters": {}},
        {"gravity_times": np.zeros(0), "gravity_vectors": np.zeros((0, 2))},
        {"gravity_times": np.array([1.0, 0.0]), "gravity_vectors": np.zeros((2, 2))},
        {"upper": (1e9, 1e9)},
        {"upper": (0.01, 1.0), "periodic": (True, False)},
    ],
)
def test_core_refuses_wrong_configurations(change, monkeypatch):
    taken = {}
    monkeypatch.setattr(_core, "Sph", lambda **k: taken.update(k))
    _build(SCENE, "")
    monkeypatch.undo()
    with pytest.raises((TypeError, ValueError)):
        _core.Sph(**(taken | change))
