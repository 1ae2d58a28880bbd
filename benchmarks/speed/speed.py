"""Time per particle-step of the kernels, with the error of the same schemes.

Column collapse of aspect 2 with 16 points per cell in double precision: about 8,000 and 200,000
points, as seeded and after the column has fallen for a while, with one thread and with two. One
thread is timed by the processor time of the process, two by the wall clock. The best of several
batches counts; only the ratios within one run can be compared. Each scheme also has its error on
the periodic incline of 25 degrees, with one column of cells and with eight, against the
one-dimensional equation: a fast scheme that is wrong is no bargain. The last lines are of a quarter
of a cylinder in 3D, 8 points per cell, one thread. On a machine that others disturb, run it several
times: with --again the smaller of each time and the one in the file is stored. The results of a
processor with AVX2 alone are in results/speed-avx2.json.

`granular.economy.cost` contains the times of one thread (small state, mean of seeded and fallen;
3D). Update its constants after a new results/speed.json; a test compares them.
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np
from shared import least_time, markdown, parser_of, write
from stability.flows import error_of_profile

import granular as gr

SCHEMES = {
    "linear flip": gr.Scheme(basis="linear"),
    "ugimp flip": gr.Scheme(basis="ugimp"),
    "quadratic flip": gr.Scheme(basis="quadratic", transfer="flip"),
    "cell averaged": gr.schemes.cell_averaged,
    "quadratic apic": gr.Scheme(basis="quadratic", transfer="apic"),
    "default": gr.schemes.default,
    "default, single precision": gr.schemes.default.replace(precision="single"),
}
MATERIAL = gr.materials.glass_beads.replace(E=1e7)


def best_time(sim: gr.Simulation, threads: int, batches: int) -> float:
    """Seconds per particle-step, the best of several batches of about 50 ms each."""
    clock = time.process_time if threads == 1 else time.perf_counter
    steps = max(int(0.05 / (40e-9 * sim.n_points)), 1)
    return least_time(lambda: sim.step(steps), batches, clock) / (steps * sim.n_points)


def speed(scheme: gr.Scheme, cell: float, fall: float, batches: int) -> list[dict]:
    """Times of a scheme on a column of cells of this size, as seeded and after `fall` seconds."""
    scene = gr.scenes.column_collapse(aspect=2.0, cell=cell, material=MATERIAL, scheme=scheme)
    start = gr.Simulation(scene, threads=2)
    start.step(5)
    seeded = start.checkpoint()
    fallen = start.run(until=fall).checkpoint()
    rows = []
    for state, checkpoint in (("seeded", seeded), (f"after {fall} s", fallen)):
        for threads in (1, 2):
            sim = gr.Simulation.from_checkpoint(scene, checkpoint, threads=threads)
            ns = best_time(sim, threads, batches) * 1e9
            rows.append({"points": sim.n_points, "state": state, "threads": threads, "ns": ns})
    return rows


def speed_3d(scheme: gr.Scheme, cell: float, batches: int) -> dict:
    """Time of a scheme on a quarter of a cylinder as seeded, with one thread."""
    scene = gr.scenes.cylinder_collapse(cell=cell, material=MATERIAL, scheme=scheme)
    sim = gr.Simulation(scene, threads=1)
    sim.step(5)
    ns = best_time(sim, 1, batches) * 1e9
    return {"points": sim.n_points, "state": "seeded", "threads": 1, "ns": ns}


def incline_error(scheme: gr.Scheme, columns: int, until: float) -> float:
    """Relative L2 error of the velocity profile on the incline of 25 degrees, 9 points per cell."""
    scene = gr.scenes.incline(
        cell=0.01, columns=columns, points_per_cell=9, jitter=0.6, material=MATERIAL, scheme=scheme
    )
    return error_of_profile(gr.Simulation(scene, threads=1).run(until=until).state)


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the pages: a summary, times with the errors in 2D, and times in 3D."""
    times: dict[str, dict[tuple[int, str], list[float]]] = {}
    errors = {}
    for row in results["rows"]:
        state = "seeded" if row["state"] == "seeded" else "fallen"
        times.setdefault(row["scheme"], {}).setdefault((row["points"], state), []).append(row["ns"])
        errors[row["scheme"]] = [row["incline_error"][columns] for columns in ("1", "8")]
    kinds = list(next(iter(times.values())))
    head = ["scheme", *(f"{n:,} points, {state}" for n, state in kinds), "1 column", "8 columns"]
    plane = [
        [
            scheme,
            *(f"{one:.1f} / {two:.1f}" for one, two in times[scheme].values()),
            *(f"{error:.2g}" for error in errors[scheme]),
        ]
        for scheme in times
    ]
    space = [[row["scheme"], f"{row['ns']:.0f}"] for row in results["space"]]
    return {
        "summary": summary(results),
        "speed": markdown(head, plane),
        "speed 3D": markdown(("scheme", f"{results['space'][0]['points']:,} points"), space),
    }


