"""Records of every method and kind of part, opened by a process that has imported nothing else."""

import subprocess

import pytest
from processes import command

import granular as gr

READ = """
import sys
import granular as gr

path, first, last = sys.argv[1:]
record = gr.open(path)
{use}
assert (record[0].x.tobytes().hex()[:32], record[-1].x.tobytes().hex()[:32]) == (first, last)
"""
USES = {
    "frames": "record.scene, record.health(), record[-1].fields",
    "resume": "gr.Simulation.resume(path).step(2)",
}


def heaped():
    """A scene with two materials, an operation on shapes, a body and an inflow."""
    return gr.Scene(
        name="parts",
        grid=gr.Grid((0.0, 0.0), 0.05, (20, 16)),
        fills=(
            gr.Fill(gr.Box((0.0, 0.0), (1.0, 0.2)), 4, material=gr.NGF(E=1e6, d=0.01)),
            gr.Fill(
                gr.Difference(gr.Box((0.0, 0.3), (0.3, 0.5)), gr.Sphere(0.1, center=(0.1, 0.4))), 4
            ),
        ),
        material=gr.MuI(E=1e6),
        bodies=(gr.Body(gr.Polygon(((0.0, 0.0), (0.2, 0.0), (0.1, 0.2))), (0.6, 0.3)),),
        inflows=(gr.Inflow(gr.Box((0.8, 0.7), (0.9, 0.75)), (0.0, -1.0), points_per_cell=4),),
        gravity=gr.Gravity((0.0,), ((0.0, -9.8),)),
        duration=1.0,
    )


SCENES = {
    "parts": heaped,
    **{name: gr.scenes.registry[name] for name in ("slump_sph", "fluidised_bed", "rolling_wheel")},
}


@pytest.mark.parametrize("name", SCENES)
def test_a_record_says_by_itself_what_it_needs(name, tmp_path):
    """The modules that it names are imported, to read it and to go on with it."""
    path = tmp_path / "a.h5"
    sim = gr.Simulation(SCENES[name](), threads=1)
    sim.run(until=2.5 * sim.dt, save=path, every=sim.dt)
    record = gr.open(path)
    ends = [state.x.tobytes().hex()[:32] for state in (record[0], record[-1])]
    for use in USES.values():
        done = subprocess.run(
            command(READ.format(use=use), path, *ends), capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
