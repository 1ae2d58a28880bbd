"""Wrong arguments to SPH and its gas raise exceptions that name them; no crash."""

import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spoiled import DOCUMENTED, QUICK

from granular import Box, Fill, Gravity, Grid, Simulation, _core, scenes, sph
from granular.run.machine import Machine
from granular.sph.simulation import _build
from granular.sph.walls import ParticleWall

SCENE = scenes.incline_sph(height=0.04, columns=6)
SOIL = scenes.jet_on_bed(spacing=0.025, nozzle=0.05, width=0.2, depth=0.1, headroom=0.1)
BOX = Fill(Box((0.0, 0.0), (0.2, 0.2)), 1)


def gas_of(**changes):
    return sph.Gas(**({"fills": (BOX,)} | changes))


def with_gas(**changes):
    return SOIL.replace(gas=gas_of(**changes))


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
        (lambda: sph.ParticleWall(0, 0.0, 0), "side = 0 must be one of"),
        (lambda: sph.ParticleWall(0, math.nan, 1), "at = nan"),
        (
            lambda: SCENE.replace(walls=(sph.ParticleWall(1, 0.0, 1, layers=2),)),
            r"walls\[0\].layers = 2 must be at least 3",
        ),
        (lambda: SCENE.replace(walls=(sph.ParticleWall(0, 0.0, 1),)), "must not be a periodic one"),
        (
            lambda: SCENE.replace(walls=(sph.ParticleWall(1, 0.0033, 1),)),
            r"walls\[0\].at = 0\.0033",
        ),
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
        (lambda: sph.Simulation(SCENE).run(-1.0, monitor=False), "until = -1"),
        *(
            (lambda name=name, value=value: gas_of(**{name: value}), f"{name} = ")
            for name in ("permeability", "viscosity", "pressure", "sound_speed", "grain_density")
            for value in (0.0, -1.0, math.nan, math.inf)
        ),
        (lambda: gas_of(darcy_porosity=1.0), "darcy_porosity = 1"),
        (lambda: gas_of(darcy_porosity=0.0), "darcy_porosity = 0"),
        (lambda: gas_of(blend=0.0), "blend = 0"),
        (lambda: gas_of(damping=-1.0), "damping = -1"),
        (lambda: gas_of(diffusion=1.0), "diffusion = 1"),
        (lambda: gas_of(diameter=0.0), "diameter = 0"),
        (lambda: gas_of(fills=()), "fills = "),
        (lambda: gas_of(fills="x"), "fills = 'x'"),
        (lambda: gas_of(jets=(1,)), r"jets\[0\] = 1"),
        (lambda: sph.Jet(BOX, (0.0, 1.0)), "region = "),
        (lambda: sph.Jet(BOX.region, (0.0, 1.0, 2.0)), "velocity"),
        (lambda: with_gas(grain_density=1500.0), "grain_density = 1500.0 must exceed rho0 = 1600"),
        (lambda: with_gas(fills=(Fill(BOX.region, 4),)), r"fills\[0\]: the smoothing length"),
        (lambda: with_gas(fills=(Fill(Box((0.0, 0.0), (9.0, 0.1)), 1),)), r"gas.fills\[0\]"),
        (
            lambda: with_gas(jets=(sph.Jet(Box((0.0, 0.0), (9.0, 0.1)), (0.0, 1.0)),)),
            r"gas.jets\[0\]",
        ),
        (lambda: SOIL.replace(gas=1), "gas = 1 must be a Gas"),
        (lambda: SOIL.replace(numerics=sph.Numerics(dt=1e-3)), r"dt = 0.001 must be at most"),
        (lambda: sph.ParticleWall(1, 0.0, 1, permeable=1), "permeable = 1"),
        (lambda: scenes.jet_on_bed(speed=300.0), "speed = 300"),
        (lambda: scenes.jet_on_bed(nozzle=1.0), "nozzle = 1"),
        (lambda: scenes.jet_on_bed(pressure=0.0), "pressure = 0"),
        (lambda: scenes.fluidised_bed(velocity=1.0), "velocity = 1"),
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
        sph.Simulation._restored(SCENE, other.checkpoint(), Machine())


def test_checkpoint_of_another_scene_is_refused():
    checkpoint = sph.Simulation(SCENE).checkpoint()
    with pytest.raises(ValueError, match="does not hold"):
        sph.Simulation.from_checkpoint(
            scenes.incline_sph(height=0.04, columns=6, columns_across=5), checkpoint
        )


def test_engine_without_points_does_not_step():
    engine = _build(SCENE, Machine())
    with pytest.raises(RuntimeError, match="call bind first"):
        engine.advance(1, 1.0, 1)


NUMBERS = st.sampled_from([math.nan, math.inf, -math.inf, 0.0, -1.0, 1e300, -1e300, 5e-324, 1e30])


@QUICK
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


@QUICK
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
    engine = _build(SCENE, Machine())
    try:
        engine.bind(buffers, *counts, True)
        assert spoil == "none"
        engine.advance(2, math.inf, 1)
    except DOCUMENTED:
        pass


def core_arguments(scene, monkeypatch):
    """Arguments with which the engine of this scene is built."""
    taken = {}
    monkeypatch.setattr(_core, "Sph", lambda **k: taken.update(k))
    _build(scene, Machine())
    monkeypatch.undo()
    return taken


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
    with pytest.raises((TypeError, ValueError)):
        _core.Sph(**(core_arguments(SCENE, monkeypatch) | change))


# ---- gas ----


