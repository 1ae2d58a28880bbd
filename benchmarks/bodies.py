"""Accuracy of bodies and of walls that are inclined to the grid.

    python benchmarks/bodies.py [--only NAME ...] [--again] [--quick] [--out FILE] [--page FILE]

Runs the cases of each row (`surfaces/`) and stores their numbers in the JSON file, one by one.
Cases that are in the file are kept, unless `--again` is given, so that it can be filled piece by
piece. `--page` writes the table into a page, between two lines that mark its place.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from shared import machine, parser_of, rounded, write, write_tables
from surfaces import flow, forces, moving, openings, rest
from surfaces.rows import Line, Numbers, Row

RESULTS = Path(__file__).parent / "results" / "bodies.json"

ROWS: dict[str, Row] = {**rest.ROWS, **forces.ROWS, **flow.ROWS, **openings.ROWS, **moving.ROWS}

LEAK = 0.25
"""Depth in a body, in cells, from which on a point counts as leaked (`in_bodies` of the health)."""


def measure(name: str, table: dict[str, Any], again: bool, quick: bool, out: Path) -> None:
    """Run the cases of a row that the table has not, and write it after each."""
    found = table["rows"].setdefault(name, {})
    for case, run in ROWS[name].cases(quick).items():
        if case in found and not again:
            continue
        begin = time.process_time()
        numbers = run()
        found[case] = rounded({**numbers, "seconds": time.process_time() - begin}, 5)
        print(f"{name} | {case} | {found[case]}", flush=True)
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


def lines(rows: dict[str, dict[str, Numbers]]) -> list[str]:
    """The table in Markdown."""
    found = ["| quantity | asked | measured | met |", "|---|---|---|---|"]
    for name, row in ROWS.items():
        if rows.get(name):
            found.append(f"| **{row.title}** | | | |")
            found += map(_row, row.lines(rows[name]))
    found += ["| **Leaks** | | | |", _row(leaks(rows))] if any(rows.values()) else []
    return found


def _row(line: Line) -> str:
    met = {True: "yes", False: "**no**", None: ""}[line.met]
    return f"| {line.quantity} | {line.asked} | {line.measured} | {met} |"


def main(arguments: list[str] | None = None) -> None:
    parser = parser_of(__doc__, quick="one short case of each row, to see that it runs")
    parser.set_defaults(out=RESULTS)
    parser.add_argument("--only", nargs="+", choices=ROWS, default=list(ROWS), metavar="NAME")
    parser.add_argument("--again", action="store_true", help="measure what is in the file anew")
    parser.add_argument("--page", type=Path, help="page whose table is to be renewed")
    given = parser.parse_args(arguments)
    table = json.loads(given.out.read_text()) if given.out.exists() else {"rows": {}}
    table["head"] = machine()
    for name in given.only:
        measure(name, table, given.again, given.quick, given.out)
    if given.page:
        write_tables(given.page, {"": lines(table["rows"])})


if __name__ == "__main__":
    main()
