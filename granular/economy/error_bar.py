"""A number in fine cells and for stiff grains, and its uncertainty, from a few runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from granular.measure.refinement import richardson

WIDEST = 2.6
"""Runs in cells larger than the finest by more than this are left out of the limit."""


@dataclass(frozen=True)
class Sample:
    """A run, and its result.

    Attributes
    ----------
    cell : float
        Size of its cells [m].
    E : float
        Young's modulus [Pa].
    softness : float
        E of the scene as given, over that of the run.
    seed : int
        0 for the points of the scene as given, else the number of other points.
    value : float
        Result of the measure.
    core_seconds : float
        Processor time of the run [s]; 0 if its record was there already.
    verdict : str
        "ok", or the indicators that make the run suspect.
    """

    cell: float
    E: float
    softness: float
    seed: int
    value: float
    core_seconds: float
    verdict: str


@dataclass(frozen=True)
class ErrorBar:
    """A number, and the parts of its uncertainty, of 95 % each.

    Attributes
    ----------
    value : float
        Limit in fine cells, and for stiff grains.
    of_cells, of_stiffness, of_scatter : float
        Parts of the uncertainty by the size of the cells, by E and by the scatter between runs.
    """

    value: float
    of_cells: float
    of_stiffness: float
    of_scatter: float

    @property
    def uncertainty(self) -> float:
        """The three parts, added in squares."""
        return math.hypot(self.of_cells, self.of_stiffness, self.of_scatter)

    @property
    def largest(self) -> str:
        """Name of the largest part: "cells", "stiffness" or "scatter"."""
        parts = ("cells", "stiffness", "scatter")
        return max(parts, key=lambda name: float(getattr(self, f"of_{name}")))


def error_bar(samples: Sequence[Sample], order: float) -> ErrorBar:
    """Number and uncertainty from runs in at least two sizes of cells.

    The runs with the E of the scene give the limit y_0 in y = y_0 + a dx^p and its standard error,
    which is that of the scatter. The part of the cells is |a| dx^p in the finest ones: all that is
    extrapolated. It contains the limits of orders between p and infinity, and of somewhat lower
    ones. The difference between two E in the same cells, with the same points, is extrapolated to
    stiff grains: with static strains it goes as 1/E, with the speeds that waves leave behind as
    1/sqrt(E). The value is the middle of both, and all that is extrapolated is the part of the
    stiffness.
    """
    base = _different(in_fit(samples))
    cells, values = (np.array([getattr(s, name) for s in base]) for name in ("cell", "value"))
    fit = richardson(cells, values, order=order)
    of_cells = abs(fit.slope) * float(cells.min()) ** order
    free = len(base) - 2
    quantile = float(scipy.stats.t.ppf(0.975, free)) if free else math.inf
    scatter = fit.residual * math.sqrt(len(base) / free) if free else 0.0
    within, beyond, weight = _to_stiff_grains(samples)
    of_differences = weight and quantile * scatter * weight
    return ErrorBar(
        value=fit.limit + within + beyond,
        of_cells=of_cells,
        of_stiffness=abs(beyond),
        of_scatter=math.hypot(fit.uncertainty, of_differences),
    )


def in_fit(samples: Sequence[Sample]) -> list[Sample]:
    """Runs with the E of the scene in cells up to `WIDEST` times as large as the finest."""
    most = WIDEST * min(sample.cell for sample in samples)
    return [s for s in samples if s.softness == 1.0 and s.cell <= most]


def _to_stiff_grains(samples: Sequence[Sample]) -> tuple[float, float, float]:
    """Change from the E of the scene to the largest one, that from there to stiff grains, and the
    standard error of their sum over the scatter of a run."""
    cells = {sample.cell for sample in samples if sample.softness != 1.0}
    if not cells:
        return 0.0, 0.0, 0.0
    (cell,) = cells
    runs = {(s.softness, s.seed): s.value for s in samples if s.cell == cell}
    stiffest, next_ = sorted({softness for softness, _ in runs})[:2]

    def change(softer: float) -> tuple[float, int]:
        """Mean change to the largest E from runs with the same points, and their number."""
        seeds = [seed for of, seed in runs if of == softer and (stiffest, seed) in runs]
        return float(np.mean([runs[stiffest, k] - runs[softer, k] for k in seeds])), len(seeds)

    (last, pairs), (within, _) = change(next_), change(1.0)
    ratio = next_ / stiffest
    share = 0.5 / (ratio - 1.0) + 0.5 / (math.sqrt(ratio) - 1.0)
    weight = (share + (stiffest != 1.0)) * math.sqrt(2.0 / pairs)
    return within, last * share, weight


def _different(samples: Sequence[Sample]) -> list[Sample]:
    """The samples without those that repeat another one: of a scene in which no seed has an
    effect."""
    return list({(sample.cell, sample.value): sample for sample in samples}.values())