@pytest.mark.parametrize(
    "gas",
    [
        1,
        (),
        ({}, np.zeros((0, 6))),
        ("text", np.zeros((0, 6))),
        (None, np.zeros((1, 5))),
        (None, np.zeros((17, 6))),
        (None, np.full((1, 6), math.nan)),
        (None, np.zeros((1, 6), dtype=np.float32)),
        (None, "jets"),
    ],
)
def test_core_refuses_a_wrong_gas(gas, monkeypatch):
    taken = core_arguments(SOIL, monkeypatch)
    if isinstance(gas, tuple) and gas and gas[0] is None:
        gas = (taken["gas"][0], gas[1])
    with pytest.raises((TypeError, ValueError)):
        _core.Sph(**(taken | {"gas": gas}))


@pytest.mark.parametrize("name", ["permeability", "viscosity", "sound_speed", "wall_volume"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_core_refuses_wrong_numbers(name, value, monkeypatch):
    taken = core_arguments(SOIL, monkeypatch)
    parameters, jets = taken["gas"]
    with pytest.raises(ValueError, match=name):
        _core.Sph(**(taken | {"gas": (parameters | {name: value}, jets)}))


@pytest.mark.parametrize("rows", [(0, 5), (40, 5), (10**9, 5), (-1, 5), (64, -1), (64, 10**9)])
def test_core_refuses_rows_that_do_not_fit(rows):
    simulation = sph.Simulation(SOIL)
    own = simulation._rows
    with pytest.raises(ValueError, match="points of gas from row"):
        simulation._engine.bind(
            simulation.buffers, own.grains, own.wall_first, own.walls, True, *rows
        )


@pytest.mark.parametrize("field", ["x", "v", "mass", "rho", "porosity"])
@pytest.mark.parametrize("value", [math.nan, math.inf, 1e300, -1.0, 0.0])
def test_any_number_of_the_gas_is_survived(field, value):
    """The core stops with an error or continues with any value; it does not crash."""
    simulation = sph.Simulation(SOIL)
    simulation.step(1)
    simulation.buffers[field][0, simulation._rows.gas_first + 3] = value
    try:
        simulation.step(3)
        simulation.step(3)
    except _core.SimulationError:
        pass


@pytest.mark.parametrize(
    ("numbers", "name"),
    [
        ({"sound_speed": 10.0}, r"pressure/sound_speed\^2 = 1000 kg/m3"),
        ({"pressure": 2.2e9, "sound_speed": 1480.0}, r"pressure/sound_speed\^2"),
        ({"viscosity": 1e-3}, "viscosity = 0.001 Pa s"),
        ({"fills": (Fill(Box((0.0, 0.0), (1.0, 1.0)), 4, density=1000.0),)}, r"fills\[0\].density"),
    ],
)
def test_the_numbers_of_a_liquid_are_refused(numbers, name):
    """Water, by its density, its stiffness, its viscosity, and the density of a fill and a jet."""
    parts = {"fills": (Fill(Box((0.0, 0.0), (1.0, 1.0)), 4),)} | numbers
    with pytest.raises(ValueError, match=f"{name}.*this is a liquid"):
        sph.Gas(**parts)
    with pytest.raises(ValueError, match=r"density = 1000 kg/m3.*this is a liquid"):
        sph.Jet(Box((0.0, 0.0), (1.0, 1.0)), (0.0, -1.0), density=1000.0)


def test_checkpoint_without_its_gas_is_refused():
    checkpoint = sph.Simulation(SOIL).checkpoint()
    with pytest.raises(ValueError, match="n_gas"):
        sph.Simulation.from_checkpoint(SOIL.replace(gas=None), checkpoint)


def test_grid_of_another_dimension_is_refused():
    grid = Grid((0.0,) * 3, 0.025, (8, 8, 8))
    with pytest.raises((TypeError, ValueError)):
        SOIL.replace(grid=grid)


def test_record_goes_on_with_its_gas(tmp_path):
    """The checkpoints of a record hold the gas to the last bit."""
    simulation = sph.Simulation(SOIL)
    simulation.run(0.002, save=tmp_path / "run.h5", every=0.001)
    again = sph.Simulation.resume(tmp_path / "run.h5")
    assert again.scene == SOIL
    for each in (simulation, again):
        each.step(20)
    for name in ("x", "v", "mass", "density"):
        assert np.array_equal(getattr(simulation.gas, name), getattr(again.gas, name)), name


def test_walls_that_reach_far_outside_cost_nothing():
    """The same bits as of a short one; without motion no particles more, with it a linear time.

    The cells at the ends of the grid held all of the far ones, each of which looked at all others:
    200 times the domain took 12 s, now 0.3 s.
    """
    scene = scenes.column_collapse_sph()
    length = scene.grid.shape[0] * scene.grid.cell

    def run(times, speed):
        moving = {"velocity": (speed, 0.0)} if speed else {}
        span = ((-times * length, (1 + times) * length),)
        floor = ParticleWall(1, 0.0, 1, span=span, **moving)
        made = scene.replace(walls=(floor, *scene.walls[1:]))
        sim = Simulation(made, threads=1)
        sim.step(20)
        return len(made.wall_points()["x"]), sim.state.x

    count, x = run(3, 0.0)
    far_count, far_x = run(10_000, 0.0)
    assert far_count == count and np.array_equal(far_x, x)
    count, x = run(3, 0.1)
    begin = time.perf_counter()
    far_count, far_x = run(200, 0.1)
    assert time.perf_counter() - begin < 4.0
    assert far_count > 40 * count and np.array_equal(far_x, x)
