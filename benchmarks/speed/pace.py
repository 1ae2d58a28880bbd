"""Time per point and step compared with the estimate of `granular.economy.cost`, on one thread.

Blocks at rest have 4, 9 and 16 points in a cell in 2D, and 8 and 27 in 3D; with them are the ready
scenes with fills of at most 400,000 points, after 50 steps. The speed of the machine is measured by
the package itself.
"""

from __future__ import annotations

import time
import warnings
from typing import Any

from shared import parser_of, rounded, table, write

import granular as gr
from granular.economy.pace import slowness

POINTS = (12_800, 51_200, 204_800)
PER_CELL = {2: (4, 9, 16), 3: (8, 27)}
MOST = 400_000


def block(dim: int, points: int, per_cell: int) -> gr.Scene:
    """A bed at rest, twice as long (and wide) as high."""
    high = max(round((points / per_cell / 2 ** (dim - 1)) ** (1 / dim)), 2)
    sides = (*[2 * high] * (dim - 1), high)
    cell = 0.5 / high
    region = gr.Box((0.0,) * dim, tuple(n * cell for n in sides))
    return gr.Scene(
        name=f"{dim}D, {per_cell} in a cell",
        grid=gr.Grid((0.0,) * dim, cell, (*sides[:-1], high + 8)),
        fills=[gr.Fill(region, per_cell, lithostatic=True, jitter=0.2)],
        material=gr.MuI(E=1e6),
        walls=[
            gr.Wall(dim - 1, 0.0),
            *(gr.Wall(a, e, kind="free_slip") for a in range(dim - 1) for e in (0.0, 1.0)),
        ],
        gravity=gr.Gravity.constant(9.8, dim),
        duration=1.0,
    )


def measured(name: str, scene: gr.Scene) -> dict[str, Any]:
    """Time per point and step [ns], the least of three, and the estimate."""
    cost = gr.economy.cost(scene)
    sim = gr.Simulation(scene, threads=1, force=True)
    steps = max(int(5e5 / sim.n_points), 5)
    sim.step(50 if sim.n_points < 50_000 else 10)
    least = float("inf")
    for _ in range(3):
        begin = time.perf_counter()
        sim.step(steps)
        least = min(least, (time.perf_counter() - begin) / steps / sim.n_points)
    estimate = cost.seconds / cost.point_steps
    row = {"scene": name, "points": sim.n_points, "ns": 1e9 * least, "estimate": 1e9 * estimate}
    print(f"{name:24s}{sim.n_points:9d}{1e9 * least:9.1f}{1e9 * estimate:9.1f}")
    return row | {"ratio": least / estimate}


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page: blocks, and ready scenes."""
    columns = {"": "{scene}", "points": "{points:,}", "ns": "{ns:.0f}"}
    columns |= {"estimate": "{estimate:.0f}", "ratio": "{ratio:.2f}"}
    return {name: table(results[name], columns) for name in ("blocks", "scenes")}


def main(argv: list[str] | None = None) -> None:
    arguments = parser_of(__name__, __doc__).parse_args(argv)
    warnings.simplefilter("ignore")  # of stability: some steps are made
    sizes = POINTS[:1] if arguments.quick else POINTS
    cases = [(dim, n, count) for dim, counts in PER_CELL.items() for count in counts for n in sizes]
    print(f"this machine takes {slowness():.2f} of the time of the table")
    blocks = [block(*case) for case in cases]
    names = gr.scenes.names("mpm")[: 3 if arguments.quick else None]
    scenes = {name: gr.scenes.registry[name]() for name in names}
    ready = {n: s for n, s in scenes.items() if s.fills and s.n_points <= MOST}
    rows = {
        "blocks": [measured(scene.name, scene) for scene in blocks],
        "scenes": [measured(name, scene) for name, scene in ready.items()],
    }
    write(arguments.out, {name: rounded(part, 3) for name, part in rows.items()})
