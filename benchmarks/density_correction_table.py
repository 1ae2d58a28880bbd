"""The checks of the density correction, run for several schemes.

    python benchmarks/density_correction_table.py [--checks NAME ...] [--schemes NAME ...]
                                                  [--page FILE]

Runs checks of `granular.verify.density_correction` and
`granular.verify.density_correction_budget` (all of them by default) with each scheme, and stores
their rows in the JSON file together with the build and the processor time. Rows of other checks and
schemes that are in the file stay, so that it can be filled piece by piece: all of it takes hours.
`--page` writes the table into a page, between two lines that mark its place.
"""

from __future__ import annotations

import argparse
import json
import platform
import subprocess
import time
from pathlib import Path

from shared import write, write_tables

import granular as gr
from granular import verify

RESULTS = Path(__file__).parent / "results" / "density_correction_table.json"

SCHEMES = {
    "default": gr.schemes.default,
    "averaging_time=4": gr.schemes.default.replace(density=gr.SmoothedDensity(averaging_time=4.0)),
    "averaging_time=8": gr.schemes.default.replace(density=gr.SmoothedDensity(averaging_time=8.0)),
    "default without weights": gr.Scheme(density=gr.SmoothedDensity(weight_correction=0.0)),
    "cell averaged": gr.schemes.cell_averaged,
    "published": gr.schemes.dunatunga_kamrin_2015.replace(dt=None),
    "quadratic FLIP": gr.Scheme(basis="quadratic", transfer="flip"),
    "quadratic APIC": gr.Scheme(basis="quadratic", transfer="apic"),
}

CHECKS = tuple(name for name in verify.checks if name.startswith("density_correction_"))


def commit() -> str:
    """Commit of the working tree, with a + if files have changed since."""
    command = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty=+"]
    return subprocess.run(command, capture_output=True, text=True).stdout.strip() or "unknown"


def run(check: str, scheme: str) -> dict:
    """Rows of a check with a scheme, and their processor time."""
    begin, rows = time.process_time(), []
    try:
        for row in verify.checks[check].run(SCHEMES[scheme]):
            rows.append([row.quantity, row.measured, row.expected, row.passed])
            print(f"{check} | {scheme} | {' | '.join(map(str, rows[-1]))}", flush=True)
    except (ArithmeticError, RuntimeError, ValueError) as error:
        rows.append([f"{type(error).__name__}: {error}", "stopped", "no error", False])
        print(f"{check} | {scheme} | {rows[-1][0]}", flush=True)
    return {
        "check": check,
        "scheme": scheme,
        "seconds": round(time.process_time() - begin, 1),
        "machine": platform.machine(),
        "compiler": gr.show_config()["compiler"],
        "isa": gr.show_config()["isa"],
        "commit": commit(),
        "rows": rows,
    }


def lines(results: list[dict]) -> list[str]:
    """The table in Markdown: a row for each quantity, a column for each scheme."""
    names = [name for name in SCHEMES if any(r["scheme"] == name for r in results)]
    found = ["| quantity | asked | " + " | ".join(names) + " |", "|---" * (2 + len(names)) + "|"]
    for check in CHECKS:
        of_check = {r["scheme"]: r["rows"] for r in results if r["check"] == check}
        quantities = {row[0]: row[2] for rows in of_check.values() for row in rows}
        if of_check:
            found.append(f"| **{check}** | " + " | " * len(names) + " |")
        for quantity, expected in quantities.items():
            cells = []
            for name in names:
                row = next((r for r in of_check.get(name, ()) if r[0] == quantity), None)
                mark = "" if row is None or row[3] is not False else " **!**"
                cells.append("" if row is None else row[1] + mark)
            text = quantity.replace("|", "\\|")
            found.append(f"| {text} | {expected} | " + " | ".join(cells) + " |")
    return found


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--checks", nargs="*", choices=CHECKS, default=CHECKS)
    parser.add_argument("--schemes", nargs="*", choices=SCHEMES, default=list(SCHEMES))
    parser.add_argument("--out", type=Path, default=RESULTS, help="JSON file to keep rows in")
    parser.add_argument("--page", type=Path, help="page whose table is to be renewed")
    given = parser.parse_args(arguments)
    results = json.loads(given.out.read_text()) if given.out.exists() else []
    for check in given.checks:
        for scheme in given.schemes:
            new = run(check, scheme)
            results = [r for r in results if (r["check"], r["scheme"]) != (check, scheme)] + [new]
            write(given.out, results)
    if given.page:
        write_tables(given.page, {"": lines(results)})


if __name__ == "__main__":
    main()