def summary(results: dict[str, Any]) -> list[str]:
    """Times of four schemes [ns]: mean of the small state seeded and fallen, and in 3D."""
    small = min(row["points"] for row in results["rows"])
    space = {row["scheme"]: row["ns"] for row in results["space"]}
    lines = []
    for scheme in ("linear flip", "cell averaged", "default", "default, single precision"):
        mean = [
            np.mean([
                row["ns"] for row in results["rows"]
                if (row["scheme"], row["points"], row["threads"]) == (scheme, small, threads)
            ])
            for threads in (1, 2)
        ]  # fmt: skip
        lines.append((scheme, *(f"{ns:.1f}" for ns in mean), f"{space[scheme]:.0f}"))
    return markdown(("scheme", "2D, one thread", "2D, two threads", "3D, one thread"), lines)


def least(before: dict[str, Any], now: dict[str, Any]) -> dict[str, Any]:
    """Return the results of two runs on one machine with the smaller time of each row."""
    if before["isa"] != now["isa"]:
        raise SystemExit("the file has results of another instruction set")
    for part in ("rows", "space"):
        for old, new in zip(before[part], now[part], strict=True):
            if [old[k] for k in ("scheme", "points")] != [new[k] for k in ("scheme", "points")]:
                raise SystemExit("the file has other rows")
            new["ns"] = min(old["ns"], new["ns"])
    return now


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__)
    parser.add_argument("--again", action="store_true", help="keep times in the file that are less")
    arguments = parser.parse_args(argv)
    if arguments.again and not (arguments.out and arguments.out.exists()):
        parser.error("--again needs --out with the results of a run")
    sizes = [(0.025, 0.02)] if arguments.quick else [(0.0125, 0.4), (0.0025, 0.15)]
    batches, until = (2, 0.05) if arguments.quick else (12, 4.0)
    build = gr.show_config()
    print(f"{build['isa']}, compiler {build['compiler']}; ns/particle-step")
    print(
        f"{'scheme':26s}{'points':>8s}  {'state':14s}{'1 thread':>9s}{'2':>7s}{'ratio':>7s}  error"
    )
    table = []
    for name, scheme in SCHEMES.items():
        errors = {columns: incline_error(scheme, columns, until) for columns in (1, 8)}
        for cell, fall in sizes:
            rows = speed(scheme, cell, fall, batches)
            for one, two in zip(rows[::2], rows[1::2], strict=True):
                print(
                    f"{name:26s}{one['points']:8d}  {one['state']:14s}{one['ns']:9.1f}"
                    f"{two['ns']:7.1f}{one['ns'] / two['ns']:7.2f}"
                    f"  {errors[1]:.4f} (1 column) {errors[8]:.4f} (8)",
                    flush=True,
                )
            table += [row | {"scheme": name, "incline_error": errors} for row in rows]
    space = []
    for name, scheme in SCHEMES.items():
        row = speed_3d(scheme, 0.025 if arguments.quick else 0.0125, batches // 2)
        print(f"{name:26s}{row['points']:8d}  {'3D':14s}{row['ns']:9.1f}", flush=True)
        space.append(row | {"scheme": name})
    results = {"isa": build["isa"], "incline_seconds": until, "rows": table, "space": space}
    if arguments.again:
        results = least(json.loads(arguments.out.read_text()), results)
    write(arguments.out, results)
