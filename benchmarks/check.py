"""Comparison of results with stored ones: `python benchmarks NAME --check`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

TOLERANCE, TIMES_SCATTER, LEAST = 0.02, 3.0, 1e-3
"""Relative change of a number that is allowed. Where the results have a scatter, which is the
difference of two runs, three times this scatter is allowed, and a thousandth of the number."""
COSTS = ("ns", "seconds", "wall", "seconds_of_core", "core_seconds", "nanoseconds")
"""Names of times, which are those of a machine and a day."""
UNCOMPARED = ("stamp", "stamps", "course", *COSTS)


def differences(old: Any, new: Any, tolerance: float, at: str = "") -> Iterator[str]:
    """Numbers and texts that have changed by more than is allowed, one a line."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        scatter = old.get("scatter") if isinstance(old.get("scatter"), Mapping) else None
        for key in [*old, *(key for key in new if key not in old)]:
            if key in UNCOMPARED or key == "scatter":
                continue
            place = f"{at}/{key}"
            if key not in new or key not in old:
                yield f"{place}: only in the {'stored' if key in old else 'new'} results"
            elif key == "numbers" and scatter is not None:
                yield from _of_numbers(old[key], new[key], scatter, at)
            else:
                yield from differences(old[key], new[key], tolerance, place)
    elif isinstance(old, list) and isinstance(new, list):
        if len(old) != len(new):
            yield f"{at}: {len(old)} rows stored, {len(new)} now"
        for k, (a, b) in enumerate(zip(old, new, strict=False)):
            yield from differences(a, b, tolerance, f"{at}/{_name(a, k)}")
    elif _changed(old, new, tolerance * abs(old) if _is_number(old) else 0.0):
        yield f"{at}: {_text(old)} stored, {_text(new)} now"


def _of_numbers(
    old: Mapping[str, Any], new: Mapping[str, Any], scatter: Mapping[str, float], at: str
) -> Iterator[str]:
    """Changes of numbers by more than their scatter allows."""
    for name, value in old.items():
        if name not in new:
            yield f"{at}, {name}: not in the new results"
            continue
        allowed = 0.0
        if _is_number(value):
            allowed = TIMES_SCATTER * scatter.get(name, 0.0) + LEAST * abs(value)
        if _changed(value, new[name], allowed):
            yield f"{at}, {name}: {_text(value)} stored, {_text(new[name])} now"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _changed(old: Any, new: Any, allowed: float) -> bool:
    if not (_is_number(old) and _is_number(new)):
        return bool(old != new)
    if math.isnan(old) or math.isnan(new):
        return math.isnan(old) != math.isnan(new)
    return abs(new - old) > allowed


def _name(row: Any, k: int) -> str:
    """Name of a row by its first texts, else its number."""
    texts = [v for v in row.values() if isinstance(v, str)] if isinstance(row, Mapping) else []
    return " ".join(texts[:2]) or str(k)


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
