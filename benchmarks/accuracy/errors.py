"""From rows of results to errors: the references, their uncertainty, the slopes of the bias."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import granular as gr
from accuracy.runs import GRAVITY, HEIGHT, SILO

Row = Mapping[str, Any]
COLUMN = 0.2
"""Height of the column that collapses [m]."""

QUANTITIES = {
    "incline": "profile",
    "incline_2d": "profile",
    "collapse": "profile",
    "runout": "runout",
    "silo": "rate",
}
"""Panels that are drawn; the run-out is a second error of the runs of the collapse."""


@dataclass(frozen=True)
class Reference:
    """Reference value of the errors of a panel.

    Attributes
    ----------
    value : ndarray
        A rate [kg/s], a profile [m], or run-outs; empty where the rows hold their errors.
    uncertainty : float
        Relative uncertainty; smaller errors are not significant.
    source : str
        Description of its origin.
    """

    value: np.ndarray
    uncertainty: float
    source: str


def select(rows: Iterable[Row], **entries: Any) -> list[Row]:
    """Rows with results and the given entries."""
    return [
        row
        for row in rows
        if "core_seconds" in row and all(row[name] == value for name, value in entries.items())
    ]


def _profile(row: Row) -> np.ndarray:
    return np.array(row["profile"])


def _runouts(row: Row) -> np.ndarray:
    """Run-outs by mass quantile and by toe."""
    return np.array([row["runout_quantile"], row["runout_toe"] or math.nan])


def _profile_distance(a: np.ndarray, b: np.ndarray) -> float:
    """L1 distance of two profiles, divided by the area of the second."""
    return float(np.abs(a - b).sum() / b.sum())


def _runout_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Larger of the relative differences of the run-outs; nan if one of them was not found."""
    return float(np.max(np.abs(a / b - 1)))


DISTANCES = {"collapse": (_profile, _profile_distance), "runout": (_runouts, _runout_distance)}


def collapse_reference(rows: Sequence[Row], name: str) -> Reference | None:
    """Reference from the finest run of the default scheme.

    Its uncertainty is the larger of its differences from the next coarser runs, which differ in
    resolution and in seed.
    """
    value_of, distance = DISTANCES[name]
    runs = select(rows, scene="collapse", scheme="default", E=1e7, points=16)
    runs = sorted(runs, key=lambda row: row["cell"])
    if len(runs) < 3:
        return None
    finest = value_of(runs[0])
    others = [distance(value_of(row), finest) for row in runs[1:3]]
    return Reference(finest, max(others), f"default scheme, dx = {runs[0]['cell'] * 1e3:.2g} mm")


def silo_reference(rows: Sequence[Row]) -> Reference | None:
    """Mean of the rates of the default and of the linear scheme, each extrapolated to dx = 0.

    The error is linear in dx, because an opening acts as if it were wider by a fraction of a cell.
    The uncertainty is half the difference of the two rates, or half the smaller of the two
    extrapolations if that is more, because the rates may agree by chance.
    """
    limits, steps = [], []
    for scheme in ("default", "linear flip"):
        runs = select(rows, scene="silo", scheme=scheme, E=1e7, points=4)
        runs = sorted(runs, key=lambda row: row["cell"])[:2]
        if len(runs) < 2:
            return None
        (fine, coarse), ratio = runs, runs[1]["cell"] / runs[0]["cell"]
        limits.append((ratio * fine["rate"] - coarse["rate"]) / (ratio - 1))
        steps.append(abs(limits[-1] - fine["rate"]))
    mean = float(np.mean(limits))
    off = max(abs(limits[1] - limits[0]), min(steps)) / 2 / mean
    return Reference(np.array([mean]), off, "default and linear FLIP, extrapolated to dx = 0")


def references(rows: Sequence[Row]) -> dict[str, Reference | None]:
    """Reference of each panel of the chart; None if its runs are missing."""
    exact = Reference(np.empty(0), 0.0, "one-dimensional equation")
    return {
        "incline": exact,
        "incline_2d": exact,
        "collapse": collapse_reference(rows, "collapse"),
        "runout": collapse_reference(rows, "runout"),
        "silo": silo_reference(rows),
    }


def error(row: Row, panel: str, reference: Reference) -> float:
    """Relative error of a run.

    On an incline it is the larger of the errors of v(y) and of the depth average, because a layer
    that has compacted may have the correct profile for its reduced height.
    """
    if panel.startswith("incline"):
        return max(row["profile_error"], abs(row["mean_error"]))
    if panel == "silo":
        return abs(row["rate"] / reference.value[0] - 1)
    value_of, distance = DISTANCES[panel]
    return distance(value_of(row), reference.value)


def of_panel(rows: Sequence[Row], panel: str, reference: Reference) -> list[tuple[Row, float]]:
    """Runs of a panel with their errors; runs without an error are left out.

    An incline of another angle is another problem, and the run that is the reference has no error.
    """
    scene = "collapse" if panel == "runout" else panel
    errors = [
        (row, error(row, panel, reference))
        for row in select(rows, scene=scene)
        if row["angle_deg"] in (None, 25.0)
    ]
    return [(row, e) for row, e in errors if math.isfinite(e) and e > 0]


def front(points: Sequence[tuple[Row, float]], floor: float = 0.0) -> list[tuple[Row, float]]:
    """Pareto front: runs that no other run beats in both error and core-seconds, by their cost.

    All errors below the floor, the uncertainty of the reference, count as equal.
    """
    best, unbeaten = math.inf, []
    for row, e in sorted(points, key=lambda pair: (pair[0]["core_seconds"], pair[1])):
        if max(e, floor) < best:
            best = max(e, floor)
            unbeaten.append((row, e))
    return unbeaten


def stiffness(row: Row) -> dict[str, float]:
    """Numbers on which the bias of a soft material may depend, at the deepest point.

    They are p/K, mu tau/G, and, for an incline, the relative bias of the depth average in steady
    flow by theory, to first order. With the Jaumann rate s_xx = -s_yy = tau^2/G in steady shear, so
    that p = sigma_yy (1 - mu tau/G): the pressure is too low for the load, and the ratio tau/p, by
    which the layer flows, too large by the fraction mu tau/G. By eq. 4.6 the shear rate grows by
    gain times that, with gain = mu (mu_2 - mu_s)/((mu_2 - mu)(mu - mu_s)), less half of mu tau/G
    due to sqrt(p); and compressed rows are thinner by p/K. These numbers grow linearly with depth,
    so that the depth average has 5/7 of the value at the base.
    """
    material = gr.materials.glass_beads.replace(E=row["E"])
    angle = math.radians(row["angle_deg"] or 0.0)
    depths = {"collapse": COLUMN, "silo": SILO["height"]}
    p = material.rho_c * GRAVITY * math.cos(angle) * depths.get(row["scene"], HEIGHT)
    mu = math.tan(angle) if angle else material.mu_s
    strains = {"p_over_K": p / material.K, "mu_tau_over_G": mu**2 * p / material.G}
    if angle:
        gain = mu * (material.mu_2 - material.mu_s)
        gain /= (material.mu_2 - mu) * (mu - material.mu_s)
        strains["predicted"] = (
            5 / 7 * ((gain - 0.5) * strains["mu_tau_over_G"] - strains["p_over_K"])
        )
    return strains
