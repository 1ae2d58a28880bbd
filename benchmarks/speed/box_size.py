"""Cost of an empty box: time and memory per point of a heap against the size of its box.

A heap of 8 points per cell rests in 3D, in the corner of a box of 1, 8 and 64 times its volume;
finite strain, with the local and the nonlocal law (implicit). The time is the processor time of one
thread, best of several batches. The memory is the growth of the process, all arrays included.
"""

from __future__ import annotations

import multiprocessing
import resource
from pathlib import Path

from shared import parser_of, write

import granular as gr
from speed.speed import best_time

FRICTION = {"mu_s": 0.3819, "mu_2": 0.6435, "I0": 0.278, "d": 4e-3, "rho_s": 2550.0}
LAWS = {
    "local": gr.MuI(E=1e5, elasticity="hencky", **FRICTION),
    "nonlocal": gr.NGF(E=1e5, elasticity="hencky", A=0.48, t0=1e-3, **FRICTION),
}


def heap(law: str, cells: int, times: int) -> gr.Scene:
    """Cubic heap with a given number of cells per edge, in a box `times` as wide per axis."""
    cell = 4e-3
    edge = cells * cell
    return gr.Scene(
        name="heap",
        grid=gr.Grid((0.0,) * 3, cell, (cells * times,) * 3),
        fills=(gr.Fill(gr.Box((0.0,) * 3, (edge, edge, 0.75 * edge)), 8, lithostatic=True),),
        material=LAWS[law],
        scheme=gr.Scheme(
            transfer="apic",
            density=gr.ParticleDensity(),
            fluidity=gr.Fluidity(method="implicit", initial=1.0),
        ),
        walls=(
            gr.Wall(2, 0.0, kind="no_slip"),
            *(gr.Wall(axis, 0.0, kind="free_slip") for axis in (0, 1)),
        ),
        gravity=gr.Gravity((0.0,), ((0.0, 0.0, -9.81),)),
        duration=1.0,
        seed=1,
    )


def measure(law: str, cells: int, times: int, batches: int) -> dict:
    """Row of one case, which is run in a separate process."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    sim = gr.Simulation(heap(law, cells, times), threads=1)
    sim.step(20)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024
    with Path("/proc/self/statm").open() as file:
        held = int(file.read().split()[1]) * resource.getpagesize() - before * 1024
    return {
        "law": law,
        "box": times**3,
        "points": sim.n_points,
        "ns": best_time(sim, 1, batches) * 1e9,
        "bytes_per_point": held / sim.n_points,
        "peak_bytes_per_point": grown / sim.n_points,
    }


def main(argv: list[str] | None = None) -> None:
    arguments = parser_of(__name__, __doc__).parse_args(argv)
    cells, batches = (6, 1) if arguments.quick else (20, 15)
    rows = []
    print("law       box  points  ns/step  bytes/point  at most")
    for law in LAWS:
        for times in (1, 2, 4):
            with multiprocessing.get_context("spawn").Pool(1) as pool:
                row = pool.apply(measure, (law, cells, times, batches))
            print(
                f"{law:8s}{row['box']:5d}{row['points']:8d}{row['ns']:9.1f}"
                f"{row['bytes_per_point']:13.0f}{row['peak_bytes_per_point']:9.0f}"
            )
            rows.append(row)
    write(arguments.out, {"rows": rows})
