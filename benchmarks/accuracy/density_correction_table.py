"""The checks of the density correction, run for several schemes.

Runs checks of `granular.verify.density_correction` and
`granular.verify.density_correction_budget` (all of them by default) with each scheme, and stores
their rows in the JSON file together with the build and the processor time. Rows of other checks and
schemes that are in the file stay, so that it can be filled piece by piece: all of it takes hours.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from shared import commit, markdown, parser_of, stored, write

import granular as gr
from granular import verify
from granular.verify import layers

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
    commits = [sorted({r["commit"] for r in runs if r["scheme"] == name}) for name in names]
    lines.append(["commits", "", *map(", ".join, commits)])
    header = ("seed", "10 s", "20 s", "20 to 25 s")
    return {
        "density correction": markdown(("quantity", "asked", *names), lines),
        "pressure": markdown(header, [list(row.values()) for row in results["pressure"]]),
    }


def pressure_by_seed(seeds: int = 8) -> Iterator[dict[str, Any]]:
    """Error of the pressure by cell of the default scheme, in short windows and over five seconds.

    The layer is that of `density_correction_shear` with 4 points per cell, from rest.
    """
    for seed in range(seeds):
        sim = layers.layer(seed=seed)
        start, row = sim.state, {"seed": seed}
        for time_of_window in (10.0, 20.0):
            flow = layers.measured(sim.run(until=time_of_window), start)
            row[f"{time_of_window:g} s"] = round(flow.pressure, 4)
        squares = []
        for _ in range(20):
            state = sim.run(until=sim.time + 0.25).state
            squares.append(gr.measure.mean_pressure_error(state, of="pressure") ** 2)
        row["20 to 25 s"] = round(float(np.sqrt(np.mean(squares))), 4)
        print(row, flush=True)
        yield row


def main(arguments: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "stores nothing")
    parser.add_argument("--checks", nargs="*", choices=CHECKS, default=CHECKS)
    parser.add_argument("--schemes", nargs="*", choices=SCHEMES, default=list(SCHEMES))
    parser.add_argument("--pressure", action="store_true", help="scatter of the pressure alone")
    given = parser.parse_args(arguments)
    results = stored(given.out, rows=[], pressure=[])
    if given.pressure:
        results["pressure"] = list(pressure_by_seed())
        write(given.out, results, ["pressure"])
        return
    rows = results["rows"]
    for check in given.checks:
        for scheme in given.schemes:
            new = run(check, scheme)
            rows = [r for r in rows if (r["check"], r["scheme"]) != (check, scheme)] + [new]
            write(given.out, results | {"rows": rows}, ["density correction"])
