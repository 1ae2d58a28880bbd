"""Quantities of interest of the paper's scenes against settings that make runs cheaper.

Runs each case with one thread and appends a row to the table: the numbers of
`granular.verify.quantities`, processor time, steps, points moved. Cases that the table already has
are left out, so that the script can be stopped and started again. The laws of `gr.economy` in
docs/reports/economy.md are fits to this table. "held" is the stiffness whose decay rates [1/s] the
scheme keeps; without it the rates vary with E. Many cases have cells twice as large as the paper's:
they measure the effect of E, and a run at 1 GPa then takes an eighth of the time.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from shared import markdown, parser_of, stored, write

import granular as gr
from granular.verify.quantities import quantities

SCHEMES = {
    "default": gr.schemes.default,
    "published": gr.schemes.dunatunga_kamrin_2015.replace(dt=None),
}

COARSE_HOURGLASS = {
    "kind": "flat",
    "duration": 3.0,
    "cell": 0.02,
    "fill_height": 0.24,
    "width": 0.96,
    "orifice_radius": 0.04,
}


@dataclass(frozen=True)
class Case:
    """A scene function, its keywords, E [Pa], the scheme, and what else differs."""

    scene: str
    keywords: dict[str, Any]
    E: float
    scheme: str = "default"
    held: float | None = None
    changes: dict[str, Any] = field(default_factory=dict)
    law: str = "mu_I"

    @property
    def key(self) -> str:
        """Description of the case."""
        return json.dumps(self.__dict__, sort_keys=True)

    def build(self) -> gr.Scene:
        grains = gr.materials.glass_beads.replace(E=self.held or self.E)
        scheme = SCHEMES[self.scheme]
        scene = gr.scenes.registry[self.scene](material=grains, scheme=scheme, **self.keywords)
        decay = gr.economy.held_decay(scene, self.E) if self.held else {}
        grains = grains.replace(E=self.E)
        if self.law == "drucker_prager":
            grains = gr.materials.DruckerPrager(E=self.E, mu=grains.mu_s)
        return scene.replace(material=grains, scheme=scheme.replace(**decay, **self.changes))


def jittered(keywords: dict[str, Any], count: int = 2) -> list[dict[str, Any]]:
    """More seedings of a scene, to measure the scatter of runs that should be the same."""
    return [keywords | {"jitter": 0.5, "seed": k} for k in range(1, count + 1)]


def inclines() -> Iterator[Case]:
    for scheme in SCHEMES:
        yield Case("incline", {}, 1e7, scheme)
        yield Case("incline", {"cell": 0.01}, 1e7, scheme)
    yield Case("incline", {}, 1e6)
    yield Case("incline", {"cell": 0.02}, 1e7, "published")
    yield Case("incline", {"angle_deg": 30.0, "cell": 0.01}, 1e7, "published")
    yield Case("incline", {"angle_deg": 22.0, "cell": 0.01}, 1e8, "published")


def columns() -> Iterator[Case]:
    seeds = [{"aspect": 1.0, "cell": 0.025, "jitter": 0.5, "seed": k} for k in (1, 2, 3)]
    for keywords in seeds:
        for E in (1e6, 1e7, 1e8, 1e9):
            for scheme in SCHEMES:
                yield Case("column_collapse", keywords, E, scheme)
        for E in (1e5, 3e6):
            yield Case("column_collapse", keywords, E)
        for E, held in ((1e6, 1e9), (1e7, 1e9), (1e7, 1e8)):
            yield Case("column_collapse", keywords, E, held=held)
        yield Case("column_collapse", keywords, 1e7, changes={"cfl": 0.6})
    paper = {"aspect": 1.0}
    for E in (1e6, 3e6, 1e7, 1e8, 1e9):
        yield Case("column_collapse", paper, E)
    for keywords in jittered(paper, 6):
        for E in (1e6, 1e7, 1e8):
            yield Case("column_collapse", keywords, E)
    for E in (1e6, 1e7):
        yield Case("column_collapse", paper, E, "published")
    for held in (1e8, 1e9):
        yield Case("column_collapse", paper, 1e7, held=held)
    yield Case("column_collapse", paper | {"points_per_cell": 4}, 1e7)
    yield Case("column_collapse", paper, 1e7, "published", law="drucker_prager")


def silos() -> Iterator[Case]:
    coarse = {"orifice": 0.2, "cell": 0.02}
    for E in (1e5, 1e6, 1e7, 1e8):
        for scheme in SCHEMES:
            yield Case("silo", coarse, E, scheme)
        for keywords in jittered(coarse):
            yield Case("silo", keywords, E)
    for E in (1e6, 1e7):
        for keywords in (coarse, *jittered(coarse)):
            yield Case("silo", keywords, E, held=1e8)
        yield Case("silo", coarse, E, held=1e9)
    yield Case("silo", coarse, 1e9)
    yield Case("silo", coarse, 1e7, changes={"cfl": 0.6})
    yield Case("silo", {"orifice": 0.2}, 1e6, "published")


def hourglasses() -> Iterator[Case]:
    for E in (1e6, 1e7, 1e8):
        for scheme in SCHEMES:
            yield Case("hourglass", COARSE_HOURGLASS, E, scheme)
        for keywords in jittered(COARSE_HOURGLASS):
            yield Case("hourglass", keywords, E)
    for E in (1e6, 1e7):
        yield Case("hourglass", COARSE_HOURGLASS, E, held=1e8)
    yield Case("hourglass", COARSE_HOURGLASS, 1e7, held=1e9)


def slugs() -> Iterator[Case]:
    coarse = {"cell": 0.0166}
    for E in (1e5, 1e6, 1e7, 1e8):
        for scheme in SCHEMES:
            yield Case("slug", coarse, E, scheme)
    for E in (3e6, 1e9):
        yield Case("slug", coarse, E)
    for E in (1e5, 1e6, 1e7):
        yield Case("slug", coarse, E, held=1e9)
    for E in (1e6, 1e7):
        yield Case("slug", {}, E, held=1e8)
    for keywords in jittered(coarse):
        for scheme in SCHEMES:
            yield Case("slug", keywords, 1e7, scheme)
    for E in (1e6, 1e7):
        for scheme in SCHEMES:
            yield Case("slug", {}, E, scheme)
    for E in (3e6, 1e7):
        yield Case("slug", {}, E, held=1e9)
    for E in (1e8, 1e9):
        yield Case("slug", {}, E)


GROUPS = {
    "incline": inclines,
    "column_collapse": columns,
    "silo": silos,
    "hourglass": hourglasses,
    "slug": slugs,
}


def measured(case: Case) -> dict[str, Any]:
    """The row of a case."""
    run = quantities(case.build())
    return {
        "case": case.__dict__,
        "numbers": {name: [round(x, 6) for x in v.tolist()] for name, v in run.numbers.items()},
        "seconds": round(run.seconds, 2),
        "steps": run.steps,
        "point_steps": run.point_steps,
    }


QUANTITIES = {
    "column_collapse": ("toe", "toe of the run-out of a column"),
    "silo": ("rate", "rate of a silo"),
    "hourglass": ("rate", "rate of an hourglass"),
    "slug": ("centre", "centre of a slug"),
}
"""Quantity of each scene that the error laws are for, and its words in the table."""
SOFTER = (1e6, 3e6, 1e7, 1e8)


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page: change of the quantities of softer grains, default scheme.

    Each is compared with the stiffest grains of the same cells, with the damping of the scheme.
    """
    values: dict[tuple[str, float, float], dict[float, list[np.ndarray]]] = {}
    for row in results["rows"]:
        case = row["case"]
        plain = case["scheme"] == "default" and case["law"] == "mu_I" and not case["changes"]
        if plain and case["scene"] in QUANTITIES and "points_per_cell" not in case["keywords"]:
            kind = (case["scene"], case["keywords"].get("cell", 0.0), case["held"] or 0.0)
            value = np.ravel(row["numbers"][QUANTITIES[case["scene"]][0]])
            values.setdefault(kind, {}).setdefault(case["E"], []).append(value)
    means = {
        kind: {E: np.mean(several, axis=0) for E, several in by_E.items()}
        for kind, by_E in values.items()
    }
    lines = []
    for (scene, cell, held), by_E in sorted(means.items()):
        of_scheme = means[scene, cell, 0.0]
        stiff = max(of_scheme)
        if held not in (0.0, stiff):
            continue
        scale = float(np.linalg.norm(of_scheme[stiff]))
        off = {E: float(np.linalg.norm(v - of_scheme[stiff])) / scale for E, v in by_E.items()}
        cells = f"{cell:g} m" if cell else "of the paper"
        damping = f"of {stiff:g} Pa" if held else "of the scheme"
        texts = [f"{100 * off[E]:.1f} %" if E in off and E < stiff else "" for E in SOFTER]
        lines.append((QUANTITIES[scene][1], cells, f"{stiff:g} Pa", damping, *texts))
    head = ("quantity", "cells", "compared with", "damping", *(f"E = {E:g}" for E in SOFTER))
    return {"stiffness": markdown(head, lines)}


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "one soft case of each group")
    parser.add_argument("--only", nargs="+", choices=tuple(GROUPS), default=tuple(GROUPS))
    chosen = parser.parse_args(argv)
    table = stored(chosen.out, rows=[])
    known = {Case(**row["case"]).key for row in table["rows"]}
    for name in chosen.only:
        cases = list(GROUPS[name]())
        if chosen.quick:
            cases = [min(cases, key=lambda case: (-case.keywords.get("cell", 0.0), case.E))]
        for case in cases:
            if case.key in known:
                continue
            table["rows"].append(measured(case))
            write(chosen.out, table)
            print(case.key, f"{table['rows'][-1]['seconds']} s", flush=True)
