"""Error against time of the solvers of `granular.grain_scale.inference`.

The forces of packings with known forces are inferred from exact stresses and from stresses with an
error of 10 %, by each solver that is able to. The packings are the 58 discs of the oedometric test
and shaken regular arrays, from 100 to 5000 grains in 2D and to 1000 in 3D. Time is processor time
of one thread, the best of several repeats; the error is over all forces (eq. 2.15). The friction
in the arrays is 0.3, so that with noise the friction limits are active.
"""

from __future__ import annotations

import os
import time
import warnings
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

import numpy as np
from shared import PICTURES, parser_of, write

from granular.grain_scale import inference
from granular.grain_scale.inference import InferenceWarning
from granular.papers.hurley_thesis.errors import relative_error, with_noise
from granular.papers.hurley_thesis.packings import Case, jittered_grid, pressed_discs
from granular.plot import Picture

FIGURE = PICTURES / "inference_speed.png"
LATTICES = ((12, 12), (24, 24), (46, 46), (73, 73), (7, 7, 7), (9, 9, 9), (12, 12, 12))
QUICK = ((8, 8), (5, 5, 5))
LARGEST_DENSE = 500
"""Largest number of grains for which nnls is timed."""
REPEAT = 0.3
"""Time for which calls are repeated [s]; the first call counts however long it takes."""
MARKERS = {"auto": "o", "clarabel": "s", "nnls": "^"}


def noisy(packing: inference.Packing) -> inference.Packing:
    """Packing with a random error of 10 % in each component of the stresses."""
    return with_noise(packing, np.random.default_rng(0), bias=0.0)


def timed(packing: inference.Packing, mu: float, solver: str, repeat: float) -> tuple[float, Any]:
    """Seconds, and the inference."""
    best, spent = np.inf, 0.0
    while spent <= repeat:
        begin = time.process_time()
        inferred = inference.infer_static(packing, mu=mu, solver=solver)
        best = min(best, time.process_time() - begin)
        spent += time.process_time() - begin
    return best, inferred


def rows(name: str, case: Case, mu: float, repeat: float) -> list[dict[str, Any]]:
    """Rows, one for each solver and kind of stresses."""
    entries = []
    for stresses in ("exact", "noisy"):
        packing = case.packing if stresses == "exact" else noisy(case.packing)
        for solver in MARKERS:
            if solver == "nnls" and (packing.dim == 3 or packing.n > LARGEST_DENSE):
                continue
            seconds, inferred = timed(packing, mu, solver, repeat)
            error = relative_error(inferred.forces, case.forces)
            entries.append(
                {
                    "packing": name,
                    "dim": packing.dim,
                    "grains": packing.n,
                    "contacts": len(packing.bodies),
                    "stresses": stresses,
                    "solver": solver,
                    "used": inferred.solver,
                    "seconds": float(f"{seconds:.4g}"),
                    "error": float(f"{error:.4g}"),
                    "balance": float(f"{inferred.balance_residual:.3g}"),
                }
            )
            print(
                "{packing:14s}{stresses:6s}{solver:9s}{seconds:8.3f} s {error:.2e}".format(
                    **entries[-1]
                )
            )
    return entries


def chart(table: list[dict[str, Any]]) -> Picture:
    """Error against time, exact stresses to the left; time against grains to the right."""
    fig = Picture(figsize=(7.0, 3.2), layout="tight")
    left, right = fig.subplots(1, 2)
    for solver, marker in MARKERS.items():
        for dim, shade in ((2, "#1b4f8a"), (3, "#c8502d")):
            mine = [row for row in table if (row["solver"], row["dim"]) == (solver, dim)]
            rough = [row for row in mine if row["stresses"] == "noisy"]
            label = f"{solver}, {dim}D"
            for ax, points, x, y in (
                (left, mine, "seconds", "error"),
                (right, rough, "grains", "seconds"),
            ):
                if points:
                    values = [[row[name] for row in points] for name in (x, y)]
                    ax.plot(*values, marker, color=shade, fillstyle="none", label=label)
    left.set(xlabel="processor time [s]", ylabel="error of the forces", xscale="log", yscale="log")
    left.set_title("exact stresses below, noisy ones (10 %) above")
    right.set(xlabel="grains", ylabel="processor time [s]", xscale="log", yscale="log")
    right.set_title("noisy stresses")
    right.legend()
    return fig


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "small packings, to see it runs")
    parser.add_argument("--figure", type=Path, default=FIGURE)
    chosen = parser.parse_args(argv)
    warnings.simplefilter("ignore", InferenceWarning)
    repeat = 0.0 if chosen.quick else REPEAT
    table = [] if chosen.quick else rows("58 discs", pressed_discs()[0], 0.5, repeat)
    for shape in QUICK if chosen.quick else LATTICES:
        table += rows("x".join(map(str, shape)), jittered_grid(shape), 0.3, repeat)
    write(chosen.out, {"rows": table})
    chart(table).savefig(chosen.figure)
