"""Error against core-seconds for the schemes of this package and for its peers.

Runs every case of `accuracy/cases.py` that the table does not hold yet, one after the other with
one thread, and appends it, so that a benchmark that was stopped continues where it was. A case that
would take longer than the limit is left out, and its estimated cost stored. A peer that is not
installed (`pip install 'granular-flow[peers]'`) is left out with a message. Then the pictures of
docs/reports/accuracy.md are drawn. `--draw` runs nothing, and works on any machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from peers import codes
from shared import PICTURES, parser_of

import granular as gr
from accuracy import cases, chart, errors, runs, slopes
from accuracy import tables as of_page
from accuracy.results import Table

SHOWN = {
    "accuracy_inclines": ("incline", "incline_2d"),
    "accuracy_scenes": ("collapse", "runout", "silo"),
}
LIMIT = 200.0
"""Largest cost of a case [core-seconds]."""


def run(case: cases.Case, limit: float) -> dict[str, Any]:
    """Row of a case: its results, or the reason why there are none."""
    try:
        ours = case.solver == "granular"
        return runs.run(case, gr.Simulation if ours else codes.simulation(case.solver), limit)
    except (codes.Missing, runs.TooLong) as reason:
        return case.row() | {"left_out": str(reason)}
    except (gr.SimulationError, ValueError) as error:  # an outcome, too: it is in the table
        return case.row() | {"failed": str(error).splitlines()[0]}


def report(row: dict[str, Any]) -> str:
    """One line about a row."""
    name = (
        f"{row['scene']:11s}{row['scheme']:15s} E {row['E']:.0e} dx {row['cell']:.4g}"
        f" {row['points']:2d}/cell seed {row['seed']}"
    )
    for word in ("left_out", "failed"):
        if word in row:
            return f"{name} {word}: {row[word]}"
    names = ("profile_error", "mean_error", "runout_quantile", "runout_toe", "rate", "stress_free")
    text = " ".join(f"{n} {row[n]:.4g}" for n in names if row.get(n) is not None)
    return f"{name} {row['core_seconds']:8.2f} s {text}"


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page."""
    return of_page.tables(results["rows"])


def draw(rows: Sequence[errors.Row], figures: Path) -> None:
    """Draw the pictures of the page."""
    references = errors.references(rows)
    pictures = {name: chart.chart(rows, references, p) for name, p in SHOWN.items()}
    pictures["accuracy_trends"] = chart.trends(slopes.table(rows, references))
    figures.mkdir(parents=True, exist_ok=True)
    for name, picture in pictures.items():
        if picture:
            picture.savefig(figures / f"{name}.png")


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "a few coarse cases, to see it runs")
    parser.add_argument("--limit", type=float, default=LIMIT, help="core-seconds of a case")
    parser.add_argument("--figures", type=Path, default=PICTURES, help="folder of the pictures")
    parser.add_argument("--draw", action="store_true", help="draw the rows that exist")
    parser.add_argument("--only", help="run the cases of this scene, solver or scheme, draw all")
    chosen = parser.parse_args(argv)
    left = () if chosen.draw else cases.quick() if chosen.quick else cases.full()
    wanted = (c for c in left if chosen.only in (None, c.scene, c.solver, c.scheme))
    rows = Table(chosen.out, chosen.draw).run(wanted, lambda case: run(case, chosen.limit), report)
    draw(rows, chosen.figures)
