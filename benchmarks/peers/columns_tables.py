"""Tables of docs/reports/peers.md."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from accuracy.errors import front
from shared import markdown

from peers.columns import CODES
from peers.columns_chart import KINDS, LAW_NAMES
from peers.columns_errors import (
    MEASURES,
    PANELS,
    Reference,
    Row,
    best,
    cheapest_as_good,
    distance,
    done,
    finest,
    is_ours,
    key,
    of_panel,
    references,
)

References = Mapping[tuple[str, str, float], Reference]


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %" if value < 0.995 else f"{100 * value:.0f} %"


def _ratio(value: float) -> str:
    return f"{value:.2g}" if value < 99.5 else f"{10 * round(value / 10)}"


def _size(row: Row) -> str:
    return f"{row['cells']} / {row['points']}"


def agreement(rows: Sequence[Row], references: References) -> list[str]:
    """Distance of the runs of each code from our finest, by the number of cells."""
    sizes = sorted({r["cells"] for r in rows})
    lines = []
    for (law, kind, aspect), reference in references.items():
        if kind != "finest":
            continue
        title = [LAW_NAMES[law], f"{aspect:g}"]
        for code in CODES:
            mine = done(rows, code=code, law=law, aspect=aspect, points=4)
            if not mine:
                continue
            errors = {
                r["cells"]: "reference"
                if key(r) in reference.made_of
                else _percent(distance(r, reference.target)["surface"])
                for r in mine
            }
            last = max(mine, key=lambda r: r["cells"])["mean"][-1]
            cells = [errors.get(n, "") for n in sizes]
            lines.append([*title, CODES[code].label, *cells, f"{last:.3f}"])
            title = ["", ""]
        made = f"{max(cells for _, _, _, cells, _ in reference.made_of)} cells"
        uncertain = f"uncertainty, {made}: {_percent(reference.uncertainty['surface'])}"
        lines.append(["", "", uncertain, *[""] * len(sizes), f"{reference.target['mean'][-1]:.3f}"])
    header = ("law", "a", "code", *(f"{n} cells" for n in sizes), "mean distance, finest")
    return markdown(header, lines)


def fronts(rows: Sequence[Row], references: References) -> list[str]:
    """Runs on the front of every panel."""
    lines = []
    for (law, kind, aspect), reference in references.items():
        if (law, kind) not in PANELS:
            continue
        points = of_panel(rows, law, aspect, reference)
        title = [f"{LAW_NAMES[law]} {KINDS[kind]}", f"{aspect:g}"]
        for row, e in front(points, reference.uncertainty["surface"]):
            cost = f"{row['core_seconds']:.2g}"
            lines.append([*title, CODES[row["code"]].label, _size(row), cost, _percent(e)])
            title = ["", ""]
    header = ("error", "a", "code", "cells / points", "core-seconds", "L1")
    return markdown(header, lines)


def against_ours(rows: Sequence[Row], references: References) -> list[str]:
    """The best run of every other code, and the cheapest of this package that is as good."""
    lines = []
    for (law, kind, aspect), reference in references.items():
        floor = reference.uncertainty["surface"]
        points = of_panel(rows, law, aspect, reference)
        title = [f"{LAW_NAMES[law]} {KINDS[kind]}", f"{aspect:g}"]
        for code in CODES:
            cheapest = best(points, code, floor)
            if cheapest is None or is_ours(cheapest[0]):
                continue
            row, e = cheapest
            ours = cheapest_as_good(points, row, e, floor)
            line = [CODES[code].label, _size(row), f"{row['core_seconds']:.2g}", _percent(e)]
            if ours:
                cost = ours[0]["core_seconds"]
                name = ours[0]["code"]
                line += [name, _size(ours[0]), f"{cost:.2g}", _percent(ours[1])]
                line += [_ratio(row["core_seconds"] / cost)]
            else:
                line += ["none", "", "", "", ""]
            lines.append([*title, *line])
            title = ["", ""]
    header = (
        *("error", "a", "code", "cells / points", "core-seconds", "L1"),
        *("ours", "cells / points", "core-seconds", "L1", "ratio of costs"),
    )
    return markdown(header, lines)


def ratios(rows: Sequence[Row], references: References) -> list[str]:
    """Range of the ratios of costs of `against_ours`, and the time of a step for each point."""
    by_code: dict[str, list[float]] = {}
    for (law, _, aspect), reference in references.items():
        floor = reference.uncertainty["surface"]
        points = of_panel(rows, law, aspect, reference)
        for code in CODES:
            top = best(points, code, floor)
            if top is None or is_ours(top[0]):
                continue
            ours = cheapest_as_good(points, *top, floor)
            cost = top[0]["core_seconds"] / ours[0]["core_seconds"] if ours else math.inf
            by_code.setdefault(code, []).append(cost)
    lines = []
    for code in CODES:
        all_, row = by_code.get(code, []), _step_row(rows, code)
        finite = [value for value in all_ if math.isfinite(value)]
        span = f"{_ratio(min(finite))} to {_ratio(max(finite))}" if finite else ""
        step = 1e9 * row["core_seconds"] / (row["steps"] * row["n_points"]) if row else None
        time = "" if step is None else f"{step:.2g}"
        lines.append([CODES[code].label, span, str(len(all_) - len(finite)) if all_ else "", time])
    header = ("code", "ratio of costs", "references without one of ours as good")
    return markdown((*header, "ns a step and point"), lines)


def _step_row(rows: Sequence[Row], code: str) -> Row | None:
    """The run of a code whose steps are timed: a = 1.42 with 16 cells and 4 points in each."""
    law = CODES[code].laws[0]
    shape = {"code": code, "law": law, "aspect": 1.42, "cells": 16, "points": 4}
    return next((r for r in rows if done(r) and all(r[k] == v for k, v in shape.items())), None)


def measures(rows: Sequence[Row], references: References) -> list[str]:
    """The three errors of the finest run of every code."""
    lines = []
    for (law, kind, aspect), reference in references.items():
        if (law, kind) not in PANELS:
            continue
        title = [f"{LAW_NAMES[law]} {KINDS[kind]}", f"{aspect:g}"]
        for code in CODES:
            row = finest(rows, code=code, law=law, aspect=aspect)
            if row is None or key(row) in reference.made_of:
                continue
            e = distance(row, reference.target)
            errors = [_percent(e[name]) for name in MEASURES]
            lines.append([*title, CODES[code].label, row["cells"], *errors])
            title = ["", ""]
    header = ("error", "a", "code", "cells", "L1", "mean distance", "run-out")
    return markdown(header, lines)


def left_out(rows: Sequence[Row]) -> list[str]:
    """Cases without a result, with the reason, and points that a code lost."""
    lines = []
    for row in rows:
        reason = row.get("left_out") or row.get("failed")
        if reason is None and row["kept"] < 1:
            reason = f"{_percent(1 - row['kept'])} of the mass lost"
        if reason:
            name = [CODES[row["code"]].label, LAW_NAMES[row["law"]], f"{row['aspect']:g}"]
            lines.append([*name, _size(row), reason.replace("|", "\\|")])
    return markdown(("code", "law", "a", "cells / points", "reason"), lines)


def tables(rows: Sequence[Row]) -> dict[str, list[str]]:
    """Tables of the page by their names."""
    targets = references(rows)
    return {
        "agreement": agreement(rows, targets),
        "fronts": fronts(rows, targets),
        "against ours": against_ours(rows, targets),
        "ratios": ratios(rows, targets),
        "measures": measures(rows, targets),
        "left out": left_out(rows),
    }
