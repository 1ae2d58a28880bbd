"""Runs of the package beside data of other authors: tables, pictures, results.

    python benchmarks/external.py [--quick] [--only CASE ...] [--out FILE] [--page FILE]
        [--pictures FOLDER]

The cases are those of `granular verify --external`. A case that is run replaces its entry in the
file of results; the page is written from the whole file.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from shared import machine, markdown, parser_of, rounded, write, write_tables

from granular.verify.external import cases
from granular.verify.external.frame import Comparison, cells_of

HEADER = ("quantity", "ours", "reference", "tolerance", "verdict")


def table(entry: dict) -> list[str]:
    """Markdown of one case, with the time that its runs took."""
    rows = [cells_of(Comparison(**row)) for row in entry["rows"]]
    return [*markdown(HEADER, rows), "", f"Cost: {entry['core_seconds']:.0f} core-seconds."]


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__doc__, "coarse runs of seconds")
    parser.add_argument("--only", nargs="*", choices=list(cases), help="cases to run")
    parser.add_argument("--page", type=Path, help="page whose tables are written")
    parser.add_argument("--pictures", type=Path, help="folder of the pictures")
    arguments = parser.parse_args(argv)
    known = arguments.out is not None and arguments.out.exists()
    results = json.loads(arguments.out.read_text())["cases"] if known else {}
    for name in list(cases) if arguments.only is None else arguments.only:
        outcome = cases[name].outcome(arguments.quick)
        rows = [asdict(row) for row in outcome.rows]
        results[name] = {"rows": rows, "core_seconds": outcome.core_seconds}
        for row in outcome.rows:
            print(f"{name}: " + " | ".join(cells_of(row)), flush=True)
        write(arguments.out, machine() | {"cases": rounded(results)})
        if arguments.pictures:
            arguments.pictures.mkdir(parents=True, exist_ok=True)
            path = arguments.pictures / f"external_{name}.png"
            cases[name].picture(outcome).savefig(path, dpi=100)
    if arguments.page:
        write_tables(arguments.page, {name: table(entry) for name, entry in results.items()})


if __name__ == "__main__":
    main()
