"""The numbers that `answer` knows by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import cast

import numpy as np

from granular.measure.discharge import discharge as discharge_in
from granular.measure.discharge import mass_history
from granular.measure.heap import repose_angle as slope_of
from granular.measure.heap import runout as runout_of
from granular.measure.heap import surface
from granular.record import Trajectory
from granular.tools.checks import one_of

Quantity = Callable[[Trajectory], float]

STEADY = (0.2, 0.8)
"""Shares of what leaves in a run between which its rate is taken."""


def discharge(record: Trajectory) -> float:
    """Rate of discharge in the steady part of a run."""
    history = mass_history(record)
    first, last = float(history.mass[0]), float(history.mass[-1])
    if not last < first:
        raise ValueError(f"no material leaves in {record.scene.duration:g} s: there is no rate")
    upper, lower = (first - share * (first - last) for share in STEADY)
    return discharge_in(history, window=(upper, lower)).rate


def runout(record: Trajectory) -> float:
    """Run-out of 99.9 % of the mass at the end of a run, over the half-width."""
    return runout_of(record[-1]).quantile


def height(record: Trajectory) -> float:
    """Largest height of the surface at the end of a run."""
    return float(np.nanmax(surface(record[-1]).height))


def repose_angle(record: Trajectory) -> float:
    """Mean slope at the end of a run."""
    return slope_of(record[-1]).mean_deg


def mean_speed(record: Trajectory) -> float:
    """Mean speed of all points at the end of a run, by mass."""
    last = record[-1]
    return float(np.average(np.linalg.norm(last.v, axis=1), weights=last.mass))


QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        function.__name__: function
        for function in (discharge, runout, height, repose_angle, mean_speed)
    }
)


def quantity(measure: str | Quantity) -> Quantity:
    """Function of a record that a name stands for, or that a user gives, with a check of its
    result."""
    if not callable(measure):
        measure = QUANTITIES[one_of("measure", measure, tuple(QUANTITIES))]
    function = measure

    def checked(record: Trajectory) -> float:
        value: object = function(record)
        real = isinstance(value, int | float | np.integer | np.floating)
        if not real or isinstance(value, bool) or not math.isfinite(cast(float, value)):
            raise ValueError(
                f"the measure returned {value!r} in cells of {record.scene.grid.cell:g} m, must be "
                "a finite number there"
            )
        return float(cast(float, value))

    return checked
