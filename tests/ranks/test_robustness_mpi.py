"""Ranks by MPI: the bits of one process, and ends of processes that say so."""

import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from same_bits import bits, stepped

import granular as gr

MPIEXEC = shutil.which("mpiexec", path=str(Path(sys.executable).parent)) or shutil.which("mpiexec")

pytest.importorskip("mpi4py", reason="mpi4py is not installed")
pytestmark = pytest.mark.skipif(MPIEXEC is None, reason="mpiexec is not there")

COLUMN = """
import hashlib, os, signal, sys, threading
from mpi4py import MPI
import granular as gr

def end(state):
    if MPI.COMM_WORLD.rank == 1:
        number = getattr(signal, sys.argv[1])
        threading.Timer(0.3, os.kill, (os.getpid(), number)).start()

grains = gr.materials.glass_beads.replace(E=1e6)
scene = gr.scenes.column_collapse(
    cell=0.025, points_per_cell=4, material=grains, duration=100.0
)
comm = gr.ranks.MpiCommunicator(MPI.COMM_WORLD, timeout=3)
sim = gr.Simulation(scene, comm=comm, threads=1)
"""

DIGEST = """
sim.step(200)
arrays = sim.checkpoint().arrays
print(hashlib.sha256(b"".join(arrays[name].tobytes() for name in sorted(arrays))).hexdigest())
"""

ENDED = """
sim.run(until=0.02, save=sys.argv[2], every=0.01)
sim.on_each_rank(end)
sim.run()
"""


def scene():
    grains = gr.materials.glass_beads.replace(E=1e6)
    return gr.scenes.column_collapse(cell=0.025, points_per_cell=4, material=grains)


def run(size, code, *arguments, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(COLUMN + code)
    command = [MPIEXEC, "-n", str(size), sys.executable, str(script), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=100)


@pytest.mark.parametrize("size", [2, 3])
def test_bits_of_one_process(size, tmp_path):
    _, arrays = bits(stepped(scene(), 200))
    digest = hashlib.sha256(b"".join(arrays[name] for name in sorted(arrays))).hexdigest()
    done = run(size, DIGEST, tmp_path=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == digest


@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_a_rank_that_ends_or_stops_ends_all_and_the_record_resumes(how, tmp_path):
    path = tmp_path / "run.h5"
    done = run(2, ENDED, how, path, tmp_path=tmp_path)
    assert done.returncode != 0
    if how == "SIGSTOP":
        assert "has not answered for 3 s" in done.stderr
    resumed = gr.Simulation.resume(path)
    resumed.step(10)
    assert resumed.time > 0.02
    alone = bits(stepped(scene(), resumed.steps))[1]
    assert {name: bits(resumed)[1][name] for name in alone} == alone


def test_the_command_finds_the_ranks_by_itself(tmp_path):
    options = ["column_collapse", "--cell", "0.05", "--E", "1e6", "--until", "0.05", "--quiet"]
    alone, two = tmp_path / "alone.h5", tmp_path / "two.h5"
    command = [sys.executable, "-m", "granular", "run", *options, "-o"]
    subprocess.run([*command, str(alone)], check=True, timeout=100)
    subprocess.run([MPIEXEC, "-n", "2", *command, str(two)], check=True, timeout=100)
    done = subprocess.run([sys.executable, "-m", "granular", "compare", str(alone), str(two)])
    assert done.returncode == 0
    for wrong in (["column_collapse", "--aspect", "-1"], ["incline_sph"]):
        words = [*command[:4], *wrong, "-o", str(tmp_path / "wrong.h5")]
        done = subprocess.run([MPIEXEC, "-n", "2", *words], capture_output=True, timeout=60)
        assert done.returncode == 2
        assert done.stderr.count(b"granular: error:") == 1
