"""Time per particle-step of the kernels, with the error of the same schemes.

Columns of aspect 2 with 4 and 16 points in a cell, and quarters of cylinders with 8 and 27, of ten
thousand to a million points, with one thread and with two. They are timed as seeded, the smaller
ones also after 0.15 s of their collapse. One thread is timed by the processor time of the process,
two by the wall clock. The best of several batches counts; only the ratios within one run can be
compared, and the capability of the machine is measured with them. Each scheme also has its error on
the periodic incline of 25 degrees, with one column of cells and with eight, against the
one-dimensional equation: a fast scheme that is wrong is no bargain.

On a machine that others disturb, run it several times: with --again the smaller of each time and
the one in the file is stored.

`granular.economy.cost` reads `granular/economy/step_times.json`, which this script writes with
results/speed.json.
"""

from __future__ import annotations

import json
import time
from typing import Any

from shared import RESULTS, ROOT, least_time, markdown, parser_of, rounded, write
from stability.flows import error_of_profile

import granular as gr
from granular.economy import pace
from speed.machine import capability

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
SIZES = (10_000, 32_000, 100_000, 320_000, 1_000_000)
STATES = {(2, 4): SIZES, (2, 16): SIZES, (3, 8): SIZES, (3, 27): SIZES[::2]}
"""Numbers of points, by dimension and points in a cell."""
FLOWS = 0.15
"""Time at which a column or cylinder flows [s]."""
FLOWING = {(2, 4): (10_000, 100_000), (2, 16): (10_000,), (3, 8): (10_000, 100_000)}
"""Numbers of points of the states that are also timed in flow."""
TIMES = ROOT / "granular" / "economy" / "step_times.json"


def best_time(sim: gr.Simulation, threads: int, batches: int) -> float:
    """Seconds per particle-step, the best of several batches of about 50 ms each."""
    clock = time.process_time if threads == 1 else time.perf_counter
    steps = max(int(0.05 / (40e-9 * sim.n_points)), 1)
    return least_time(lambda: sim.step(steps), batches, clock) / (steps * sim.n_points)


def scene_of(scheme: gr.Scheme, points: float, dim: int, per_cell: int) -> gr.Scene:
    """A column of aspect 2 of about so many points, or in 3D a quarter of a cylinder."""
    given: dict[str, Any] = {"material": MATERIAL, "scheme": scheme, "points_per_cell": per_cell}
    length = 0.2  # half width, or radius
    if dim == 2:
        cells = round((points / (2 * per_cell)) ** 0.5)
        return gr.scenes.column_collapse(cell=length / max(cells, 2), aspect=2.0, **given)
    coarse = gr.Simulation(gr.scenes.cylinder_collapse(cell=length / 10, **given), threads=1)
    cells = round(10 * (points / coarse.n_points) ** (1 / 3))
    return gr.scenes.cylinder_collapse(cell=length / max(cells, 2), **given)


def started(scene: gr.Scene, fall: float) -> gr.Checkpoint:
    """State in which cells are equally full (`fall` 0), or after a time [s]."""
    sim = gr.Simulation(scene, threads=2)
    sim.step(5)
    return (sim.run(until=fall, monitor=False) if fall else sim).checkpoint()


def times(
    name: str, points: float, dim: int, per_cell: int, fall: float, batches: int
) -> list[dict[str, Any]]:
    """Times of a scheme in a state of about so many points, with one thread and with two."""
    scene = scene_of(SCHEMES[name], points, dim, per_cell)
    start = started(scene, fall)
    rows = []
    for threads in (1, 2):
        sim = gr.Simulation.from_checkpoint(scene, start, threads=threads)
        sim.step(2)
        row = {"scheme": name, "dim": dim, "per_cell": per_cell, "size": points}
        row |= {"points": sim.n_points, "state": "flowing" if fall else "seeded"}
        rows.append(row | {"threads": threads, "ns": best_time(sim, threads, batches) * 1e9})
    return rows


def incline_error(scheme: gr.Scheme, columns: int, until: float) -> float:
    """Relative L2 error of the velocity profile on the incline of 25 degrees, 9 points per cell."""
    scene = gr.scenes.incline(
        cell=0.01, columns=columns, points_per_cell=9, jitter=0.6, material=MATERIAL, scheme=scheme
    )
    return error_of_profile(gr.Simulation(scene, threads=1).run(until=until).state)


