"""The grouping of the points on a device: cells and slots are those of a processor."""

import numpy as np
import pytest
from oracle_fluidity import available
from same_bits import bits
from scenes_by_hand import two_clouds

import granular as gr

FUSING = [isa for isa in available() if isa != "baseline"]
"""Instruction sets with the bits of a device."""

pytestmark = pytest.mark.skipif("one_lane" not in FUSING, reason="needs a fused multiply-add")

SMOOTHED = ("quadratic", "tpic", "smoothed")


def both(scene):
    """The same scene on a processor and on the emulated device."""
    return (
        gr.Simulation(scene, threads=1, isa=FUSING[-1]),
        gr.Simulation(scene, threads=3, device="emulated"),
    )


def slots(sim):
    """The buffers as they are, slot by slot, and the cells."""
    cells = [np.asarray(array).tobytes() for array in sim._engine.cells()]
    return cells, {name: array.tobytes() for name, array in sim.buffers.items()}


def regroup(sims):
    """Group the points of both anew, and check that they are in the same slots."""
    for sim in sims:
        assert sim._engine.regroup() == 0
    assert slots(sims[1]) == slots(sims[0])


def check_groupings(scene, *steps):
    """Group the points after these numbers of steps, which group some by themselves."""
    sims = both(scene)
    regroup(sims)
    for n in steps:
        for sim in sims:
            sim.step(n)
        assert bits(sims[1]) == bits(sims[0])
        regroup(sims)
    for sim in sims:
        sim.step(20)
    assert bits(sims[1]) == bits(sims[0])
    assert sims[1]._engine.foreign_array() is None
    return sims


@pytest.mark.parametrize("kind", ["walls", "periodic", "outlet"])
@pytest.mark.parametrize("basis", [("linear", "tpic", "cell_averaged"), SMOOTHED])
def test_groupings_have_the_slots_of_a_processor(small_scene, kind, basis, dim):
    check_groupings(small_scene(kind, dim, basis, E=1e5), 1, 40, 40)


def test_also_across_the_end_of_a_periodic_axis_of_ugimp(small_scene, dim):
    check_groupings(small_scene("periodic", dim, ("ugimp", "apic", "particle"), E=1e5), 40, 40)


def test_also_in_single_precision(small_scene, dim):
    scene = small_scene("walls", dim, SMOOTHED, E=1e5)
    check_groupings(scene.replace(scheme=scene.scheme.replace(precision="single")), 40, 40)


def test_also_with_points_that_enter():
    check_groupings(gr.scenes.silo_fed(cell=0.02, duration=0.3), 100, 50)


@pytest.mark.parametrize("dim", [2, 3])
def test_buffers_grow_as_on_a_processor(dim):
    """Many points wait for slots at once, in cells that held none."""
    scene = two_clouds(dim, *((24, 5, 10) if dim == 2 else (12, 3, 4)))
    sims = both(scene)
    sizes = [sim.buffers["id"].size for sim in sims]
    for n in (5, 5, 5, 5, 20):
        for sim in sims:
            sim.step(n)
        assert bits(sims[1]) == bits(sims[0])
    regroup(sims)
    grown = [sim.buffers["id"].size for sim in sims]
    assert grown[0] == grown[1]
    assert sizes[0] == sizes[1] < grown[0]


def test_points_that_have_been_moved_are_listed_one_by_one(small_scene, dim):
    """As on a processor, in the order of their old cells."""
    sims = both(small_scene("walls", dim, SMOOTHED, E=1e5))
    for sim in sims:
        sim.step(30)
        held = np.flatnonzero(sim.buffers["id"] >= 0)
        x = sim.buffers["x"]
        x[:, held] = x[:, np.roll(held, len(held) // 3)]
    regroup(sims)
    for sim in sims:
        sim.step(20)
    assert bits(sims[1]) == bits(sims[0])


def test_a_point_outside_is_named_as_by_a_processor(small_scene):
    sims, told = both(small_scene("walls", 2, SMOOTHED, E=1e5)), []
    for sim in sims:
        sim.step(30)
        at = np.argmax(sim.buffers["id"] == 11)
        good = sim.buffers["x"][0, at]
        sim.buffers["x"][0, at] = -3.0
        with pytest.raises(ValueError, match="outside the grid: point 11 at") as error:
            sim._engine.regroup()
        told.append(str(error.value))
        sim.buffers["x"][0, at] = good
    assert told[0] == told[1]
    regroup(sims)
    for sim in sims:
        sim.step(20)
    assert bits(sims[1]) == bits(sims[0])


def test_cells_that_have_emptied_are_given_up(small_scene, dim):
    """They are counted every 64 steps."""
    sims = both(small_scene("outlet", dim, SMOOTHED, E=1e5))
    before = [len(sim.cell_counts) for sim in sims]
    for _ in range(6):
        for sim in sims:
            sim.step(64)
        assert bits(sims[1]) == bits(sims[0])
        assert np.array_equal(sims[0].cell_counts, sims[1].cell_counts)
    assert len(sims[1].cell_counts) < before[1]
    regroup(sims)
