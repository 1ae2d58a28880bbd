"""Scenes that are too large for the machine are refused at once; large boxes cost nothing."""

import resource
import subprocess
import sys
import time

import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import cli
from granular.run import memory

GIB = 2**30


def box(cells, walls=()):
    """A small block in the corner of a large box with four walls, and others."""
    length = cells * 0.01
    return scene_with(
        grid=gr.Grid((0.0, 0.0), 0.01, (cells, cells)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.1, 0.1)), 4),),
        walls=(*(gr.Wall(axis, at) for axis in (0, 1) for at in (0.0, length)), *walls),
        gravity=gr.Gravity(),
    )


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("excavation", {"cell": 0.0005}),
        ("column_collapse", {"points_per_cell": 10**6}),
        ("incline", {"columns": 10**7}),
        ("silo_3d", {"cell": 0.00025}),
        ("incline_sph", {"columns": 10**6, "height": 10.0}),
    ],
)
def test_huge_scenes_are_refused_at_once(name, numbers, monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 8.0 * GIB)
    begin, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ValueError, match=r"points in .* cells needs about .* GB .* force=True"):
        gr.Simulation(gr.scenes.registry[name](**numbers))
    assert time.perf_counter() - begin < 1.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100 * 1024  # KiB


def test_force_tries_it_all_the_same(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(memory, "available_memory", lambda: 60.0 * 2**20)
    with pytest.raises(ValueError, match=r"needs about .* must be at most the 0.059 GB"):
        gr.Simulation(box(20))
    assert gr.Simulation(box(20), force=True).n_points == 400
    with pytest.raises(TypeError, match="force = 1"):
        gr.Simulation(box(20), force=1)
    words = ["run", "column_collapse", "--cell", "0.05", "--E", "1e5", "--until", "1e-3"]
    words += ["--quiet", "-o", str(tmp_path / "a.h5")]
    assert cli.main(words) == 2
    assert "needs about" in capsys.readouterr().err
    assert cli.main([*words, "--force"]) == 0


def staircase(cells):
    """The box with frictionless steps beside the material, of one row of cells each."""
    rows = [(0.1 + 0.01 * (j // 3), 0.01 * j) for j in range(10)]
    blocks = [gr.Solid((x, y), (cells * 0.01, y + 0.01), kind="free_slip") for x, y in rows]
    return box(cells, blocks)


def half_solid(cells):
    """The box with a block beside the material, from the floor to the top."""
    return box(cells, [gr.Solid((0.1, 0.0), (cells * 0.01, cells * 0.01), kind="free_slip")])


LARGE_BOXES = """
import resource
import numpy as np
from test_robustness_huge_scenes import box, half_solid, staircase
import granular as gr
def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
def outcomes(cells):
    alone = gr.Simulation(box(cells), threads=1).run(0.002, every=1e-3)
    in_a_rock = gr.Simulation(half_solid(cells), threads=1).run(0.03, every=1e-2)
    on_steps = gr.Simulation(staircase(cells), threads=1, wall_forces=True).run(0.03, every=1e-2)
    impulses = np.array([wall.impulse for wall in on_steps.walls])
    assert abs(impulses[4:]).sum() > 0
    health = [sim.health()["courant"].value for sim in (alone, in_a_rock, on_steps)]
    positions = [sim.state.x for sim in (alone, in_a_rock, on_steps)]
    return *positions, impulses, health, on_steps.health()["in_solids"].value
small = outcomes(40)
before = peak()
large = outcomes(20_000)
for one, other in zip(small, large):
    np.testing.assert_array_equal(one, other)
print(peak() - before)
"""


def test_a_large_box_costs_nothing():
    """20,000 x 20,000 cells with 400 points, in a process of its own: less than 60 MB more.

    Neither do blocks, the impulses on the walls, and the indicators of failure.
    """
    paths = [__file__.rpartition("/")[0], *sys.path]
    run = [sys.executable, "-c", f"import sys; sys.path[:0] = {paths!r}\n" + LARGE_BOXES]
    found = subprocess.run(run, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stderr
    assert int(found.stdout) < 60 * 1024


def test_available_memory_is_that_of_the_machine_or_less():
    found = memory.available_memory()
    assert 0 < found
    limit = resource.getrlimit(resource.RLIMIT_AS)
    try:
        resource.setrlimit(resource.RLIMIT_AS, (2**45, limit[1]))
        assert memory.available_memory() <= found * 1.5
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limit)


DISC = "gr.Sphere(0.49, center=(0.5, 0.5))"


def block(dim, shape, per_axis, scheme, region=None):
    """Expression of a scene that is full of material, or filled in a region."""
    region = region or f"gr.Box((0.0,) * {dim}, tuple(0.01 * n for n in {shape}))"
    return f"""gr.Scene(
    name="block", grid=gr.Grid((0.0,) * {dim}, 0.01, {shape}),
    fills=(gr.Fill({region}, {per_axis**dim}),),
    material=gr.MuI(E=1e6), scheme=gr.schemes.{scheme},
    gravity=gr.Gravity((0.0,), ((0.0,) * {dim},)), duration=1.0,
)"""


@pytest.mark.parametrize(
    "scene",
    [
        block(2, (80, 80), 4, "default"),
        block(3, (24, 24, 24), 2, "cell_averaged"),
        block(2, (100, 100), 4, "default", DISC),  # a region that cuts squares loads parts of SciPy
        "gr.scenes.excavation(cell=0.025)",  # so does a body; the pressure of a weight above
    ],
)
def test_the_estimated_memory_is_that_of_the_run(scene):
    """Not below the peak of a recorded run, nor 1.3 times that of steps alone.

    It was 1.35 and 1.84 times the peak of these steps, so that runs that fit were refused.
    """
    code = f"""
import tempfile
import granular as gr
def peak():  # in getrusage that of the process that began this one counts, too
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmHWM"))
scene = {scene}
sim = gr.Simulation(scene, threads=1)
sim.step(2)
stepped = peak()
with tempfile.TemporaryDirectory() as folder:
    sim.run(until=sim.time + 2.5 * sim.dt, save=folder + "/a.h5", every=sim.dt)
recorded = peak()
print(gr.economy.cost(scene).memory / stepped, gr.economy.cost(scene).memory / recorded)
"""
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr
    to_stepped, to_recorded = map(float, found.stdout.split())
    assert 1.0 < to_recorded < to_stepped < 1.3
