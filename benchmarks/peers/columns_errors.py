"""Errors of the columns of contact dynamics, by two references, and what follows from them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular.verify.external import columns as external
from peers.columns import ASPECTS, discs

Row = Mapping[str, Any]

PANELS = (("mu_I", "discs"), ("mu_I", "finest"), ("drucker_prager", "finest"))
"""Law, and what its runs are compared with in the chart."""
OTHERS = (("mu_I", "peer"), ("drucker_prager", "peer"))
"""The same for a table only."""
OURS, PEER = ("cell_averaged", "default"), "taichi"
"""The codes whose finest runs are references."""
MEASURES = ("surface", "mean", "toe")


@dataclass(frozen=True)
class Reference:
    """Deposit and motion with which runs are compared.

    Parameters
    ----------
    target : mapping
        Surface [m] at `columns.places`, mean distances [m] over time, and run-out [m].
    uncertainty : mapping
        Error of each measure below which runs cannot be distinguished.
    made_of : sequence of tuple
        Keys of the runs it is made of, which are not compared with it.
    """

    target: Mapping[str, Any]
    uncertainty: Mapping[str, float]
    made_of: Sequence[tuple[Any, ...]] = ()


def key(row: Row) -> tuple[Any, ...]:
    """Entries that tell a run from others."""
    return tuple(row[n] for n in ("code", "law", "aspect", "cells", "points"))


def distance(row: Row, target: Mapping[str, Any]) -> dict[str, float]:
    """Relative errors of a run.

    Returns
    -------
    dict
        "surface": L1 of the deposit over its area. "mean": of the mean distance from the middle,
        the largest over time. "toe": of the run-out of 99.9 % of the mass.
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
    """The run with the most cells, with four points per cell."""
    return max(done(rows, points=4, **wanted), key=lambda r: r["cells"], default=None)


def _pair(rows: Sequence[Row], cells: int, **wanted: Any) -> list[Row]:
    """The runs of our two schemes with so many cells."""
    by_code = [done(rows, code=c, cells=cells, points=4, **wanted) for c in OURS]
    return [runs[0] for runs in by_code if runs]


def _mean(pair: Sequence[Row]) -> dict[str, Any]:
    return {name: np.mean([r[name] for r in pair], axis=0) for name in MEASURES}


def of_ours(rows: Sequence[Row], law: str, aspect: float) -> Reference | None:
    """Mean of the finest runs of our two schemes.

    Uncertain is half their distance, or the change by the last halving of the cells if that is
    more.
    """
    sizes = sorted({r["cells"] for r in done(rows, law=law, aspect=aspect)}, reverse=True)
    pairs = [_pair(rows, cells, law=law, aspect=aspect) for cells in sizes]
    whole = [pair for pair in pairs if len(pair) == len(OURS)]
    if len(whole) < 2:
        return None
    target = _mean(whole[0])
    half = distance(whole[0][0], target)
    step = distance(_mean(whole[1]), target)
    uncertainty = {name: max(half[name], step[name]) for name in MEASURES}
    ids = [key(row) for row in whole[0]]
    return Reference(target, uncertainty, ids)


def of_peer(rows: Sequence[Row], law: str, aspect: float) -> Reference | None:
    """The finest run of the peer; uncertain is the change by its last halving of the cells."""
    fine = finest(rows, code=PEER, law=law, aspect=aspect)
    if fine is None:
        return None
    half = done(rows, code=PEER, law=law, aspect=aspect, points=4, cells=fine["cells"] // 2)
    return Reference(fine, distance(half[0], fine), [key(fine)]) if half else None


def of_discs(aspect: float) -> Reference:
    """Contact dynamics; the uncertainty is the difference of the two halves of its one run."""
    noise = float(external.Discs.load(aspect).facts["asym"][-1])
    return Reference(discs(aspect), {"surface": noise, "mean": 0.0, "toe": 0.0})


def references(rows: Sequence[Row]) -> dict[tuple[str, str, float], Reference]:
    """The references by law, kind and aspect ratio, as far as their runs exist."""
    made = {
        "discs": lambda law, aspect: of_discs(aspect),
        "finest": lambda law, aspect: of_ours(rows, law, aspect),
        "peer": lambda law, aspect: of_peer(rows, law, aspect),
    }
    candidates = {
        (law, kind, aspect): made[kind](law, aspect)
        for law, kind in PANELS + OTHERS
        for aspect in ASPECTS
    }
    return {name: reference for name, reference in candidates.items() if reference}


def of_panel(
    rows: Sequence[Row], law: str, aspect: float, reference: Reference, measure: str = "surface"
) -> list[tuple[Row, float]]:
    """Runs with their errors; those that make the reference are left out."""
    runs = done(rows, law=law, aspect=aspect)
    return [
        (r, distance(r, reference.target)[measure]) for r in runs if key(r) not in reference.made_of
    ]


def is_ours(row: Row) -> bool:
    """True for a run of this package with one of its schemes, the published one left out."""
    return row["code"] in OURS


def cheapest_as_good(
    points: Sequence[tuple[Row, float]], row: Row, error: float, floor: float
) -> tuple[Row, float] | None:
    """Cheapest run of this package whose error is not above the error of a run, or the floor."""
    good = [(r, e) for r, e in points if is_ours(r) and e <= max(error, floor)]
    return min(good, key=lambda pair: pair[0]["core_seconds"], default=None)


def best(points: Sequence[tuple[Row, float]], code: str, floor: float) -> tuple[Row, float] | None:
    """Run of a code with the least error; of those below the floor the cheapest."""
    mine = [(r, e) for r, e in points if r["code"] == code and math.isfinite(e)]
    return min(mine, key=lambda p: (max(p[1], floor), p[0]["core_seconds"]), default=None)
