"""Machine-readable table of the bias against softness, cell size and points per cell."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from accuracy.errors import Reference, Row, error, select, stiffness

PARAMETERS = ("E", "cell", "points")
VARIED = (*PARAMETERS, "seed")
"""Parameters that differ between runs of one scene and scheme."""


def observable(row: Row) -> float:
    """Main result of a run.

    It is the depth average divided by the solution of the one-dimensional equation, the run-out
    (mass quantile), or the rate of discharge [kg/s].
    """
    if row["scene"].startswith("incline"):
        return 1.0 + row["mean_error"]
    return row["runout_quantile"] if row["scene"] == "collapse" else row["rate"]


def power_law(values: Sequence[float], errors: Sequence[float]) -> dict[str, float | None]:
    """Least-squares fit of ln(error) against ln(value): error = coefficient value^slope.

    `scatter` is the rms deviation as a factor; 1 is a perfect law. Two points have no scatter.
    """
    keep = [(v, abs(e)) for v, e in zip(values, errors, strict=True) if e]
    if len(keep) < 2:
        return {"slope": None, "coefficient": None, "scatter": None}
    x, y = np.log(np.array(keep)).T
    slope, level = np.polyfit(x, y, 1)
    miss = math.exp(math.sqrt(np.mean((y - level - slope * x) ** 2)))
    return {
        "slope": float(slope),
        "coefficient": float(math.exp(level)),
        "scatter": miss if len(keep) > 2 else None,
    }


def _series(rows: Sequence[Row], parameter: str) -> list[list[Row]]:
    """Series of runs that differ in one parameter only, with three or more values of it."""
    groups: dict[tuple[Any, ...], dict[float, Row]] = {}
    for row in select(rows, solver="granular"):
        if row["scheme"] != "published" and row["until"] is None:
            fixed = [row[n] for n in ("scene", "scheme", "angle_deg")]
            fixed += [row[n] for n in VARIED if n != parameter]
            groups.setdefault(tuple(fixed), {})[row[parameter]] = row
    return [[g[v] for v in sorted(g)] for g in groups.values() if len(g) > 2]


def _softness(runs: Sequence[Row]) -> list[dict[str, float]]:
    """Difference of every run from the next stiffer one.

    `step` is the relative difference of the two, and `step_per_p_over_K` this difference divided by
    the difference of p/K, so that the bias of a material is about this number times its p/K. A
    difference does not contain the error of the cells nor, except in its last entries, the
    dependence of the scheme itself on E. For inclines `predicted_step` is the difference by the
    theory of steady flow.
    """
    entries = []
    for soft, stiff in pairwise(runs):
        a, b = stiffness(soft), stiffness(stiff)
        step = observable(soft) / observable(stiff) - 1
        entry = {"E": soft["E"], "stiffer": stiff["E"], "step": step, **a}
        entry["step_per_p_over_K"] = step / (a["p_over_K"] - b["p_over_K"])
        if "predicted" in a:
            entry["predicted_step"] = entry.pop("predicted") - b["predicted"]
        entries.append(entry)
    return entries


def _falling(entries: Sequence[dict[str, float]]) -> list[dict[str, float]]:
    """The softest entries, as long as their steps shrink threefold or more; the rest is noise."""
    decreasing = list(entries[:1])
    for before, entry in pairwise(entries):
        if abs(entry["step"]) > abs(before["step"]) / 3:
            break
        decreasing.append(entry)
    return decreasing


def _resolution(runs: Sequence[Row], name: str, reference: Reference) -> list[dict[str, float]]:
    """Errors of the runs against the reference of their scene."""
    scene = runs[0]["scene"]
    entries = [{name: row[name], "error": error(row, scene, reference)} for row in runs]
    return [entry for entry in entries if entry["error"] > 0]


def table(rows: Sequence[Row], references: Mapping[str, Reference | None]) -> list[dict[str, Any]]:
    """Entry of each series: the varied and the fixed parameters, the points, the power law.

    Under "E" the steps are signed, see `_softness`, and the law is fitted to those that decrease;
    its exponent is about -1 if the bias is proportional to p/K. Under "cell" and "points" the
    errors are as in the chart.
    """
    result = []
    for parameter in PARAMETERS:
        for runs in _series(rows, parameter):
            first, reference = runs[0], references[runs[0]["scene"]]
            entry = {n: first[n] for n in ("scene", "scheme", "angle_deg")}
            entry |= {"parameter": parameter}
            entry |= {n: first[n] for n in PARAMETERS if n != parameter}
            if parameter == "E":
                measured = _softness(runs)
                fitted = [(m["E"], m["step"]) for m in _falling(measured)]
            elif reference is None:
                continue
            else:
                measured = _resolution(runs, parameter, reference)
                fitted = [(m[parameter], m["error"]) for m in measured]
                entry["uncertainty"] = reference.uncertainty
            law = power_law([v for v, _ in fitted], [e for _, e in fitted])
            result.append(entry | law | {"measured": measured})
    return result
