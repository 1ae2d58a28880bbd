"""Checkpoints with numbers that no run has, from an object or a file: refused by name, or survived.

The fuzz runs in a process of its own: the core must not crash, whatever a file holds.
"""

import random
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import inlets
import numpy as np
import pytest
from inlets import fed_gas, stream
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Box, sph
from granular.mpm.bodies import mass_properties
from granular.record import RecordError, TrajectoryWriter
from granular.record.restart import read_restart, write_restart

FLOATS = (np.inf, -np.inf, np.nan, 0.0, -1.0, 1e300, -1e300, 1e59, 1e20, 5e-324, 2.0**63)
INTEGERS = (0, -1, 1, 5, 2**31, -(2**31), 2**32, 2**62, 2**63 - 1, -(2**63))
FACTORS = (1e3, -1.0, 1e-3, 1e10, 1 + 1e-6)


def choked():
    region = gr.Box((0.1, 0.16), (0.3, 0.2))
    return stream(
        gravity=9.81,
        grid=gr.Grid((0.0, 0.0), inlets.CELL, (20, 14)),
        walls=(gr.Wall(1, 0.0), gr.Wall(0, 0.0), gr.Wall(0, 0.4)),
        inflows=[gr.Inflow(region, (0.0, -1.0), 4)],
        scheme=gr.Scheme(sleep_speed=1e-2),
    )


def bed(*walls, bodies=()):
    return scene_with(
        grid=gr.Grid((0.0, 0.0), 0.1, (6, 8)),
        fills=[gr.Fill(gr.Box((0.0, 0.0), (0.6, 0.4)), 4)],
        material=gr.MuI(E=1e5),
        walls=[gr.Wall(0, 0.0), gr.Wall(0, 0.6), gr.Wall(1, 0.0), *walls],
        bodies=bodies,
    )


def with_block():
    """A block that falls on a bed."""
    shape = Box(size=(0.3, 0.3))
    whole = mass_properties(shape, 1500.0)
    return bed(bodies=[Body(shape, (0.3, 0.56), free="xy", mass=whole.mass, inertia=whole.inertia)])


SCENES = {
    "choked": (choked, 40),
    "pressed": (lambda: bed(gr.Wall(1, 0.8, pressure=100.0)), 10),
    "block": (with_block, 10),
    "bed": (bed, 10),
    "sph": (fed_gas, 10),
}


def start_of(name):
    make, steps = SCENES[name]
    scene = make()
    sim = gr.Simulation(scene, threads=1)
    sim.step(steps)
    return scene, sim.checkpoint()


def spoil(array, chance):
    """Replace or change some numbers of an array."""
    flat = array.reshape(-1)
    some = range(flat.size) if chance.random() < 0.3 else [chance.randrange(flat.size)]
    value, factor = chance.choice(FLOATS), chance.choice(FACTORS)
    for k in some:
        if array.dtype.kind == "i":
            flat[k] = chance.choice(INTEGERS)
        else:
            flat[k] = value if chance.random() < 0.6 else flat[k] * factor


def mutant(point, chance):
    """A checkpoint with some wrong numbers; those of the clock are wrong in both places."""
    scalars, clock = dict(point.scalars), {}
    arrays = {name: array.copy() for name, array in point.arrays.items()}
    for _ in range(chance.choice((1, 1, 2))):
        if chance.random() < 0.5:
            name = chance.choice(list(scalars))
            values = INTEGERS if isinstance(scalars[name], int) else FLOATS
            scalars[name] = chance.choice(values)
            if name in ("time", "step", "dt"):
                clock[name] = scalars[name]
        else:
            spoil(chance.choice([array for array in arrays.values() if array.size]), chance)
    return replace(point, scalars=scalars, arrays=arrays, **clock)


def fuzz(count, folder):
    chance, starts = random.Random(10), [start_of(name) for name in SCENES]
    counts = {"refused": 0, "failed": 0, "fine": 0}
    for k in range(count):
        scene, point = starts[k % len(starts)]
        point = mutant(point, chance)
        if k % 4 == 0:
            write_restart(folder / "a.restart", point)
            point = read_restart(folder / "a.restart")
        try:
            sim = gr.Simulation.from_checkpoint(scene, point, threads=1)
        except ValueError:
            counts["refused"] += 1
            continue
        try:
            sim.step(2)
            sim.checkpoint()
        except gr.SimulationError:
            counts["failed"] += 1
        else:
            counts["fine"] += 1
    print(*counts.values())


