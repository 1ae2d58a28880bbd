"""Slots of points: the size of the buffers over the size of the points in them.

The buffers of the core have more slots than there are points, as all cells of a tile have as many
as the fullest, and one more. Their size is taken at the start and after some flow; they do not
shrink. The table also has the size of the rows of the fullest cells alone, and the bytes of a point
in both precisions.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from shared import parser_of, rounded, table, write

import granular as gr

COLUMN = partial(gr.scenes.column_collapse, aspect=2.0, cell=0.0125, E=1e7)
CASES = {
    "silo in 3D, 8 points per cell": gr.scenes.silo_3d,
    "cylinder in 3D, 8": partial(gr.scenes.cylinder_collapse, cell=0.0125, E=1e7),
    "column in 2D, 16": partial(COLUMN, points_per_cell=16),
    "column in 2D, 4": partial(COLUMN, points_per_cell=4),
}
TILE = 8
"""Cells of a tile."""
UNTIL = 0.3
"""Simulated time after which the buffers are measured again [s]."""


def bytes_of_a_point(sim: gr.Simulation) -> float:
    return sum(array.nbytes for array in sim.buffers.values()) / len(sim.buffers["id"])


def bytes_in_single(scene: gr.Scene) -> float | None:
    """Bytes of a point in single precision, None if the law of the scene has none."""
    try:
        scene = scene.replace(scheme=scene.scheme.replace(precision="single"))
    except ValueError:
        return None
    return bytes_of_a_point(gr.Simulation(scene, threads=1))


def least(sim: gr.Simulation) -> float:
    """Slots per point of as many rows as the fullest cell of each tile has points."""
    counts = sim.cell_counts
    tiles = np.pad(counts, (0, -len(counts) % TILE)).reshape(-1, TILE)
    return float(TILE * tiles.max(axis=1).sum() / sim.n_points)


def sizes(scene: gr.Scene, until: float) -> dict[str, float | None]:
    """Bytes that the fields of a point need, and slots per point at the start and at the end."""
    sim = gr.Simulation(scene, threads=1)
    result = {"points": sim.n_points, "start": len(sim.buffers["id"]) / sim.n_points}
    result |= {"bytes": bytes_of_a_point(sim), "bytes_single": bytes_in_single(scene)}
    sim.run(until=until)
    return result | {"end": len(sim.buffers["id"]) / sim.n_points, "least": least(sim)}


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page."""
    columns = {"scene": "{scene}", "points": "{points:,}", "bytes of a point": "{bytes:.0f}"}
    columns |= {"in single precision": "{single}", "at the start": "{start:.2f}"}
    columns |= {f"after {UNTIL:g} s": "{end:.2f}", "rows of the fullest cells then": "{least:.2f}"}
    rows = []
    for name, q in results["cases"].items():
        single = f"{q['bytes_single']:.0f}" if q["bytes_single"] else "not for its law"
        rows.append(q | {"scene": name, "single": single})
    return {"places": table(rows, columns)}


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, quick="one step of each, to see that it runs")
    given = parser.parse_args(argv)
    until = 1e-6 if given.quick else UNTIL
    cases = {name: sizes(scene(), until) for name, scene in CASES.items()}
    print(*tables({"cases": cases})["places"], sep="\n")
    write(given.out, {"cases": rounded(cases, 4)})
