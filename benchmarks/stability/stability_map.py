"""The map of failure: measured limits of the methods.

Each cell of a map is a small run with a number and a verdict: *stable*, *degraded*, or *refused* if
the package does not start such a run. The number is then from a run without the limits, to show the
failures that the limits prevent. All maps are measured, or with --only those of some functions of
`MAKERS`; the other maps in the file remain.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from shared import parser_of, write

import granular as gr
from stability import arrangements, draw, elastic, flows, motions
from stability.cells import Cell, Map

MAKERS: dict[str, Callable[[bool], Map | list[Map]]] = {
    "patch": elastic.patches,
    "arrangement": arrangements.arrangements,
    "courant": elastic.courant_points,
    "courant_nu": elastic.courant_nu,
    "courant_space": elastic.courant_space,
    "courant_speed": elastic.courant_speed,
    "transfers": motions.transfers,
    "locking": motions.locking,
    "tearing": motions.tearing,
    "incline_courant": flows.incline_courant,
    "incline_angles": flows.incline_angles,
    "incline_columns": flows.incline_columns,
    "incline_seeding": flows.incline_seeding,
    "incline_refinement": flows.incline_refinement,
    "law_ends": flows.law_ends,
    "rest": flows.rest,
    "slug": flows.reconsolidation,
    "softness": flows.softness,
}


def measured(name: str, quick: bool) -> list[Map]:
    """Maps that a function makes."""
    made = MAKERS[name](quick)
    return made if isinstance(made, list) else [made]


def read(path: Path) -> dict[str, Map]:
    """Maps of a file, by name."""
    stored = json.loads(path.read_text())["maps"]
    for cell in (cell for m in stored for cell in m["cells"]):
        cell["value"] = math.nan if cell["value"] is None else float(cell["value"])
    maps = [Map(**(m | {"cells": [Cell(**c) for c in m["cells"]]})) for m in stored]
    return {m.name: m for m in maps}


def store(path: Path | None, maps: dict[str, Map]) -> None:
    """Write maps into a file."""
    head = {
        "granular": gr.__version__,
        "seconds": round(sum(c.seconds for m in maps.values() for c in m.cells), 1),
    }
    body = head | {"maps": [asdict(m) for m in maps.values()]}
    write(path, plain(body))


def plain(value: Any) -> Any:
    """Value as JSON can hold it: without nan and infinity, numbers rounded to four digits."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, float):
        if math.isnan(value):
            return None
        return float(f"{value:.4g}") if math.isfinite(value) else str(value)
    return value if isinstance(value, (bool, int, str, type(None))) else str(value)


def show(limits: Map) -> None:
    """Print a map."""
    print(f"{limits.name}: {limits.title}; {limits.quantity}")
    for cell in limits.cells:
        line = f"  {cell.row} | {cell.column} | {cell.value:.4g} {cell.verdict}"
        print(line + f" {cell.notes or ''}", flush=True)


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "a few short cases, to see it run")
    parser.add_argument("--only", nargs="+", choices=MAKERS, default=list(MAKERS), metavar="NAME")
    parser.add_argument("--figures", type=Path, help="folder for the figures")
    parser.add_argument("--draw", type=Path, help="draw a table, measure nothing")
    arguments = parser.parse_args(argv)
    if arguments.draw:
        maps = read(arguments.draw)
    else:
        maps = read(arguments.out) if arguments.out and arguments.out.exists() else {}
        for name in arguments.only:
            for limits in measured(name, arguments.quick):
                show(limits)
                maps[limits.name] = limits
            store(arguments.out, maps)
    if arguments.figures:
        draw.figures(maps, arguments.figures)
