"""Errors of the columns of contact dynamics, by two references, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from accuracy.columns import ASPECTS, CODES, discs
from granular.verify.external import columns as external

Row = Mapping[str, Any]

PANELS = (("mu_I", "discs"), ("mu_I", "finest"), ("drucker_prager", "finest"))
"""Law, and what its runs are compared with."""
OURS, THEIRS = "cell_averaged", "taichi"
"""The codes whose finest runs make the reference of a law."""
MEASURES = ("surface", "mean", "toe")


@dataclass(frozen=True)
class Reference:
    """Deposit and motion with which runs are compared.

    Parameters
    ----------
    target : mapping
        Surface [m] at `columns.places`, mean distances [m] over time, and run-out [m].
    uncertainty : mapping
        Error of each measure below which runs cannot be told apart.
    source : str
        Its origin.
    """

    target: Mapping[str, Any]
    uncertainty: Mapping[str, float]
    source: str


def distance(row: Row, target: Mapping[str, Any]) -> dict[str, float]:
    """Relative errors of a run.

    Returns
    -------
    dict
        "surface": L1 of the deposit over its area. "mean": that of the mean distance from the
        middle, the largest over time. "toe": that of the run-out of 99.9 % of the mass.
    """
    h, exact = np.asarray(row["surface"]), np.asarray(target["surface"])
    mean, right = np.asarray(row["mean"]), np.asarray(target["mean"])
    return {
        "surface": float(np.abs(h - exact).sum() / exact.sum()),
        "mean": float(np.max(np.abs(mean / right - 1))),
        "toe": abs(row["toe"] / target["toe"] - 1),
    }


def done(rows: Sequence[Row], **wanted: Any) -> list[Row]:
    """Rows with a result and with the given entries."""
    return [r for r in rows if "surface" in r and all(r[n] == v for n, v in wanted.items())]


def finest(rows: Sequence[Row], **wanted: Any) -> Row | None:
    """The run with the most cells, and of these the one with the most points."""
    found = done(rows, **wanted)
    return max(found, key=lambda r: (r["cells"], r["points"]), default=None)


def of_law(rows: Sequence[Row], law: str, aspect: float) -> Reference | None:
    """Mean of the finest runs of this package and of a peer; half their distance is uncertain.

    Both have the same error against it, which favours neither.
    """
    pair = [finest(rows, code=code, law=law, aspect=aspect) for code in (OURS, THEIRS)]
    ours, theirs = pair
    if ours is None or theirs is None:
        return None
    target = {name: 0.5 * (np.asarray(ours[name]) + np.asarray(theirs[name])) for name in MEASURES}
    names = ", ".join(f"{CODES[r['code']].label}, {r['cells']} cells" for r in (ours, theirs))
    return Reference(target, distance(ours, target), f"mean of {names}")


def of_discs(aspect: float) -> Reference:
    """Contact dynamics; uncertain is what the two halves of its one run differ by."""
    noise = float(external.contact_dynamics_facts(aspect)["asym"][-1])
    return Reference(discs(aspect), {"surface": noise, "mean": 0.0, "toe": 0.0}, "contact dynamics")


def references(rows: Sequence[Row]) -> dict[tuple[str, str, float], Reference]:
    """The references by law, kind and aspect ratio, as far as their runs exist."""
    found: dict[tuple[str, str, float], Reference] = {}
    for law, kind in PANELS:
        for aspect in ASPECTS:
            reference = of_discs(aspect) if kind == "discs" else of_law(rows, law, aspect)
            if reference:
                found[law, kind, aspect] = reference
    return found


def of_panel(
    rows: Sequence[Row], law: str, aspect: float, reference: Reference, measure: str = "surface"
) -> list[tuple[Row, float]]:
    """Runs with their errors; the two that make the reference are left out of it."""
    own = [finest(rows, code=code, law=law, aspect=aspect) for code in (OURS, THEIRS)]
    skip = own if reference.source.startswith("mean") else []
    found = done(rows, law=law, aspect=aspect)
    return [(r, distance(r, reference.target)[measure]) for r in found if r not in skip]


def is_ours(row: Row) -> bool:
    """True for a run of this package with one of its schemes, the published one left out."""
    return row["code"] in ("default", "cell_averaged")


def cheapest_as_good(
    points: Sequence[tuple[Row, float]], row: Row, error: float, floor: float
) -> tuple[Row, float] | None:
    """Cheapest run of this package whose error is not above that of a run, or the floor."""
    good = [(r, e) for r, e in points if is_ours(r) and e <= max(error, floor)]
    return min(good, key=lambda pair: pair[0]["core_seconds"], default=None)


def best(points: Sequence[tuple[Row, float]], code: str, floor: float) -> tuple[Row, float] | None:
    """Run of a code with the least error; of those below the floor the cheapest."""
    mine = [(r, e) for r, e in points if r["code"] == code and math.isfinite(e)]
    return min(mine, key=lambda p: (max(p[1], floor), p[0]["core_seconds"]), default=None)
