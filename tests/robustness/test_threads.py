"""The number of threads does not touch a bit of the result."""

import pytest

import granular as gr


def bits(sim):
    """All that a restart needs, in the order of the core, as bytes."""
    point = sim.checkpoint()
    return point.scalars, {name: array.tobytes() for name, array in point.arrays.items()}


def run(scene, threads, steps, cut=None):
    sim = gr.Simulation(scene, threads=threads)
    for n in (steps,) if cut is None else (cut, steps - cut):
        sim.step(n)
    return sim


@pytest.mark.parametrize("kind", ["walls", "outlet"])
def test_threads_give_the_same_bits(small_scene, combination, dim, kind):
    """With points that change cells, gather at new places and (kind "outlet") leave."""
    scene = small_scene(kind, dim, combination, E=1e5)
    one = run(scene, 1, 120)
    expected = bits(one)
    if kind == "outlet":
        assert one.time > 0.05
    for threads in (2, 3, 4):
        assert bits(run(scene, threads, 120)) == expected, threads


def test_threads_give_the_same_bits_when_many_points_leave(small_scene):
    scene = small_scene("outlet", 2, ("linear", "flip", "tracked"), E=1e5, points_per_axis=4)
    one = run(scene, 1, 300)
    expected = bits(one)
    assert expected[0]["dropped"] > 5
    for threads in (2, 3, 4):
        assert bits(run(scene, threads, 300)) == expected


def test_cuts_between_calls_give_the_same_bits(small_scene, combination):
    scene = small_scene("walls", 2, combination, E=1e5)
    expected = bits(run(scene, 2, 90))
    for cut in (1, 16, 47):
        assert bits(run(scene, 2, 90, cut)) == expected
