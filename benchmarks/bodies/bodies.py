"""Accuracy of bodies and of walls that are inclined to the grid.

Runs the cases of each row (`surfaces/`) and stores their numbers in the JSON file, one by one.
Cases that are in the file are not repeated, unless `--again` is given, so that it can be filled
piece by piece.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from shared import markdown, parser_of, rounded, stored, write

from bodies import flow, forces, moving, openings, rest
from bodies.rows import Line, Numbers, Row

ROWS: dict[str, Row] = {**rest.ROWS, **forces.ROWS, **flow.ROWS, **openings.ROWS, **moving.ROWS}

LEAK = 0.25
"""Depth in a body, in cells, from which on a point counts as leaked (`in_bodies` of the health)."""


MET = {True: "yes", False: "**no**", None: ""}


def measure(name: str, table: dict[str, Any], again: bool, quick: bool, out: Path) -> None:
    """Run the cases of a row that the table has not, and write it after each."""
    results = table["rows"].setdefault(name, {})
    for case, run in ROWS[name].cases(quick).items():
        if case in results and not again:
            continue
        begin = time.process_time()
        numbers = run()
        results[case] = rounded({**numbers, "seconds": time.process_time() - begin}, 5)
        print(f"{name} | {case} | {results[case]}", flush=True)
        write(out, table)


def leaks(rows: dict[str, dict[str, Numbers]]) -> Line:
    """Line of the table on the deepest point of all runs."""
    depth, row, case = max(
        (numbers["deepest"], row, case)
        for row, cases in rows.items()
        for case, numbers in cases.items()
    )
    text = f"{max(depth, 0.0):.2g} cells ({row}: {case})"
    return Line("deepest point in a body, all runs", f"{LEAK:g} cells", text, depth < LEAK)


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page, with a heading for each row of cases."""
    rows: dict[str, dict[str, Numbers]] = results["rows"]
    parts = [(row.title, row.lines(rows[name])) for name, row in ROWS.items() if rows.get(name)]
    if parts:
        parts.append(("Leaks", [leaks(rows)]))
    lines: list[tuple[str, ...]] = []
    for title, of_part in parts:
        lines.append((f"**{title}**", "", "", ""))
        lines += [(line.quantity, line.criterion, line.measured, MET[line.met]) for line in of_part]
    return {
        "summary": summary(rows),
        "bodies": markdown(("quantity", "asked", "measured", "met"), lines),
    }


def summary(rows: dict[str, dict[str, Numbers]]) -> list[str]:
    """One row for each row of cases: how many bounds are met."""
    lines = []
    for name, row in ROWS.items():
        if rows.get(name):
            met = [line.met for line in row.lines(rows[name]) if line.met is not None]
            lines.append((row.title, f"{sum(met)} of {len(met)}"))
    return markdown(("case", "bounds met"), lines)


def main(arguments: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, quick="one short case of each row, to see that it runs")
    parser.add_argument("--only", nargs="+", choices=ROWS, default=list(ROWS), metavar="NAME")
    parser.add_argument("--again", action="store_true", help="repeat the cases in the file")
    given = parser.parse_args(arguments)
    table = stored(given.out, rows={})
    for name in given.only:
        measure(name, table, given.again, given.quick, given.out)
