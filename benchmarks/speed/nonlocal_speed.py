"""Cost of the nonlocal law: ns per particle-step in addition to the local law of the same run.

The case is the clogging silo (linear shape functions, 16 points per cell, half, W/d = 5) after
0.1 s, with the local law (A = 0), and with the nonlocal one by explicit, implicit (A = 1) and
Runge-Kutta-Legendre steps with one substep and five. Times are processor times of one thread. The
batches of all cases take turns, and the best of each case counts.
"""

from __future__ import annotations

import numpy as np
from shared import parser_of, write

import granular as gr
from speed.speed import best_time

CASES = {
    "local": (0.0, gr.Fluidity()),
    "explicit, 1": (0.1, gr.Fluidity(method="explicit")),
    "implicit, 1": (1.0, gr.Fluidity(method="implicit")),
    "rkl2, 1": (1.0, gr.Fluidity(method="rkl2")),
    "explicit, 5": (0.1, gr.Fluidity(method="explicit", substeps=5)),
    "implicit, 5": (1.0, gr.Fluidity(method="implicit", substeps=5)),
    "rkl2, 5": (1.0, gr.Fluidity(method="rkl2", substeps=5)),
}


def simulation(A: float, fluidity: gr.Fluidity, cell: float, until: float) -> gr.Simulation:
    """A silo that flows."""
    scene = gr.scenes.clogging_silo(opening_over_d=5.0, A=A, cell=cell)
    scheme = scene.scheme.replace(fluidity=fluidity, dt=1e-4 * cell / 0.0175)
    sim = gr.Simulation(scene.replace(scheme=scheme), threads=1)
    return sim.run(until, monitor=False)


def main(argv: list[str] | None = None) -> None:
    arguments = parser_of(__name__, __doc__).parse_args(argv)
    rounds, until = (1, 0.002) if arguments.quick else (15, 0.1)
    table = []
    print(f"{gr.show_config()['isa']}; ns/particle-step, over the local law")
    for cell in (0.0175,) if arguments.quick else (0.0175, 0.00875):
        sims = {name: simulation(*case, cell, until) for name, case in CASES.items()}
        ns = dict.fromkeys(sims, np.inf)
        for _ in range(rounds):
            for name, sim in sims.items():
                ns[name] = min(ns[name], best_time(sim, 1, 2) * 1e9)
        for name, sim in sims.items():
            row = {"case": name, "points": sim.n_points, "ns": ns[name]}
            print(f"{name:12s}{sim.n_points:8d}{ns[name]:8.1f}{ns[name] - ns['local']:+8.1f}")
            table.append(row | {"over_local": ns[name] - ns["local"]})
    write(arguments.out, {"rows": table})
