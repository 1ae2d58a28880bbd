"""The friction law over the inertial regime: shear cells by LAMMPS, their averages and fits.

The flows are those of `granular figure hurley_thesis 4.4`: two sets of grains, which differ in
restitution, and a shorter set between walls. A row is a flow. Flows that are already in the file
are not run again, so that a series can be stopped and continued.
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from shared import parser_of, stored, table, write

from granular import calibrate
from granular.grain_scale import friction_law
from granular.grain_scale.friction_law import SteadyShear
from granular.papers.hurley_thesis.shear_flows import (
    DENSITY,
    NAMES,
    PRESSURE,
    QUICK,
    RESTITUTION,
    SERIES,
    Case,
    grains,
    missing,
    points,
    row_of,
)


def fits(flows: list[SteadyShear], d: float) -> dict:
    """Constants of the laws of the thesis and of the rheology, with confidence intervals."""
    inertial = np.array([p.inertial_number for p in flows])
    slow = inertial < 0.1
    rheology = friction_law.fit_rheology(flows)
    table = {
        "rheology": rheology,
        "packing": calibrate.fit_packing(inertial, [p.packing_fraction for p in flows]),
        "coordination": friction_law.fit_coordination(inertial, [p.coordination for p in flows]),
        "viscoelastic": friction_law.fit_dissipation(flows, "viscoelastic"),
        "sliding": friction_law.fit_dissipation(flows, "sliding"),
    }
    dilation = np.array([p.coordination * p.packing_fraction / p.inertial_number for p in flows])
    for key, part in (("dilation_slow", slow), ("dilation_fast", ~slow)):
        if np.count_nonzero(part) >= 3:
            table[key] = friction_law.fit_power(inertial[part], dilation[part])
    rows = {name: _plain(fit) for name, fit in table.items()}
    material = rheology.material(d=d, rho_s=DENSITY)
    return rows | {"material": material.arguments()}


def _plain(fit: object) -> dict:
    """A fit as JSON holds it."""
    row = asdict(fit)  # type: ignore[call-overload]
    return {key: value for key, value in row.items() if key not in ("residuals", "packing")}


def line(row: dict) -> str:
    """A flow as printed."""
    p = SteadyShear(**row["flow"])
    ratio = p.friction_by_law / p.friction
    return (
        f"{row['set']:6s} I {p.inertial_number:.4f}  mu {p.friction:.4f} +- {p.friction_error:.4f}"
        f"  law/measured {ratio:.4f}  balance {p.balance:.4f} +- {p.law_error:.4f}"
        f"  phi {p.packing_fraction:.4f}  Z {p.coordination:.3f}"
        f"  mu_n {p.friction_viscoelastic:.4f}  {row['seconds']:.0f} s"
    )


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page: a row for each flow, by set and inertial number."""
    rows = [
        {
            "grains": words,
            "p": p,
            "law": p.friction_by_law / p.friction,
            "sliding": p.friction_sliding / p.friction_by_law,
        }
        for name, words in NAMES.items()
        for p in points(results["rows"], name)
    ]
    columns = {"grains": "{grains}", "I": "{p.inertial_number:.4f}"}
    columns |= {"mu (±)": "{p.friction:.3f} ({p.friction_error:.3f})", "law / mu": "{law:.3f}"}
    columns |= {"balance (±)": "{p.balance:.3f} ({p.law_error:.3f})", "sliding": "{sliding:.3f}"}
    columns |= {"phi": "{p.packing_fraction:.4f}", "Z": "{p.coordination:.2f}"}
    return {"flows": table(rows, columns | {"slipping": "{p.slipping:.2f}"})}


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "few grains, to see that it runs")
    parser.add_argument("--only", choices=tuple(SERIES), help="one set of grains")
    parser.add_argument("--timeout", type=float, default=7200.0, help="seconds a flow")
    chosen = parser.parse_args(argv)
    rows = stored(chosen.out, rows=[])["rows"]
    series: dict[str, tuple[Case, ...]] = QUICK if chosen.quick else SERIES
    if chosen.only:
        series = {chosen.only: series[chosen.only]}
    for name, case in list(missing(rows, series)):
        rows.append(row_of(name, case, chosen.timeout))
        print(line(rows[-1]), flush=True)
        _write(chosen.out, rows)
    _write(chosen.out, rows)


def _write(out: Path | None, rows: list[dict]) -> None:
    """The table so far, with the fits that it allows."""
    if out is None:
        return
    table: dict = {"pressure": PRESSURE, "grains": {n: asdict(grains(n)) for n in RESTITUTION}}
    table["fits"] = {
        name: fits(flows, grains(name).d_volume)
        for name in RESTITUTION
        if len(flows := points(rows, name)) >= 4
    }
    write(out, table | {"rows": rows})