def of(results: dict[str, Any], scheme: str, **chosen: Any) -> dict[int, list[float]]:
    """Times [ns] of a scheme by the number of points that was asked for, one thread first."""
    by_size: dict[int, list[float]] = {}
    for row in results["rows"]:
        if row["scheme"] == scheme and all(row[key] == value for key, value in chosen.items()):
            by_size.setdefault(row["size"], []).append(row["ns"])
    return by_size


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the pages: a summary, the machine, the errors, and times by points in a cell."""
    machine = [(name.partition(" [")[0], f"{rate:.0f} {name[name.index('[') + 1 : -1]}")
               for name, rate in results["machine"].items()]  # fmt: skip
    errors = [
        (scheme, *(f"{error:.2g}" for error in found.values()))
        for scheme, found in results["errors"].items()
    ]
    made = {
        "summary": summary(results),
        "machine": markdown(("one core", "rate"), machine),
        "errors": markdown(("scheme", "1 column", "8 columns"), errors),
    }
    for dim, per_cell in sorted({(row["dim"], row["per_cell"]) for row in results["rows"]}):
        made[f"{dim}D, {per_cell} in a cell"] = times_table(results, dim, per_cell)
    return made


def times_table(results: dict[str, Any], dim: int, per_cell: int) -> list[str]:
    """Times with one thread and with two, by the number of points and the state."""
    head, lines = ["scheme"], []
    for scheme in results["errors"]:
        line = [scheme]
        for state in ("seeded", "flowing"):
            chosen = of(results, scheme, dim=dim, per_cell=per_cell, state=state)
            line += [" / ".join(f"{ns:.1f}" for ns in both) for both in chosen.values()]
            if not lines:
                head += [f"{size:,}{', flowing' * (state == 'flowing')}" for size in chosen]
        lines.append(line)
    return markdown(head, lines)


def summary(results: dict[str, Any]) -> list[str]:
    """Times of four schemes [ns] with 4 points in a cell, and 8 in 3D, in and out of the caches."""
    lines = []
    for scheme in ("linear flip", "cell averaged", "default", "default, single precision"):
        plane, space = (
            of(results, scheme, dim=dim, per_cell=2**dim, state="seeded") for dim in (2, 3)
        )
        few, many = min(plane), 100_000 if 100_000 in plane else max(plane)
        numbers = (*plane[few], plane[many][0], space[few][0], space[many][0])
        lines.append((scheme, *(f"{ns:.1f}" for ns in numbers)))
    head = (f"2D, {few:,} points", "two threads", f"2D, {many:,}", f"3D, {few:,}", f"3D, {many:,}")
    return markdown(("scheme", *head), lines)


def step_times(results: dict[str, Any]) -> dict[str, Any]:
    """Times of one thread for `granular.economy`: dimension: scheme: points in a cell: rows.

    A row has a number of points and the time [ns], the mean of seeded and flowing: that of the
    largest flow for all sizes beyond it.
    """
    known: dict[str, Any] = {"2": {}, "3": {}}
    for row in results["rows"]:
        if row["threads"] == 1 and row["state"] == "seeded":
            of_scheme = known[str(row["dim"])].setdefault(row["scheme"], {})
            ns = rounded(row["ns"] * (1 + slower(results, row)) / 2, 3)
            of_scheme.setdefault(str(row["per_cell"]), []).append([row["points"], ns])
    return {"reference": rounded(results["reference"], 3), **known}


def slower(results: dict[str, Any], row: dict[str, Any]) -> float:
    """Time in flow over that of a state as seeded: the last one of no more points, or the first."""
    chosen = {"dim": row["dim"], "per_cell": row["per_cell"]}
    flowing = of(results, row["scheme"], state="flowing", **chosen)
    if not flowing:  # as with fewer points in a cell
        chosen["per_cell"] = min(r["per_cell"] for r in results["rows"] if r["dim"] == row["dim"])
        flowing = of(results, row["scheme"], state="flowing", **chosen)
    seeded = of(results, row["scheme"], state="seeded", **chosen)
    size = max((n for n in flowing if n <= row["size"]), default=min(flowing))
    return flowing[size][0] / seeded[size][0]


def least(before: dict[str, Any], now: dict[str, Any]) -> dict[str, Any]:
    """Return the results of two runs on one machine with the smaller time of each row."""
    if before["isa"] != now["isa"]:
        raise SystemExit("the file has results of another instruction set")
    for old, new in zip(before["rows"], now["rows"], strict=True):
        if any(old[key] != new[key] for key in new if key != "ns"):
            raise SystemExit("the file has other rows")
        new["ns"] = min(old["ns"], new["ns"])
    for name, rate in before["machine"].items():
        now["machine"][name] = max(rate, now["machine"][name])
    now["reference"] = min(before["reference"], now["reference"])
    return now


def measured(quick: bool) -> dict[str, Any]:
    """Times of all schemes and states, their errors, and what the machine can do."""
    batches, until = (2, 0.05) if quick else (12, 4.0)
    states = {(2, 4): (2000,), (3, 8): (2000,)} if quick else STATES
    flowing = {(2, 4): (2000,), (3, 8): (2000,)} if quick else FLOWING
    fall = 0.01 if quick else FLOWS
    machine = capability(quick)
    rows: list[dict[str, Any]] = []
    errors: dict[str, dict[int, float]] = {}
    for name, scheme in SCHEMES.items():
        errors[name] = {columns: incline_error(scheme, columns, until) for columns in (1, 8)}
        for (dim, per_cell), sizes in states.items():
            cases = [(n, 0.0) for n in sizes]
            cases += [(n, fall) for n in flowing.get((dim, per_cell), ())]
            for points, time_ in cases:
                one, two = times(name, points, dim, per_cell, time_, batches)
                rows += [one, two]
                print(
                    f"{name:26s}{dim}D{per_cell:4d} in a cell{one['points']:9d}  "
                    f"{one['state']:8s}{one['ns']:8.1f}{two['ns']:8.1f}",
                    flush=True,
                )
    return {
        "isa": gr.show_config()["isa"],
        "incline_seconds": until,
        "machine": rounded(machine, 3),
        "reference": pace.reference_time() * 1e9,
        "errors": rounded(errors, 4),
        "rows": rounded(rows, 4),
    }


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__)
    parser.add_argument("--again", action="store_true", help="keep times in the file that are less")
    arguments = parser.parse_args(argv)
    if arguments.again and not (arguments.out and arguments.out.exists()):
        parser.error("--again needs --out with the results of a run")
    results = measured(arguments.quick)
    if arguments.again:
        results = least(json.loads(arguments.out.read_text()), results)
    write(arguments.out, results)
    if arguments.out == RESULTS / "speed.json":
        TIMES.write_text(json.dumps(step_times(results), indent=1) + "\n")
        print(f"wrote {TIMES.relative_to(ROOT)}, which `granular.economy.cost` reads")
