"""Columns of contact dynamics by this package and by other codes: error against core-seconds.

Runs every case that the file of results does not hold yet, each with one thread and on one core,
and appends it, so that a benchmark that was stopped continues where it was. A case that would take
longer than the limit is left out, and its estimated cost stored, as is a code that is not installed
(`pip install 'granular-flow[peers]'`). `--draw` runs nothing. docs/reports/peers.md explains the
result.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from accuracy.results import Table
from shared import PICTURES, parser_of

from peers import columns, columns_chart, columns_tables
from peers.columns import ASPECTS, CODES, Column
from peers.columns_errors import Row, references

LIMIT = 100.0
"""Largest cost of a case [core-seconds]."""
SIZES = [(4, 4), (8, 4), (16, 4), (4, 16), (8, 16), (32, 4)]
"""Cells along the lesser of height and half-width, and points per cell."""
COSTLY = ("newton", "newton_long", "kratos", "kratos_implicit")
MOST_CELLS = {"published": 16, "taichi_sand": 8} | dict.fromkeys(COSTLY, 16)
"""Cells in the finest run of a code, if not the most of all."""
FOUR_ONLY = (*COSTLY, "published", "taichi_sand", "taichi_wall")
"""Codes that are run with 4 points per cell only."""
TALL = 6.26
"""Column whose half-width is a sixth of its height: up to 16 cells, and with 4 points only."""


def cases(names: Sequence[str], quick: bool = False) -> Iterator[Column]:
    """Cases of some codes, the cheap ones first."""
    for cells, points in SIZES[:1] if quick else SIZES:
        for name in names:
            if cells > MOST_CELLS.get(name, cells) or (points > 4 and name in FOUR_ONLY):
                continue
            for law, aspect in product(CODES[name].laws, ASPECTS[1:2] if quick else ASPECTS):
                if aspect < TALL or (cells <= 16 and points == 4):
                    yield Column(code=name, law=law, aspect=aspect, cells=cells, points=points)


def report(row: Row) -> str:
    """One line about a row."""
    name = f"{row['code']:16s}{row['law']:15s} a = {row['aspect']:<5g}"
    name += f"{row['cells']:3d} cells {row['points']:2d} points"
    for word in ("left_out", "failed"):
        if word in row:
            return f"{name} {word}: {row[word]}"
    return (
        f"{name} {row['core_seconds']:9.3f} s run-out {row['toe']:.4g} mean {row['mean'][-1]:.4g}"
    )


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page."""
    return columns_tables.tables(results["rows"])


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "a coarse case of each code, to see it runs")
    parser.add_argument("--limit", type=float, default=LIMIT, help="core-seconds of a case")
    parser.add_argument(
        "--only", nargs="*", choices=list(CODES), default=list(CODES), help="codes to run"
    )
    parser.add_argument("--core", type=int, help="number of the core to stay on")
    parser.add_argument("--pictures", type=Path, default=PICTURES, help="folder of the pictures")
    parser.add_argument("--draw", action="store_true", help="draw the rows that exist")
    chosen = parser.parse_args(argv)
    if chosen.core is not None:
        os.sched_setaffinity(0, {chosen.core})
    left = [] if chosen.draw else cases(chosen.only, chosen.quick)
    rows = Table(chosen.out, chosen.draw).run(
        left, lambda case: columns.run(case, chosen.limit), report
    )
    chosen.pictures.mkdir(parents=True, exist_ok=True)
    if picture := columns_chart.chart(rows, references(rows)):
        picture.savefig(chosen.pictures / "peers.png")
