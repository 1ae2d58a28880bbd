"""The checks of the density correction, run for several schemes.

Runs checks of `granular.verify.density_correction` and
`granular.verify.density_correction_budget` (all of them by default) with each scheme, and stores
their rows in the JSON file together with the build and the processor time. Rows of other checks and
schemes that are in the file stay, so that it can be filled piece by piece: all of it takes hours.
"""

from __future__ import annotations

import time
from typing import Any

from shared import commit, markdown, parser_of, stored, write

import granular as gr
from granular import verify

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
        "compiler": gr.show_config()["compiler"],
        "isa": gr.show_config()["isa"],
        "commit": commit(),
        "rows": rows,
    }


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page: a row for each quantity, a column for each scheme."""
    runs = results["rows"]
    names = [name for name in SCHEMES if any(r["scheme"] == name for r in runs)]
    lines: list[list[str]] = []
    for check in CHECKS:
        of_check = {r["scheme"]: r["rows"] for r in runs if r["check"] == check}
        quantities = {row[0]: row[2] for rows in of_check.values() for row in rows}
        if of_check:
            lines.append([f"**{check}**", *[""] * (1 + len(names))])
        for quantity, expected in quantities.items():
            cells = []
            for name in names:
                row = next((r for r in of_check.get(name, ()) if r[0] == quantity), None)
                mark = "" if row is None or row[3] is not False else " **!**"
                cells.append("" if row is None else row[1] + mark)
            lines.append([quantity.replace("|", "\\|"), expected, *cells])
    return {"density correction": markdown(("quantity", "asked", *names), lines)}


def main(arguments: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "stores nothing")
    parser.add_argument("--checks", nargs="*", choices=CHECKS, default=CHECKS)
    parser.add_argument("--schemes", nargs="*", choices=SCHEMES, default=list(SCHEMES))
    given = parser.parse_args(arguments)
    rows = stored(given.out, rows=[])["rows"]
    for check in given.checks:
        for scheme in given.schemes:
            new = run(check, scheme)
            rows = [r for r in rows if (r["check"], r["scheme"]) != (check, scheme)] + [new]
            write(given.out, {"rows": rows})
