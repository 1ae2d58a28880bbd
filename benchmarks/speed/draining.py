"""Cost of a step while a silo drains and while a column comes to rest.

The cases are the silo of the paper (opening 0.2 m) and a column of aspect 1, default scheme,
E = 1 MPa, one thread. For the silo the table has, for each share of the points that is left, the
cells that the kernels visit and the processor time of a step. For the column it has over time: the
share of points that do not flow; the share of points that a step does not change at all, an upper
bound of the work that could be skipped exactly; and the time of a step, which is constant if
material at rest costs as much as flowing material.
"""

from __future__ import annotations

import numpy as np
from shared import least_time, parser_of, write

import granular as gr

SOFT = gr.materials.glass_beads.replace(E=1e6)
SHARES = (1.0, 0.75, 0.5, 0.25)
AT_REST = 1e-3
"""Speed [m/s] of a point below which it counts as at rest, if it does not flow plastically."""


def step_time(sim: gr.Simulation, batches: int) -> float:
    """Processor time of a step [s], least of several batches, on a copy of the simulation."""
    copy = gr.Simulation.from_checkpoint(sim.scene, sim.checkpoint(), threads=1)
    steps = max(int(0.1 / (60e-9 * copy.n_points)), 1)
    return least_time(lambda: copy.step(steps), batches) / steps


def work(sim: gr.Simulation, batches: int) -> dict[str, float]:
    counts = sim.cell_counts
    return {
        "time": round(sim.time, 4),
        "points": sim.n_points,
        "cells": len(counts),
        "occupied": int(np.count_nonzero(counts)),
        "microseconds": round(1e6 * step_time(sim, batches), 1),
    }


def draining(cell: float, batches: int) -> list[dict]:
    """Rows of the silo, from full to a quarter."""
    sim = gr.Simulation(gr.scenes.silo(orifice=0.2, cell=cell, material=SOFT), threads=1)
    start, rows = sim.n_points, []
    sim.step(5)
    for share in SHARES:
        while sim.n_points > share * start:
            sim.run(until=sim.time + 1 / 60)
        rows.append({"left": round(sim.n_points / start, 3)} | work(sim, batches))
    return rows


def unchanged(sim: gr.Simulation) -> float:
    """Share of the points that the next step does not change, to the last bit."""
    before = sim.state
    sim.step()
    after = sim.state
    same = np.ones(after.n, dtype=bool)
    for name in ("x", "v", "stress", "log_density"):
        rows = (getattr(s, name).reshape(s.n, -1) for s in (before, after))
        same &= np.equal(*rows).all(axis=1)
    return float(same.mean())


def resting(cell: float, batches: int) -> list[dict]:
    """Rows of the column, until all of it is at rest."""
    scene = gr.scenes.column_collapse(aspect=1.0, cell=cell, material=SOFT)
    sim, rows = gr.Simulation(scene, threads=1), []
    for at in (0.1, 0.3, 0.5, 1.0, 2.0):
        state = sim.run(until=at).state
        still = (state.shear_rate == 0) & (np.linalg.norm(state.v, axis=1) < AT_REST)
        shares = {"still": round(float(still.mean()), 3), "unchanged": round(unchanged(sim), 4)}
        rows.append(shares | work(sim, batches))
    return rows


def main(argv: list[str] | None = None) -> None:
    chosen = parser_of(__name__, __doc__, "coarse, to see that it runs").parse_args(argv)
    factor, batches = (2, 2) if chosen.quick else (1, 10)
    tables = {"silo": draining(0.01 * factor, batches), "column": resting(0.0125 * factor, batches)}
    for name, rows in tables.items():
        print(name)
        for row in rows:
            print("  " + "  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
    write(chosen.out, tables)
