"""Time of a step of the finite-strain laws in 3D, and the cost of its parts.

A bed of 8 points per cell flows down a slope of 38 degrees, periodic on its sides. The scheme has
the quadratic basis, APIC and the particle density. It is run without fluidity (A = 0), with a
fluidity that diffuses over faces or over all neighbours, and with a blade in the flow, thick or
thin; for comparison the default scheme is run, too. The batches of one thread and of two take
turns, and the best of each counts. The memory is the size of the arrays of the points.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from shared import parser_of, table, write

import granular as gr
from granular import shapes
from granular.mpm import bodies
from speed.speed import best_time

CELL, SLOPE = 0.01, math.radians(38.0)
SOIL = gr.NGF(
    E=1.5e5, elasticity="hencky", A=0.48, t0=1e-3, mu_s=0.3819, mu_2=0.6435, I0=0.278, d=4e-3,
    rho_s=2550.0,
)  # fmt: skip
MLS = gr.Scheme(transfer="apic", density=gr.ParticleDensity())


def bed(edge: int, A: float, scheme: gr.Scheme, stencil: str, blade: float | None) -> gr.Scene:
    """Cubic scene with `edge` cells per edge, and with a blade that is `blade` cells thick."""
    length = edge * CELL
    shape = blade and shapes.Box(size=(blade * CELL, 0.4 * length, 0.4 * length))
    middle = (0.5 * length, 0.5 * length, length)
    return gr.Scene(
        name="slope",
        grid=gr.Grid((0.0,) * 3, CELL, (edge, edge, edge + 10), periodic=(True, True, False)),
        fills=(gr.Fill(gr.Box((0.0,) * 3, (length,) * 3), 8),),
        material=SOIL.replace(A=A),
        scheme=scheme.replace(
            fluidity=gr.Fluidity(method="implicit", stencil=stencil, initial=1.0)
        ),
        walls=(gr.Wall(2, 0.0, kind="no_slip"),),
        bodies=(bodies.Body(shape, middle, friction=0.4),) if shape else (),
        gravity=gr.Gravity((0.0,), ((9.81 * math.sin(SLOPE), 0.0, -9.81 * math.cos(SLOPE)),)),
        duration=10.0,
        seed=1,
    )


CASES = {
    "local": (0.0, MLS, "faces", None),
    "nonlocal": (0.48, MLS, "faces", None),
    "all neighbours": (0.48, MLS, "isotropic", None),
    "thick blade": (0.48, MLS, "faces", 3.0),
    "thin blade": (0.48, MLS, "faces", 0.5),
    "default scheme": (0.48, gr.Scheme(), "faces", None),
}


TITLES = {
    "local": "without a fluidity, A = 0",
    "nonlocal": "fluidity over faces",
    "all neighbours": "over all neighbours",
    "thick blade": "over faces, a blade of 3 cells in the flow",
    "thin blade": "a blade of half a cell, a thin body with two sides",
    "default scheme": "the default scheme",
}
"""Cases by their words in the table."""


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page: times with one thread and with two, and memory of a point."""
    columns = {"": "{title}", "one": "{ns[0]:.0f}", "two": "{ns[1]:.0f}", "ratio": "{ratio:.2f}"}
    rows = [
        row | {"title": TITLES[row["case"]], "ratio": row["ns"][0] / row["ns"][1]}
        for row in results["rows"]
    ]
    return {"laws in 3D": table(rows, columns | {"bytes": "{bytes_per_point:.0f}"})}


def main(argv: list[str] | None = None) -> None:
    arguments = parser_of(__name__, __doc__).parse_args(argv)
    edge, steps, rounds = (6, 5, 1) if arguments.quick else (30, 300, 12)
    table = []
    print(f"{'case':16s}{'points':>8s}{'1 thread':>10s}{'2':>8s}{'ratio':>7s}{'bytes':>7s}")
    for name, case in CASES.items():
        start = gr.Simulation(bed(edge, *case), threads=2)
        start.step(steps)
        sims = {
            threads: gr.Simulation.from_checkpoint(start.scene, start.checkpoint(), threads=threads)
            for threads in (1, 2)
        }
        ns = dict.fromkeys(sims, np.inf)
        for _ in range(rounds):
            for threads, sim in sims.items():
                sim.step(2)  # contents of the caches left by the other one
                ns[threads] = min(ns[threads], best_time(sim, threads, 1) * 1e9)
        one, two = ns.values()
        held = sum(array.nbytes for array in sim.buffers.values()) / sim.n_points
        print(f"{name:16s}{sim.n_points:8d}{one:10.1f}{two:8.1f}{one / two:7.2f}{held:7.0f}")
        row = {"case": name, "points": sim.n_points, "ns": [one, two], "bytes_per_point": held}
        table.append(row)
    write(arguments.out, {"rows": table})
