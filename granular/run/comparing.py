"""Comparison of two records: the differences between their scenes and their results."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from granular.model.state import State
from granular.record import open_trajectory
from granular.tools.arrays import Array

__all__ = ["Comparison", "compare"]


MOST_ROWS = 40
"""Largest number of differing numbers of the scenes that are printed."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Differences between two records.

    Attributes
    ----------
    numbers : tuple of (str, value, value)
        Paths in the JSON of the scenes, with the values of both where they differ; None where one
        does not have the path.
    results : tuple of (str, float, float)
        Results at the last time that both have: their names with units, and the values of both.
    time : float
        That time [s]; nan if there is none.
    same_bits : bool
        True if the points of all frames are equal to the last bit.
    """

    numbers: tuple[tuple[str, Any, Any], ...]
    results: tuple[tuple[str, float, float], ...]
    time: float
    same_bits: bool

    def __str__(self) -> str:
        lines = [f"{place}: {a} | {b}" for place, a, b in self.numbers[:MOST_ROWS]]
        if len(self.numbers) > MOST_ROWS:
            lines.append(f"and {len(self.numbers) - MOST_ROWS} other numbers of the scenes")
        if not self.numbers:
            lines.append("the scenes are equal")
        if self.same_bits:
            return "\n".join([*lines, "all frames are equal to the last bit"])
        lines.append(f"results at t = {self.time:.6g} s")
        for name, a, b in self.results:
            share = f"{abs(b - a) / max(abs(a), abs(b)):.2g} of it" if a or b else "equal"
            lines.append(f"{name:>28}: {a:.6g} | {b:.6g}  ({share})")
        return "\n".join(lines)


def compare(first: str | Path, second: str | Path) -> Comparison:
    """Compare two records: the numbers of their scenes, and their results.

    Parameters
    ----------
    first, second : path
        Records of runs.

    Returns
    -------
    Comparison

    Raises
    ------
    FileNotFoundError, RecordError
        If a record cannot be read.
    """
    with open_trajectory(first) as a, open_trajectory(second) as b:
        scenes = (dict(_flat(json.loads(record.scene.to_json())["scene"])) for record in (a, b))
        one, other = scenes
        places = [*one, *(place for place in other if place not in one)]
        numbers = tuple(
            (place, one.get(place), other.get(place))
            for place in places
            if one.get(place) != other.get(place)
        )
        times = [np.asarray(record.times) for record in (a, b)]
        same = len(a) == len(b) and np.array_equal(times[0], times[1])
        same = same and all(_equal(a[k], b[k]) for k in range(len(a)))
        frames = _last_common(*times)
        if frames is None:
            return Comparison(numbers, (), math.nan, same)
        left, right = _summary(a[frames[0]]), _summary(b[frames[1]])
        results = tuple((name, left[name], right[name]) for name in left if name in right)
        return Comparison(numbers, results, float(times[0][frames[0]]), same)


def _flat(part: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Values of nested dictionaries and lists, with their paths."""
    if isinstance(part, dict | list):
        entries = part.items() if isinstance(part, dict) else enumerate(part)
        for name, value in entries:
            yield from _flat(value, f"{place}.{name}" if place else str(name))
    else:
        yield place, part


def _equal(a: State, b: State) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("id", "x", "v"))


def _last_common(a: Array, b: Array) -> tuple[int, int] | None:
    """Frames of two records, by their times, that are nearest to each other, the last such pair.

    Two frames belong together that are within half the spacing of the frames.
    """
    if not len(a) or not len(b):
        return None
    spacings = [np.diff(times).min() for times in (a, b) if len(times) > 1]
    gaps = np.abs(a[:, None] - b)
    near = np.flatnonzero(gaps.min(axis=1) <= 0.5 * min(spacings, default=0.0))
    return (int(near[-1]), int(gaps[near[-1]].argmin())) if len(near) else None


def _summary(state: State) -> dict[str, float]:
    """Results of a state by name and unit; in 2D per metre of depth."""
    results: dict[str, float] = {"points": state.n}
    if not state.n:
        return results
    x, mass = np.asarray(state.x), np.asarray(state.mass)
    results["mass [kg]"] = float(mass.sum())
    centre = np.average(x, axis=0, weights=mass)
    for axis, middle, end in zip("xyz", centre, x.max(axis=0), strict=False):
        results[f"centre of mass, {axis} [m]"] = float(middle)
        results[f"farthest along {axis} [m]"] = float(end)
    results["kinetic energy [J]"] = 0.5 * float(mass @ np.sum(np.asarray(state.v) ** 2, axis=1))
    results["mean pressure [Pa]"] = float(np.mean(state.pressure))
    return results
