"""History of the speed: a few cases for this commit, as a row of results/history.json.

A ratio is the time of a particle-step times the peak rate of multiply-adds of the same core, which
is measured with each case: how many operations the core could have done meanwhile. So rows of a
machine that is faster on one day than on another can be compared. Other processors, compilers and
instruction sets are another kind of row: changes are against the last row of the same kind. One
thread; the best of several batches. A change of a tenth is noise on a busy machine.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from accuracy.results import head as kind_of_machine
from shared import commit, parser_of, rounded, stored, write

from speed.machine import peak
from speed.speed import FLOWS, times

NAMES = ("linear flip", "cell averaged", "default")


CASES = ((2, 10_000, 0.0), (2, 10_000, FLOWS), (2, 100_000, 0.0), (3, 10_000, 0.0))
"""Dimension, points and time of a state, with 4 points in a cell in 2D and 8 in 3D."""


def cases(quick: bool) -> dict[str, float]:
    """Time of a particle-step of each case, over the time of an operation at the peak rate."""
    batches, turns = (1, 10_000) if quick else (12, 1_000_000)
    ratios = {}
    for name in NAMES:
        for dim, points, fall in CASES:
            few, short = (2000, min(fall, 0.01)) if quick else (points, fall)
            before = peak(turns)
            row, _ = times(name, few, dim, 2**dim, short, batches)
            rate = max(before, peak(turns))
            ratios[f"{name}, {dim}D {points:,}, {row['state']}"] = row["ns"] * 1e-9 * rate
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
        "commit": commit("benchmarks/*.py"),
        "kind": kind_of_machine(),
    }
    row["ratios"] = rounded(cases(arguments.quick), 4)
    write(arguments.out, {"rows": [*rows, row]})
    print(table([*rows, row], arguments.last))
