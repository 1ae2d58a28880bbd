"""Sheared grains of chapter 4: flows by LAMMPS, or stored ones.

There are two sets of grains as in the thesis, which differ in restitution (its figure with the
values is lost: 0.5 and 0.85 at an impact speed of a tenth of sqrt(p/rho_s) are chosen here), and
one flow between walls. The thesis has 26 and 18 flows of 10,000 grains between walls.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from granular.grain_scale import dem, friction_law
from granular.grain_scale.friction_law import SteadyShear
from granular.papers.runs import Runs
from granular.tools.progress import bar

FILE = "friction_law.json"
"""Stored flows, in the folder of records: those that it holds are read and not run again. The
results of the benchmark `friction_law` can be copied there, so that LAMMPS is not needed."""
PRESSURE = 1e3
"""Pressure [Pa]; kn is 10^6 times as large, so that (kn/p)^(2/3) = 10^4 as in the thesis."""
SIZE, DENSITY = 1e-3, 2500.0
IMPACT = 0.1 * (PRESSURE / DENSITY) ** 0.5
"""Impact speed [m/s] at which the restitution is the one of the set."""
RESTITUTION = {"low": 0.5, "high": 0.85, "walls": 0.5}
NAMES = {"low": "e = 0.5", "high": "e = 0.85", "walls": "walls, e = 0.5"}
TIMEOUT = 7200.0
"""Longest time of a flow [s]."""


@dataclass(frozen=True)
class Case:
    """One flow of a series; see `granular.grain_scale.dem.Shear`."""

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
"""All flows, of which the two slowest take half of the time."""
QUICK = {
    "low": tuple(Case(i, 1.0, 2.0, 60, 100) for i in (0.1, 0.3, 0.6, 1.0)),
    "high": (Case(0.1, 1.0, 2.0, 60, 100),),
    "walls": (Case(0.3, 2.0, 2.0, 60, 200),),
}
SLOWEST = 0.01
"""Smallest inertial number of figures in normal size."""


def grains(name: str) -> dem.Grains:
    """The grains of a set."""
    plain = dem.Grains(d=SIZE, rho_s=DENSITY, kn=1e6 * PRESSURE)
    return plain.with_restitution(RESTITUTION[name], IMPACT)


def flow(name: str, case: Case, timeout: float = TIMEOUT) -> SteadyShear:
    """Run one case."""
    settings = dem.Shear(
        grains=grains(name),
        pressure=PRESSURE,
        drive="walls" if name == "walls" else "homogeneous",
        aspect=2.0 if name == "walls" else 1.0,
        **asdict(case),
    )
    return friction_law.steady_shear(settings, timeout=timeout)


def row_of(name: str, case: Case, timeout: float = TIMEOUT) -> dict[str, Any]:
    """Run one case, and return it as it is stored."""
    begin = time.perf_counter()
    steady = flow(name, case, timeout)
    seconds = round(time.perf_counter() - begin, 1)
    return {"set": name, "case": asdict(case), "seconds": seconds, "flow": asdict(steady)}


def missing(
    rows: list[dict[str, Any]], series: Mapping[str, Iterable[Case]]
) -> Iterator[tuple[str, Case]]:
    """Cases of a series that rows do not hold."""
    for name, cases in series.items():
        for case in cases:
            if not any(row["set"] == name and row["case"] == asdict(case) for row in rows):
                yield name, case


def points(rows: Iterable[Mapping[str, Any]], name: str) -> list[SteadyShear]:
    """Flows of a set among rows, by their inertial number."""
    flows = [SteadyShear(**row["flow"]) for row in rows if row["set"] == name]
    return sorted(flows, key=lambda point: point.inertial_number)


def flows(runs: Runs, *names: str) -> dict[str, list[SteadyShear]]:
    """Flows of sets for a figure, by the name of the set: stored ones, and new ones for the rest.

    Grains of a sheared cell cannot be displaced at the start to see how far a number is determined:
    with a displacement they begin from another arrangement.
    """
    wanted = series_of(runs, names)
    path = runs.settings.folder / FILE
    stored = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {"rows": []}
    rows: list[dict[str, Any]] = stored["rows"]
    new = list(missing(rows, wanted))
    for name, case in bar(iterable=new, desc="shear flows", unit="flow", leave=False):
        try:
            rows.append(row_of(name, case))
        except ImportError as error:
            error.add_note(f"or copy the results of the benchmark friction_law to {path}")
            raise
        _store(path, stored)
    known = {(name, json.dumps(asdict(case))) for name in wanted for case in wanted[name]}
    mine = [row for row in rows if (row["set"], json.dumps(row["case"])) in known]
    counts = sorted({row["case"]["count"] for row in mine}, reverse=True)
    runs.remarks.append(f"LAMMPS, {' or '.join(map(str, counts))} grains")
    return {NAMES[name]: points(mine, name) for name in wanted}


def series_of(runs: Runs, names: Iterable[str]) -> dict[str, list[Case]]:
    """Cases of a figure by set."""
    series, slowest = QUICK if runs.quick else SERIES, 0.0 if runs.full else SLOWEST
    seed = 1 if runs.settings.shift else 0
    return {
        name: [
            replace(case, seed=case.seed + seed)
            for case in series[name]
            if case.inertial_number >= slowest
        ]
        for name in names
    }


def _store(path: Path, results: dict[str, Any]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".part")
    partial.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    partial.replace(path)
