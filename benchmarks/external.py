"""Runs of the package beside data of other authors: tables, pictures, results.

    python benchmarks/external.py [--quick] [--only CASE ...] [--out FILE] [--pictures FOLDER]

The cases are those of `granular verify --external`. A case that is run replaces its entry in the
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


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of each case, with the time that its runs took."""
    return {
        name: [
            *markdown(HEADER, [cells_of(Comparison(**row)) for row in entry["rows"]]),
            "",
            f"Cost: {entry['core_seconds']:.0f} core-seconds.",
        ]
        for name, entry in results["cases"].items()
    }


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__doc__, "coarse runs of seconds")
    parser.add_argument("--only", nargs="*", choices=list(cases), help="cases to run")
    parser.add_argument("--pictures", type=Path, help="folder of the pictures")
    arguments = parser.parse_args(argv)
    results = stored(arguments.out, cases={})
    for name in list(cases) if arguments.only is None else arguments.only:
        outcome = cases[name].outcome(arguments.quick)
        rows = [asdict(row) for row in outcome.rows]
        found = {"rows": rows, "core_seconds": outcome.core_seconds}
        results["cases"][name] = rounded(found)
        for row in outcome.rows:
            print(f"{name}: " + " | ".join(cells_of(row)), flush=True)
        write(arguments.out, results, [name])
        if arguments.pictures:
            arguments.pictures.mkdir(parents=True, exist_ok=True)
            path = arguments.pictures / f"external_{name}.png"
            cases[name].picture(outcome).savefig(path, dpi=100)


if __name__ == "__main__":
    main()
