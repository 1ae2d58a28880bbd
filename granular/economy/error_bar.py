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
        Processor time of the run [s], or of reading its record if that was there already.
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
    """Number and uncertainty from runs in at least two sizes of cells, and with two E.

    The runs with the largest E give the limit y_0 in y = y_0 + a dx^p and its standard error, which
    is that of the scatter. The part of the cells is |a| dx^p in the finest ones: all that is
    extrapolated. It contains the limits of orders between p and infinity, and of somewhat lower
    ones. The differences from runs with the next smaller E in the same cells, with the same points,
    are extrapolated to stiff grains: with static strains they go as 1/E, with the speeds that waves
    leave behind as 1/sqrt(E). The value is the middle of both, and all that is extrapolated is the
    part of the stiffness.
    """
    base = different(in_fit(samples))
    cells, values = (np.array([getattr(s, name) for s in base]) for name in ("cell", "value"))
    fit = richardson(cells, values, order=order)
    free = len(base) - 2
    scatter = fit.residual * math.sqrt(len(base) / free) if free else 0.0
    of_run = float(scipy.stats.t.ppf(0.975, free)) * scatter if free else 0.0
    beyond, weight = _to_stiff_grains(samples)
    of_changes = of_run * weight
    return ErrorBar(
        value=fit.limit + beyond,
        of_cells=abs(fit.slope) * float(cells.min()) ** order,
        of_stiffness=abs(beyond),
        of_scatter=math.hypot(fit.uncertainty, of_changes),
    )


def _to_stiff_grains(samples: Sequence[Sample]) -> tuple[float, float]:
    """Change from the largest E to stiff grains, and its standard error over the scatter of a
    run."""
    stiff, soft = levels(samples)
    if soft is None:
        return 0.0, 0.0
    known = {(s.cell, s.seed): s.value for s in samples if s.softness == soft}
    changes = [
        s.value - known[s.cell, s.seed]
        for s in samples
        if s.softness == stiff and (s.cell, s.seed) in known
    ]
    ratio = soft / stiff
    share = 0.5 / (ratio - 1.0) + 0.5 / (math.sqrt(ratio) - 1.0)
    return share * float(np.mean(changes)), share * math.sqrt(2.0 / len(changes))


def levels(samples: Sequence[Sample]) -> tuple[float, float | None]:
    """Softness of the runs with the largest E, and with the next smaller one, if there is one."""
    stiff, *softer = sorted({sample.softness for sample in samples})
    return stiff, softer[0] if softer else None


def in_fit(samples: Sequence[Sample]) -> list[Sample]:
    """Runs with the largest E in cells up to `WIDEST` times as large as the finest of them."""
    stiff, _ = levels(samples)
    stiffest = [sample for sample in samples if sample.softness == stiff]
    most = WIDEST * min(sample.cell for sample in stiffest)
    return [sample for sample in stiffest if sample.cell <= most]


def different(samples: Sequence[Sample]) -> list[Sample]:
    """The samples without those that repeat another one: of a scene in which no seed has an
    effect."""
    return list({(sample.cell, sample.value): sample for sample in samples}.values())
