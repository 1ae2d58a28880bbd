"""Wrong arguments to the SPH gas are refused, in Python and in the core."""

import math

import numpy as np
import pytest

from granular import _core, scenes, sph
from granular.geometry import Box, Fill, Grid
from granular.sph.simulation import _build

SOIL = scenes.jet_on_bed(spacing=0.025, nozzle=0.05, width=0.2, depth=0.1, headroom=0.1)
BOX = Fill(Box((0.0, 0.0), (0.2, 0.2)), 1)


def with_gas(fill=BOX, **gas):
    return SOIL.replace(gas=sph.Gas(fills=(fill,), **gas))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        *(
            (lambda name=name, value=value: sph.Gas(fills=(BOX,), **{name: value}), f"{name} = ")
            for name in ("permeability", "viscosity", "pressure", "sound_speed", "grain_density")
            for value in (0.0, -1.0, math.nan, math.inf)
        ),
        (lambda: sph.Gas(fills=(BOX,), darcy_porosity=1.0), "darcy_porosity = 1"),
        (lambda: sph.Gas(fills=(BOX,), darcy_porosity=0.0), "darcy_porosity = 0"),
        (lambda: sph.Gas(fills=(BOX,), blend=0.0), "blend = 0"),
        (lambda: sph.Gas(fills=(BOX,), damping=-1.0), "damping = -1"),
        (lambda: sph.Gas(fills=(BOX,), diffusion=1.0), "diffusion = 1"),
        (lambda: sph.Gas(fills=(BOX,), diameter=0.0), "diameter = 0"),
        (lambda: sph.Gas(fills=()), "fills = "),
        (lambda: sph.Gas(fills="x"), "fills = 'x'"),
        (lambda: sph.Gas(fills=(BOX,), jets=(1,)), r"jets\[0\] = 1"),
        (lambda: sph.Jet(BOX, (0.0, 1.0)), "region = "),
        (lambda: sph.Jet(BOX.region, (0.0, 1.0, 2.0)), "velocity"),
        (lambda: with_gas(grain_density=1500.0), "grain_density = 1500.0 must exceed rho0 = 1600"),
        (lambda: with_gas(Fill(BOX.region, 4)), r"fills\[0\]: the smoothing length"),
        (lambda: with_gas(Fill(Box((0.0, 0.0), (9.0, 0.1)), 1)), r"gas.fills\[0\]"),
        (
            lambda: with_gas(jets=(sph.Jet(Box((0.0, 0.0), (9.0, 0.1)), (0.0, 1.0)),)),
            r"gas.jets\[0\]",
        ),
        (lambda: SOIL.replace(gas=1), "gas = 1 must be a Gas"),
        (lambda: SOIL.replace(numerics=sph.Numerics(dt=1e-3)), r"dt = 0.001 must be at most"),
        (lambda: sph.Wall(1, 0.0, 1, permeable=1), "permeable = 1"),
        (lambda: scenes.jet_on_bed(speed=300.0), "speed = 300"),
        (lambda: scenes.jet_on_bed(nozzle=1.0), "nozzle = 1"),
        (lambda: scenes.jet_on_bed(pressure=0.0), "pressure = 0"),
        (lambda: scenes.fluidised_bed(velocity=1.0), "velocity = 1"),
    ],
)
def test_wrong_arguments_are_named(change, words):
    with pytest.raises((TypeError, ValueError), match=words):
        change()


def core_arguments(monkeypatch):
    taken = {}
    monkeypatch.setattr(_core, "Sph", lambda **k: taken.update(k))
    _build(SOIL, "")
    monkeypatch.undo()
    return taken


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
    taken = core_arguments(monkeypatch)
    if isinstance(gas, tuple) and gas and gas[0] is None:
        gas = (taken["gas"][0], gas[1])
    with pytest.raises((TypeError, ValueError)):
        _core.Sph(**(taken | {"gas": gas}))


@pytest.mark.parametrize("name", ["permeability", "viscosity", "sound_speed", "wall_volume"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_core_refuses_wrong_numbers(name, value, monkeypatch):
    taken = core_arguments(monkeypatch)
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
    for name in ("x", "v", "mass", "rho"):
        assert np.array_equal(getattr(simulation.gas, name), getattr(again.gas, name)), name
