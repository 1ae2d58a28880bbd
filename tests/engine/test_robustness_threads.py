"""Threads that the system refuses, and several threads of Python with one simulation."""

import os
import subprocess
import sys
import textwrap
import threading

import pytest

import granular as gr

REFUSED = textwrap.dedent("""
    import os, resource, sys, warnings
    import granular as gr

    scene = gr.scenes.column_collapse(aspect=1.0, cell=0.1, E=1e5)
    alone = gr.Simulation(scene, threads=1)
    alone.step(20)
    sim = gr.Simulation(scene, threads=4)
    if sys.argv[1] == "processes":
        if os.getuid() == 0:  # whom no limit binds
            os.setuid(65534)
        resource.setrlimit(resource.RLIMIT_NPROC, (0, 0))
    else:  # of the memory: a stack of a thread takes 8 MB
        used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + (1 << 22), resource.RLIM_INFINITY))
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            sim.step(1)
            sim.step(19)
        assert sim.checkpoint().digest == alone.checkpoint().digest
        for warning in caught:
            print(warning.category.__name__, os.path.basename(warning.filename), warning.message)
    finally:
        print("the end")
""")


@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
@pytest.mark.parametrize("limit", ["processes", "memory"])
def test_a_run_goes_on_without_the_threads_that_are_refused(tmp_path, limit):
    """It warns once and has the same bits; OpenMP would end the interpreter."""
    program = tmp_path / "program.py"
    program.write_text(REFUSED)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    done = subprocess.run(
        [sys.executable, str(program), limit], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    warned, end = done.stdout.splitlines()
    assert warned.startswith("RuntimeWarning program.py the system has refused 3 of threads = 4")
    assert "ulimit -u" in warned and end == "the end"


def test_steps_in_two_threads_are_refused(small_scene):
    """One thread makes steps, the others are told; all that are made count."""
    scene = small_scene("walls", 2, ("linear", "flip", "particle"), E=1e5)
    sim, refused, made = gr.Simulation(scene, threads=1), [], []

    def steps(count):
        for _ in range(count):
            try:
                sim.step(20)
                made.append(20)
            except RuntimeError as error:
                refused.append(str(error))

    def together(running):
        workers = [threading.Thread(target=steps, args=(20,)) for _ in range(3)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()

    together(sim)
    assert sim.steps == sum(made) and len(made) + len(refused) == 60
    refused.clear()
    sim.run(until=1.5 * sim.time, every=sim.time, hooks=(together,), monitor=False)
    assert len(refused) >= 60
    assert all("makes steps in another thread" in said for said in refused)
    alone = gr.Simulation(scene, threads=1)
    alone.step(sim.steps)
    assert alone.checkpoint().digest == sim.checkpoint().digest
