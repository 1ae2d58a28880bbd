"""Runs of the package compared with data of other authors: tables, pictures, results.

The cases are the ones of `granular verify --external`. A case that is run replaces its entry in the
file of results.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from shared import markdown, parser_of, rounded, stored, write

from granular.verify.external import cases
from granular.verify.external.frame import Comparison, cells_of

HEADER = ("quantity", "ours", "reference", "tolerance", "verdict")


COMPARED_WITH = {
    "bagnold": ("layer on an incline", "Bagnold's profile"),
    "chute": ("fed chute", "closed form"),
    "shallow": ("dam break and caps on slopes", "shallow-layer theory"),
    "limit_analysis": ("earth pressure, bearing capacity", "limit analysis"),
    "hstop": ("stopping height and speed, nonlocal law", "the equations of the law"),
    "contact_dynamics": ("collapse of columns", "discs, Lagrée et al. (2011)"),
    "runout_laws": ("run-out of columns and cylinders", "laws fitted to experiments"),
    "bars": ("collapse of a column of bars", "experiment, Bui et al. (2008)"),
}
"""Cases by their words in the summary, and the data they are compared with."""


def summary(cases: dict[str, Any]) -> list[str]:
    """One row a case: how many tolerances are met, without the published scheme."""
    lines = []
    for name, words in COMPARED_WITH.items():
        if name not in cases:
            continue
        rows = cases[name]["rows"]
        met = [
            row["passed"]
            for row in rows
            if row["passed"] is not None and "published" not in row["quantity"]
        ]
        lines.append((*words, f"{sum(met)} of {len(met)}", f"{cases[name]['core_seconds']:.0f}"))
    return markdown(("case", "compared with", "tolerances met", "core-seconds"), lines)


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of each case, with the time that its runs took, and a summary of all."""
    return {"summary": summary(results["cases"])} | {
        name: [
            *markdown(HEADER, [cells_of(Comparison(**row)) for row in entry["rows"]]),
            "",
            f"Cost: {entry['core_seconds']:.0f} core-seconds.",
        ]
        for name, entry in results["cases"].items()
    }


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "coarse runs of seconds")
    parser.add_argument("--only", nargs="*", choices=list(cases), help="cases to run")
    parser.add_argument("--pictures", type=Path, help="folder of the pictures")
    arguments = parser.parse_args(argv)
    results = stored(arguments.out, cases={})
    for name in list(cases) if arguments.only is None else arguments.only:
        outcome = cases[name].outcome(arguments.quick)
        rows = [asdict(row) for row in outcome.rows]
        result = {"rows": rows, "core_seconds": outcome.core_seconds}
        results["cases"][name] = rounded(result)
        for row in outcome.rows:
            print(f"{name}: " + " | ".join(cells_of(row)), flush=True)
        write(arguments.out, results, [name])
        if arguments.pictures:
            arguments.pictures.mkdir(parents=True, exist_ok=True)
            path = arguments.pictures / f"external_{name}.png"
            cases[name].picture(outcome).savefig(path)
