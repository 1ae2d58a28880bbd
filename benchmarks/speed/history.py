"""History of the speed: a few cases for this commit, as a row of results/history.json.

A ratio is the time of a particle-step times the peak rate of multiply-adds of the same core, which
is measured with each case: how many operations the core could have done meanwhile. So rows of a
machine that is faster on one day than on another can be compared. Other processors, compilers and
instruction sets are another kind of row: changes are against the last row of the same kind. One
thread; the best of several batches. A change of a tenth is noise on a busy machine.
"""

from __future__ import annotations

import os
from datetime import UTC, datetime
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported

from accuracy.results import head as kind_of_machine
from shared import RESULTS, commit, parser_of, rounded, stored, write

from speed.roofline import peak
from speed.speed import SCHEMES, speed, speed_3d

HISTORY = RESULTS / "history.json"
NAMES = ("linear flip", "cell averaged", "default")


def cases(quick: bool) -> dict[str, float]:
    """Time of a particle-step of each case, over the time of an operation at the peak rate."""
    cell, fall, batches, order = (0.025, 0.02, 1, 64) if quick else (0.0125, 0.4, 12, 512)
    ratios = {}
    for name in NAMES:
        before = peak(order)
        rows = speed(SCHEMES[name], cell, fall, batches)
        rows.append(speed_3d(SCHEMES[name], 2 * cell, batches) | {"state": "3D"})
        rate = max(before, peak(order))
        for row in rows:
            if row["threads"] == 1:
                state = "fallen" if row["state"].startswith("after") else row["state"]
                ratios[f"{name}, {state}"] = row["ns"] * 1e-9 * rate
    return ratios


def table(rows: list[dict[str, Any]], last: int) -> str:
    """Rows, newest last: ratios, and their change in percent from the row before of its kind."""
    names = list(rows[-1]["ratios"])
    lines = [f"{n}: {name}" for n, name in enumerate(names)]
    lines.append(f"{'date':17s}{'commit':10s}" + "".join(f"{n:>14d}" for n in range(len(names))))
    for at, row in enumerate(rows):
        if at < len(rows) - last:
            continue
        same = [old["ratios"] for old in rows[:at] if old["kind"] == row["kind"]]
        text = f"{row['date']:17s}{row['commit']:10s}"
        for name in names:
            new, old = row["ratios"].get(name), same[-1].get(name) if same else None
            change = f"{100 * (new / old - 1):+.0f} %" if new and old else ""
            text += f"{new:7.0f}{change:>7s}" if new else f"{'':14s}"
        lines.append(text)
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__)
    parser.add_argument("--last", type=int, default=8, help="rows to print")
    arguments = parser.parse_args(argv)
    rows = stored(arguments.out, rows=[])["rows"]
    row: dict[str, Any] = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M"),
        "commit": commit(),
        "kind": kind_of_machine(),
    }
    row["ratios"] = rounded(cases(arguments.quick), 4)
    write(arguments.out, {"rows": [*rows, row]})
    print(table([*rows, row], arguments.last))
