"""Material at rest that is not computed (`sleep_speed`): what it changes and what wakes it."""

from dataclasses import replace

import numpy as np
import pytest
from same_bits import bits
from scenes_by_hand import sleeping_bed

import granular as gr

CELL = 0.02
SPEED = 2e-3
COMBINATIONS = [
    ("quadratic", "tpic", "smoothed"),
    ("linear", "tpic", "cell_averaged"),
    ("quadratic", "tpic", "particle"),
    ("linear", "flip", "particle"),
]


def asleep(sim):
    """Share of the points that have no velocity at all: no point that is computed has none."""
    return float((sim.state.v == 0).all(axis=1).mean())


@pytest.mark.parametrize(
    ("combination", "dim"), [*((names, 2) for names in COMBINATIONS), (COMBINATIONS[0], 3)]
)
def test_threads_and_restarts_give_the_same_bits(combination, dim):
    """The bed sleeps when the block strikes it, wakes about the place, and sleeps again."""
    scene = sleeping_bed(combination, dim=dim, height=0.45, top=0.6)
    one, other = (gr.Simulation(scene, threads=threads) for threads in (1, 3))
    shares = []
    for _ in range(12):
        one.step(150)
        other.step(150)
        assert bits(other) == bits(one)
        shares.append(asleep(one))
        other = gr.Simulation.from_checkpoint(scene, other.checkpoint(), threads=2)
    assert max(shares) > 0.2


@pytest.mark.parametrize("combination", COMBINATIONS[:2], ids="-".join)
def test_the_heap_is_that_without_sleep(combination):
    """A block falls on the bed; both runs end with the same heap, of which one sleeps.

    Material that sleeps misses motion that is slower than the limit, 3 mm in 1.5 s at most.
    Measured with the default and cell-averaged schemes: the mean height of the points differs by
    0.006 and 0.08 mm, the highest point by 0.005 and 1.4 mm, the sum of pressures by 0.4 and 2.3 %.
    """
    ends = []
    for speed in (SPEED, 0.0):
        sim = gr.Simulation(sleeping_bed(combination, speed), threads=1)
        sim.run(until=1.5, monitor=False)
        ends.append(sim)
    slept, whole = ends
    assert asleep(slept) > 0.75
    assert asleep(whole) == 0
    y, reference = slept.state.x[:, 1], whole.state.x[:, 1]
    assert abs(y.mean() - reference.mean()) < 0.01 * CELL
    assert abs(y.max() - reference.max()) < 0.1 * CELL
    p, q = slept.state.pressure, whole.state.pressure
    assert np.abs(np.sum(p - q)) < 0.03 * q.sum()


def test_gravity_that_turns_wakes_a_bed():
    """A bed at rest sleeps; once gravity leans by 35 deg it slides as one that never slept.

    By 2e-4 of the way, as starts differ whose points are elsewhere by 1e-4 of their spacing.
    """
    leans = 9.8 * np.array([np.sin(np.radians(35)), -np.cos(np.radians(35))])
    turning = gr.Gravity(times=(0.0, 0.5, 0.6), vectors=((0, -9.8), (0, -9.8), tuple(leans)))
    moved = {}
    for speed in (SPEED, 0.0):
        scene = sleeping_bed(COMBINATIONS[0], speed, height=0, gravity=turning)
        sim = gr.Simulation(scene, threads=1)
        start = sim.state.x[:, 0].mean()
        sim.run(until=0.49, monitor=False)
        assert asleep(sim) == (1 if speed else 0)
        sim.run(until=0.9, monitor=False)
        moved[speed] = sim.state.x[:, 0].mean() - start
    assert moved[0.0] > 0.5 * CELL
    assert moved[SPEED] == pytest.approx(moved[0.0], rel=1e-3)


def test_a_wall_that_opens_wakes_a_bed():
    scene = sleeping_bed(COMBINATIONS[0], height=0)
    side = gr.Wall(0, 0.48, kind="free_slip", opens_at=0.5)
    grid = replace(scene.grid, open_sides=frozenset({"x+"}))
    scene = scene.replace(grid=grid, walls=[scene.walls[0], side, scene.walls[2]])
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.49, monitor=False)
    assert asleep(sim) == 1
    before = sim.n_points
    sim.run(until=0.8, monitor=False)
    assert sim.n_points < 0.9 * before


def test_a_plate_that_is_pushed_into_a_bed_wakes_it():
    """The plate moves slower than the limit at first; its force is that of a run without sleep."""
    impulses = []
    for speed in (SPEED, 0.0):
        motion = gr.Motion(times=(0.4, 0.6), velocity=((0.0, 0.0), (0.0, -0.2)))
        plate = gr.Body(
            gr.shapes.Box(size=(0.1, 0.04)), position=(0.24, 0.145), motion=motion, friction=0.3
        )
        scene = sleeping_bed(COMBINATIONS[2], speed, height=0, bodies=[plate])
        sim = gr.Simulation(scene, threads=1)
        sim.run(until=0.4, monitor=False)
        assert (asleep(sim) > 0.5) == (speed > 0)  # but not the cells about the thin plate
        sim.run(until=0.9, monitor=False)
        impulses.append(sim.bodies[0].impulse[1])
    assert impulses[1] > 0
    assert impulses[0] == pytest.approx(impulses[1], rel=0.01)  # 0.2 % measured


def test_a_changed_scene_wakes_all(tmp_path):
    """A run that is resumed with less friction flows, although the heap was asleep."""
    path = tmp_path / "heap.vtkhdf"
    scene = sleeping_bed(COMBINATIONS[1], height=0)
    gr.Simulation(scene).run(0.5, save=path)
    sim = gr.Simulation.resume(path)
    assert asleep(sim) == 1
    leaning = scene.replace(gravity=gr.Gravity((0.0,), ((9.8, -9.8),)))
    sideways = gr.Simulation.resume(path, scene=leaning)
    sideways.run(until=0.6, monitor=False)
    assert asleep(sideways) == 0


def test_what_cannot_sleep_is_refused():
    with pytest.raises(ValueError, match=r"sleep_speed = 0.001 must be 0 with transfer"):
        gr.Scheme(basis="quadratic", transfer="xpic", sleep_speed=1e-3)
    with pytest.raises(ValueError, match=r"sleep_speed = -1"):
        gr.Scheme(sleep_speed=-1)
    scene = sleeping_bed(COMBINATIONS[3])
    with pytest.raises(ValueError, match=r"sleep_speed = 0.002 must be 0 for a nonlocal law"):
        scene.replace(material=gr.materials.couette_beads)
