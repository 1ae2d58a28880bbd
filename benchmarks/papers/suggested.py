"""Figures of the documents as gr.economy suggests at 2 %, next to those of `papers`.

Each figure whose document has a modulus starts from that modulus, with what gr.economy suggests for
a tolerance of 2 %, or of what can be promised. A run that several figures need is made once.
Figures that are already in the file are not drawn again.

Not those of Haeri & Skonieczny: what softer grains change for tools in soil is not known, so that
nothing cheaper can be promised than the modulus of the document, with ten times the steps.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from shared import RESULTS, markdown, parser_of, rounded, stored, write

from granular.papers import DOCUMENTS, document
from papers.papers import numbers_of

TOLERANCE = 0.02
LEAST = {("dunatunga2015", "2"): 0.05, ("dunatunga2015", "11"): 0.04} | {
    ("dunatunga2015", name): 0.13 for name in ("3", "table_3")
}
"""Smallest tolerances that can be promised: for run-outs with the default scheme and with both, and
for the slug, see docs/reports/economy.md."""
PICTURES = Path("build/figures_suggested")


def tolerance_of(name: str, figure: str) -> float:
    return max(TOLERANCE, LEAST.get((name, figure), 0.0))


def row_of(name: str, figure: str, words: list[str]) -> dict[str, Any]:
    """Numbers of a figure, and the time that it took."""
    tolerance = tolerance_of(name, figure)
    words = [*words, "--tolerance", str(tolerance), "-o", str(PICTURES)]
    drawn = numbers_of(name, figure, words)
    return {
        "document": name,
        "figure": figure,
        "tolerance": tolerance,
        "numbers": rounded(drawn["numbers"], 6),
        "seconds": drawn["seconds"],
    }


def moved(row: dict[str, Any], before: dict[str, Any]) -> str:
    """Count the numbers that differ by more than the tolerance and three times their scatter."""
    pairs = [
        (value, row["numbers"][name], before["scatter"].get(name, 0.0))
        for name, value in before["numbers"].items()
        if not isinstance(value, str) and isinstance(row["numbers"].get(name), int | float)
    ]
    far = [
        abs(new - old) > row["tolerance"] * abs(old) + 3.0 * scatter for old, new, scatter in pairs
    ]
    return f"{sum(far)} of {len(far)}"


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page on economy: core-seconds as drawn and as suggested."""
    stored_rows = json.loads((RESULTS / "papers.json").read_text())["rows"]
    usual = {(row["document"], row["figure"]): row for row in stored_rows}
    lines, totals = [], [0.0, 0.0]
    place = {name: k for k, name in enumerate(DOCUMENTS)}
    order = {name: list(document(name).figures) for name in DOCUMENTS}
    for row in sorted(
        results["rows"],
        key=lambda row: (place[row["document"]], order[row["document"]].index(row["figure"])),
    ):
        before = usual.get((row["document"], row["figure"]))
        if before is None:
            continue
        totals[0] += before["seconds"]
        totals[1] += row["seconds"]
        lines.append(
            (
                row["document"],
                row["figure"].replace("_", " "),
                f"{100 * row['tolerance']:.0f} %",
                f"{before['seconds']:.0f}",
                f"{row['seconds']:.0f}",
                moved(row, before),
            )
        )
    lines.append(("all", "", "", f"{totals[0]:.0f}", f"{totals[1]:.0f}", ""))
    head = ("document", "figure", "tolerance", "core-seconds", "suggested", "numbers moved")
    return {"figures": markdown(head, lines)}


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__)
    known = ("dunatunga2015", "silo_clogging")
    parser.add_argument("documents", nargs="*", default=known, help=f"by default {known}")
    chosen = parser.parse_args(argv)
    results = stored(chosen.out, rows=[])
    there = {(row["document"], row["figure"]) for row in results["rows"]}
    for name in chosen.documents:
        for figure in sorted(document(name).figures.values(), key=lambda f: -f.seconds):
            if not figure.function or figure.E is None or (name, figure.name) in there:
                continue
            row = row_of(name, figure.name, ["--quick"] * chosen.quick)
            results["rows"].append(row)
            label = f"{name} {figure.name}"
            print(f"{label:28s}{row['seconds']:8.1f} s of a core", flush=True)
            write(chosen.out, results, [label])