@pytest.mark.parametrize("count", [150, pytest.param(5000, marks=pytest.mark.slow)])
def test_mutants_are_refused_or_survived(tmp_path, count):
    """Nothing but ValueError, or SimulationError in a step, and no crash; in no time."""
    program = (
        f"import sys; sys.path[:0] = {[str(Path(__file__).parent), *sys.path]!r}\n"
        f"import pathlib, warnings; warnings.simplefilter('ignore')\n"
        f"from test_robustness_checkpoint_numbers import fuzz\n"
        f"fuzz({count}, pathlib.Path({str(tmp_path)!r}))"
    )
    run = [sys.executable, "-c", program]
    done = subprocess.run(run, capture_output=True, text=True, timeout=60 + count)
    assert done.returncode == 0, done.stderr[-2000:]
    refused, failed, fine = map(int, done.stdout.split())
    assert refused > 0.5 * count and failed + fine > 0.1 * count


@pytest.mark.parametrize(
    ("name", "numbers", "message"),
    [
        ("choked", {"dt": np.inf}, "dt of the checkpoint = inf must be a finite number"),
        ("choked", {"dt": 1.0}, r"dt = 1 must be from 0 to 0\.000"),
        ("choked", {"time": -1e30}, r"time = -1e\+30 must be from 0"),
        ("bed", {"time": 1e30}, "must be one that a step of .* s changes"),
        ("bed", {"step": 2**63 - 1}, "step of the checkpoint = 9223372036854775807 must be"),
        ("bed", {"shift_dt": 0.0}, "shift_dt = 0 must be from"),
        ("bed", {"mean_mass": -1.0}, "mean_mass of the checkpoint = -1.0 must be"),
        ("bed", {"mass": -1.0}, r"mass\[0, 0\] = -1\.0 of the checkpoint must be from 0"),
        ("bed", {"x": 1e30}, "lies outside the grid"),
        ("bed", {"id": 2**62 + 1}, "ids of the checkpoint must be distinct"),
        ("block", {"bodies": 2.0}, "unit quaternion"),
        ("pressed", {"walls": np.nan}, r"walls\[0, 0\] = nan of the checkpoint"),
        ("sph", {"n_points": 2**62}, "must hold n_points = 4611686018427387904"),
        ("sph", {"speed2": np.inf}, "speed2 of the checkpoint = inf"),
        ("sph", {"rho": 0.0}, r"rho\[0, 0\] = 0\.0 of the checkpoint must be from 2"),
    ],
)
def test_the_number_is_named(tmp_path, name, numbers, message):
    """In an object as in a file, where the error is that of the file."""
    scene, point = start_of(name)
    ((which, value),) = numbers.items()
    if which in point.scalars:
        clock = numbers if which in ("time", "step", "dt") else {}
        point = replace(point, scalars=dict(point.scalars) | numbers, **clock)
    else:
        arrays = {name: array.copy() for name, array in point.arrays.items()}
        arrays[which][...] = value
        point = replace(point, arrays=arrays)
    with pytest.raises(ValueError, match=message):
        gr.Simulation.from_checkpoint(scene, point)
    path = tmp_path / "a.h5"
    with TrajectoryWriter(path, scene, provenance={"isa": ""}) as writer:
        writer.checkpoint(point)
    with pytest.raises(RecordError, match=message):
        gr.Simulation.resume(path, isa="")


def test_what_is_no_checkpoint_is_refused():
    scene, point = start_of("bed")
    with pytest.raises(TypeError, match="checkpoint must be a Checkpoint"):
        gr.Simulation.from_checkpoint(scene, point.arrays)
    scalars = dict(point.scalars) | {"dropped": 0.0}
    with pytest.raises(TypeError, match="the scalar dropped must be an int, not float"):
        gr.Simulation.from_checkpoint(scene, replace(point, scalars=scalars))
    with pytest.raises(ValueError, match="as in its scalars"):
        gr.Simulation.from_checkpoint(scene, replace(point, time=1.0))
    for name in ("time", "step", "dt"):
        with pytest.raises(TypeError, match=f"{name} = '1' must be an"):
            replace(point, **{name: "1"})
    with pytest.raises(TypeError, match=r"step = 1\.5 must be an int"):
        replace(point, step=1.5)


def test_sph_grows_by_what_enters_in_its_own_time_step():
    """A false speed would make the next step so long that no array could hold what enters."""
    scene, point = start_of("sph")
    scalars = dict(point.scalars) | {"speed2": 1e-300, "gas_speed2": 0.0}
    sim = sph.Simulation.from_checkpoint(scene, replace(point, scalars=scalars), threads=1)
    sim.step(2)
    assert sim.time - point.time < 4 * point.dt
