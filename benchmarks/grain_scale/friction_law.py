"""The friction law over the inertial regime: shear cells by LAMMPS, their averages and fits.

There are two sets of grains as in chapter 4 of Hurley's thesis, which differ in restitution (its
figure with the values is lost: 0.5 and 0.85 at an impact speed of a tenth of sqrt(p/rho_s) are
chosen here), and a shorter set between walls. A row is a flow. Flows that are already in the file
are not run again, so that a series can be stopped and continued. The figures are drawn from the
file.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from shared import parser_of, stored, table, write

from granular import calibrate
from granular.grain_scale import dem, friction_law
from granular.grain_scale.friction_law import SteadyShear

PRESSURE = 1e3
"""Pressure [Pa]; kn is 10^6 times as large, so that (kn/p)^(2/3) = 10^4 as in the thesis."""
SIZE, DENSITY = 1e-3, 2500.0
IMPACT = 0.1 * (PRESSURE / DENSITY) ** 0.5
"""Impact speed [m/s] at which the restitution is the one of the set."""
RESTITUTION = {"low": 0.5, "high": 0.85, "walls": 0.5}


@dataclass(frozen=True)
class Case:
    """One flow of the series."""

    inertial_number: float
    approach: float
    strain: float
    frames: int
    count: int = 800
    seed: int = 0


SERIES = {
    "low": (
        Case(0.1, 2.0, 6.0, 1000),
        Case(0.4, 4.0, 14.0, 1000),
        Case(1.1, 6.0, 40.0, 2500),
        Case(0.01, 0.4, 1.2, 600),
        Case(0.03, 0.8, 2.0, 600),
        Case(0.2, 2.0, 6.0, 600),
        Case(0.7, 5.0, 30.0, 2000),
        Case(0.003, 0.5, 2.0, 1000, 500),
        Case(0.001, 0.3, 1.2, 1000, 500),
    ),
    "high": (Case(0.1, 2.0, 5.0, 600), Case(0.4, 3.0, 14.0, 1000), Case(1.1, 6.0, 40.0, 2500)),
    "walls": (Case(0.3, 5.0, 8.0, 500),),
}
QUICK = {
    "low": tuple(Case(i, 1.0, 3.0, 60, 100) for i in (0.1, 0.3, 0.6, 1.0)),
    "walls": (Case(0.3, 2.0, 2.0, 60, 200),),
}


def grains(name: str) -> dem.Grains:
    """The grains of a set."""
    plain = dem.Grains(d=SIZE, rho_s=DENSITY, kn=1e6 * PRESSURE)
    return plain.with_restitution(RESTITUTION[name], IMPACT)


def flow(name: str, case: Case, timeout: float) -> SteadyShear:
    """Run one case."""
    settings = dem.Shear(
        grains=grains(name),
        pressure=PRESSURE,
        drive="walls" if name == "walls" else "homogeneous",
        aspect=2.0 if name == "walls" else 1.0,
        **asdict(case),
    )
    return friction_law.steady_shear(settings, timeout=timeout)


def points(rows: Iterable[dict], name: str) -> list[SteadyShear]:
    """Flows of a set in a file, by their inertial number."""
    flows = [SteadyShear(**row["flow"]) for row in rows if row["set"] == name]
    return sorted(flows, key=lambda point: point.inertial_number)


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


GRAINS = {"low": "e = 0.5", "high": "e = 0.85", "walls": "walls, e = 0.5"}


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page: a row for each flow, by set and inertial number."""
    rows = [
        {
            "grains": words,
            "p": p,
            "law": p.friction_by_law / p.friction,
            "sliding": p.friction_sliding / p.friction_by_law,
        }
        for name, words in GRAINS.items()
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
    for name, cases in (QUICK if chosen.quick else SERIES).items():
        for case in cases if chosen.only in (None, name) else ():
            if any(row["set"] == name and row["case"] == asdict(case) for row in rows):
                continue
            begin = time.perf_counter()
            steady = flow(name, case, chosen.timeout)
            seconds = round(time.perf_counter() - begin, 1)
            row = {"set": name, "case": asdict(case), "seconds": seconds, "flow": asdict(steady)}
            rows.append(row)
            print(line(row), flush=True)
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
