"""Tables of docs/reports/accuracy.md in Markdown, from the rows of results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from shared import markdown

from accuracy import slopes
from accuracy.cases import HYDRODYNAMICS, SCHEMES
from accuracy.chart import LOST
from accuracy.errors import Reference, Row, error, front, of_panel, references, select

PANELS = {
    "incline": "incline, one column",
    "incline_2d": "incline, 8 columns",
    "collapse": "collapse, profile",
    "runout": "collapse, run-out",
    "silo": "silo, discharge",
}
SCENES = {
    "incline": "incline, one column",
    "incline_2d": "incline, 8 columns",
    "collapse": "collapse: profile; run-out",
    "silo": "silo",
}
REFERENCES = {
    "incline": "one-dimensional equation at the same time",
    "incline_2d": "one-dimensional equation at the same time",
    "collapse": "default scheme, E = 1e7 Pa, 5 mm, 16 points per cell",
    "runout": "default scheme, E = 1e7 Pa, 5 mm, 16 points per cell",
    "silo": "default scheme and linear FLIP, each extrapolated to a cell of size 0, and averaged",
}
COMPARED: dict[str, dict[str, Any]] = {
    "incline": {"E": 1e7, "cell": 0.01, "points": 4, "angle_deg": 25.0},
    "incline_2d": {"E": 1e6, "cell": 0.01, "points": 4, "seed": 0},
    "collapse": {"E": 1e7, "cell": 0.0125, "points": 16, "seed": 0},
    "silo": {"E": 1e7, "cell": 0.02, "points": 4},
}
"""Settings with which every scheme was run."""
TRENDS = ("default", "cell_averaged", "linear flip")

Rows = Sequence[Row]
References = Mapping[str, Reference | None]
Entry = Mapping[str, Any]


def percent(value: float) -> str:
    """A fraction as a percentage with two digits, without an exponent."""
    percentage = 100 * value
    return f"{percentage:.0f} %" if abs(percentage) >= 9.95 else f"{percentage:.2g} %"


def seconds(value: float) -> str:
    return f"{value:.0f}" if value >= 9.95 else f"{value:.2g}"


def modulus(value: float) -> str:
    return f"{value:.0e}".replace("e+0", "e")


def millimetres(value: float) -> str:
    return f"{1e3 * value:.3g}"


def order(entry: Entry) -> tuple[int, float, int, float]:
    """Key that sorts entries by scene, inclination, scheme and cell."""
    place = list(PANELS).index(entry["scene"]), entry["angle_deg"] or 0.0
    return *place, TRENDS.index(entry["scheme"]), -entry["cell"] if "cell" in entry else 0.0


def panels_of(scene: str) -> list[str]:
    return ["collapse", "runout"] if scene == "collapse" else [scene]


def uncertainties(references: References) -> list[str]:
    """Reference of each panel, and the uncertainty that is its grey band."""
    rows = []
    for panel, title in PANELS.items():
        reference = references[panel]
        if reference:
            exact = reference.uncertainty == 0
            unsure = "none" if exact else percent(reference.uncertainty)
            rows.append((title, REFERENCES[panel], unsure))
    return markdown(("error of", "reference", "uncertainty"), rows)


def fronts(rows: Rows, references: References) -> list[str]:
    """Runs on the front of each panel, with the numbers that the pictures give them."""
    lines = []
    for panel, title in PANELS.items():
        reference = references[panel]
        if reference is None:
            continue
        best = front(of_panel(rows, panel, reference), reference.uncertainty)
        for i, (row, e) in enumerate(best, 1):
            setting = (modulus(row["E"]), millimetres(row["cell"]), row["points"])
            cost = (seconds(row["core_seconds"]), percent(e))
            lines.append((title if i == 1 else "", i, row["scheme"], *setting, *cost))
    header = ("error of", "number", "scheme", "E [Pa]", "cell [mm]", "points per cell")
    return markdown((*header, "core-seconds", "error"), lines)


def schemes(rows: Rows, references: References) -> list[str]:
    """Error and cost of every scheme with one setting per scene."""
    lines = []
    for scheme in SCHEMES:
        line: list[str] = []
        for scene, setting in COMPARED.items():
            runs = select(rows, scene=scene, scheme=scheme, until=None, **setting)
            errors = [
                percent(error(runs[0], panel, reference)) if runs and reference else ""
                for panel, reference in ((panel, references[panel]) for panel in panels_of(scene))
            ]
            line += [*errors, seconds(runs[0]["core_seconds"]) if runs else ""]
        if any(line):
            lines.append((scheme, *line))
    header = ["scheme"]
    for scene in COMPARED:
        header += [*(PANELS[panel] for panel in panels_of(scene)), "s"]
    return markdown(header, lines)


def layers(rows: Rows) -> list[str]:
    """State of the layer of eight columns at the end, for every scheme."""
    lines = []
    for scheme in SCHEMES:
        for points in (4, 9):
            setting = {"E": 1e6, "cell": 0.01, "points": points, "seed": 0}
            for row in select(rows, scene="incline_2d", scheme=scheme, **setting):
                lines.append((scheme, points, f"{row['height']:.3f}", percent(row["stress_free"])))
    header = ("scheme", "points per cell", "height over that at the start", "stress-free points")
    return markdown(header, lines)


def softness(slopes: Sequence[Entry]) -> list[str]:
    """Change of the main result by a ten times stiffer material."""
    steps = ((1e5, 1e6), (1e6, 1e7), (1e7, 1e8), (1e8, 1e9))
    names = {**PANELS, "collapse": PANELS["runout"]}
    lines: list[tuple[str, ...]] = []
    entries = [s for s in slopes if s["parameter"] == "E" and s["scheme"] in TRENDS]
    for entry in sorted(entries, key=order):
        if (entry["scene"], entry["scheme"]) in LOST:
            continue
        angle = f"{entry['angle_deg']:g} deg" if entry["angle_deg"] else ""
        words = (names[entry["scene"]], angle, millimetres(entry["cell"]))
        if entry["scene"] == "incline" and entry["scheme"] == "default":
            by = {m["E"]: m["predicted_step"] for m in entry["measured"]}
            lines.append(
                (*words, "theory", *(percent(by[a]) if a in by else "" for a, _ in steps), "-1")
            )
        by = {m["E"]: m["step"] for m in entry["measured"]}
        law = f"{entry['slope']:.2f}" if entry["scatter"] else ""
        changes = [percent(by[a]) if a in by else "" for a, _ in steps]
        lines.append((*words, entry["scheme"], *changes, law))
    header = [f"{modulus(a)} to {modulus(b)}" for a, b in steps]
    return markdown(("result of", "slope", "cell [mm]", "scheme", *header, "exponent"), lines)


def resolution(slopes: Sequence[Entry], parameter: str) -> list[str]:
    """Errors by cell or by points per cell, with the exponent of a power law for cells."""
    entries = [s for s in slopes if s["parameter"] == parameter and s["scheme"] in TRENDS]
    entries = [s for s in entries if (s["scene"], s["scheme"]) not in LOST]
    values = sorted({m[parameter] for s in entries for m in s["measured"]}, reverse=True)
    other = "points" if parameter == "cell" else "cell"
    texts = {"cell": millimetres, "points": str}
    lines = []
    for entry in sorted(entries, key=order):
        by = {m[parameter]: m["error"] for m in entry["measured"]}
        errors = [percent(by[v]) if v in by else "" for v in values]
        fixed = (modulus(entry["E"]), texts[other](entry[other]))
        law = [f"{entry['slope']:.1f}"] if parameter == "cell" else []
        lines.append((PANELS[entry["scene"]], entry["scheme"], *fixed, *errors, *law))
    unit = {"cell": " mm", "points": " points"}[parameter]
    header = [
        "error of",
        "scheme",
        "E [Pa]",
        {"cell": "cell [mm]", "points": "points per cell"}[other],
    ]
    header += [texts[parameter](v) + unit for v in values]
    return markdown([*header, "exponent"] if parameter == "cell" else header, lines)


def others(rows: Rows, references: References, names: Sequence[str]) -> list[str]:
    """Every run of the named schemes, next to the default scheme at the same setting."""
    lines = []
    for row in (row for name in names for row in select(rows, scheme=name)):
        same = {n: row[n] for n in ("scene", "E", "cell", "points", "angle_deg", "seed", "until")}
        line = [row["scheme"], SCENES[row["scene"]]]
        line += [modulus(row["E"]), millimetres(row["cell"]), str(row["points"])]
        for run in (row, *select(rows, scheme="default", **same)):
            pairs = [(panel, references[panel]) for panel in panels_of(row["scene"])]
            errors = [percent(error(run, panel, r)) for panel, r in pairs if r]
            line += [seconds(run["core_seconds"]), "; ".join(errors)]
        lines.append(line + [""] * (9 - len(line)))
    header = ("code", "scene", "E [Pa]", "cell [mm]", "points per cell", "core-seconds", "error")
    return markdown((*header, "core-seconds of default", "error of default"), lines)


def summary(rows: Rows, references: References) -> list[str]:
    """Error and cost of the two schemes with a density correction, by the size of the cells."""
    lines = []
    for scene, setting in COMPARED.items():
        panel, fixed = panels_of(scene)[0], {k: v for k, v in setting.items() if k != "cell"}
        reference = references[panel]
        if reference is None:
            continue
        by = {
            (run["scheme"], run["cell"]): (
                percent(error(run, panel, reference)),
                seconds(run["core_seconds"]),
            )
            for scheme in ("default", "cell_averaged")
            for run in select(rows, scene=scene, scheme=scheme, until=None, **fixed)
            if error(run, panel, reference) > 0  # not the reference itself
        }
        for cell in sorted({cell for _, cell in by}, reverse=True):
            cells = [by.get((scheme, cell), ("", "")) for scheme in ("default", "cell_averaged")]
            lines.append((PANELS[panel], millimetres(cell), *cells[0], *cells[1]))
    header = ("error of", "cell [mm]", "default", "core-seconds", "cell_averaged", "core-seconds")
    return markdown(header, lines)


def tables(rows: Rows) -> dict[str, list[str]]:
    """All tables of the page by their names."""
    targets = references(rows)
    biases = slopes.table(rows, targets)
    return {
        "summary": summary(rows, targets),
        "references": uncertainties(targets),
        "fronts": fronts(rows, targets),
        "schemes": schemes(rows, targets),
        "layers": layers(rows),
        "softness": softness(biases),
        "cells": resolution(biases, "cell"),
        "points": resolution(biases, "points"),
        "peers": others(rows, targets, ("published", "taichi", "newton")),
        "sph": others(rows, targets, (HYDRODYNAMICS,)),
    }
