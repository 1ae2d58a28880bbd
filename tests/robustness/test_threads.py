"""The result is the same to the last bit for any number of threads."""

import multiprocessing
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import granular as gr


def bits(sim):
    """All data that a restart needs, as bytes in the order of the core."""
    point = sim.checkpoint()
    return point.scalars, {name: array.tobytes() for name, array in point.arrays.items()}


def run(scene, threads, steps, cut=None):
    sim = gr.Simulation(scene, threads=threads)
    for n in (steps,) if cut is None else (cut, steps - cut):
        sim.step(n)
    return sim


@pytest.mark.parametrize("kind", ["walls", "outlet"])
def test_threads_give_the_same_bits(small_scene, combination, dim, kind):
    """Points change cells, come together at new places and (kind "outlet") leave."""
    scene = small_scene(kind, dim, combination, E=1e5)
    one = run(scene, 1, 120)
    expected = bits(one)
    if kind == "outlet":
        assert one.time > 0.05
    for threads in (2, 3, 4):
        assert bits(run(scene, threads, 120)) == expected, threads


def test_threads_give_the_same_bits_when_many_points_leave(small_scene):
    scene = small_scene("outlet", 2, ("linear", "flip", "particle"), E=1e5, points_per_axis=4)
    one = run(scene, 1, 300)
    expected = bits(one)
    assert expected[0]["dropped"] > 5
    for threads in (2, 3, 4):
        assert bits(run(scene, threads, 300)) == expected


def test_twenty_runs_give_the_same_bits(small_scene):
    """Threads may start in any order, also where points change cells and leave."""
    scene = small_scene("outlet", 2, ("quadratic", "tpic", "smoothed"), E=1e5, points_per_axis=4)
    found = [bits(run(scene, threads, 150)) for threads in (1, 2, 3) for _ in range(20)]
    assert found[0][0]["dropped"] > 0
    assert all(one == found[0] for one in found)


def test_cuts_between_calls_give_the_same_bits(small_scene, combination):
    scene = small_scene("walls", 2, combination, E=1e5)
    expected = bits(run(scene, 2, 90))
    for cut in (1, 16, 47):
        assert bits(run(scene, 2, 90, cut)) == expected


FORK = textwrap.dedent(
    """
    import multiprocessing, sys
    sys.path.insert(0, {tests!r})
    from conftest import make_scene
    import granular as gr

    scene = make_scene("walls", 2, ("linear", "flip", "particle"), E=1e5)
    context = multiprocessing.get_context({method!r})

    def digest(threads, answer=None):
        try:
            sim = gr.Simulation(scene, threads=threads)
            sim.step(30)
            found = sim.checkpoint().digest.hex()
        except RuntimeError as error:
            found = str(error)
        return found if answer is None else answer.put(found)

    def in_child(threads):
        answer = context.SimpleQueue()
        child = context.Process(target=digest, args=(threads, answer))
        child.start()
        child.join(30)
        if child.exitcode is None:
            child.kill()
            sys.exit("the child hangs")
        return answer.get()

    if __name__ == "__main__":
        before = in_child(2)
        print(before == digest(2), in_child(1) == before, in_child(2), sep="\\n")
    """
)


@pytest.mark.parametrize("method", multiprocessing.get_all_start_methods())
def test_processes_beside_threads(method, tmp_path):
    """A process forked after a threaded run must use one thread, or it would wait for ever."""
    program = tmp_path / "program.py"
    program.write_text(FORK.format(tests=str(Path(__file__).parents[1]), method=method))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        [sys.executable, str(program)], capture_output=True, text=True, env=environment, timeout=120
    )
    assert done.returncode == 0, done.stderr
    first, single, double = done.stdout.splitlines()
    assert (first, single) == ("True", "True")
    info = gr.show_config()
    if method == "fork" and info["openmp"] and "clang" not in info["compiler"].lower():
        assert "threads = 2 must be 1" in double
        assert "spawn" in double
    else:
        assert len(double) == 64
