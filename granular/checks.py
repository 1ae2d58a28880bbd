"""Argument checks: each returns its value, or raises naming argument, value and allowed range.

Wrong kinds raise ``TypeError``; wrong values, NaN among them, raise ``ValueError``. A bool is
never a number here: ``half_width=True`` is a slip, not one metre.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from numbers import Integral, Real
from typing import Any, TypeVar

import numpy as np

__all__ = [
    "finite",
    "in_range",
    "integer",
    "kinds_of",
    "non_negative",
    "one_of",
    "positive",
    "tuple_of",
    "vector",
]

T = TypeVar("T")


def _real(name: str, value: object, wanted: str) -> float:
    """Return `value` as a float and refuse NaN; `wanted` is the expectation in the message."""
    # np.bool_ is not a Real and is refused by that.
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} = {value!r} must be {wanted}, not {type(value).__name__}")
    try:
        number = float(value)
    except OverflowError:
        raise ValueError(f"{name} = {value!r} must be {wanted}") from None
    if math.isnan(number):
        raise ValueError(f"{name} = nan must be {wanted}")
    return number


def finite(name: str, value: object) -> float:
    """Return `value` as a float if it is a finite number.

    Raises
    ------
    TypeError
        If `value` is not a real number (bool included).
    ValueError
        If it is NaN or infinite.
    """
    number = _real(name, value, "a finite number")
    if math.isinf(number):
        raise ValueError(f"{name} = {number} must be a finite number")
    return number


def positive(name: str, value: object, *, allow_inf: bool = False) -> float:
    """Return `value` as a float if it is greater than zero.

    Raises
    ------
    TypeError
        If `value` is not a real number (bool included).
    ValueError
        If it is NaN, zero, negative, or infinite without `allow_inf`.
    """
    wanted = "a number > 0" if allow_inf else "a finite number > 0"
    number = _real(name, value, wanted)
    if number <= 0.0 or (math.isinf(number) and not allow_inf):
        raise ValueError(f"{name} = {number} must be {wanted}")
    return number


def non_negative(name: str, value: object, *, allow_inf: bool = False) -> float:
    """Return `value` as a float if it is zero or greater.

    Raises
    ------
    TypeError
        If `value` is not a real number (bool included).
    ValueError
        If it is NaN, negative, or infinite without `allow_inf`.
    """
    wanted = "a number >= 0" if allow_inf else "a finite number >= 0"
    number = _real(name, value, wanted)
    if number < 0.0 or (math.isinf(number) and not allow_inf):
        raise ValueError(f"{name} = {number} must be {wanted}")
    return number


def in_range(
    name: str,
    value: object,
    low: float,
    high: float,
    *,
    open_low: bool = False,
    open_high: bool = False,
) -> float:
    """Return `value` as a float if it lies between `low` and `high` (ends included unless open).

    Raises
    ------
    TypeError
        If `value` is not a real number (bool included).
    ValueError
        If it is NaN or outside the range.
    """
    wanted = f"in {'(' if open_low else '['}{low}, {high}{')' if open_high else ']'}"
    number = _real(name, value, wanted)
    below = number <= low if open_low else number < low
    above = number >= high if open_high else number > high
    if below or above:
        raise ValueError(f"{name} = {number} must be {wanted}")
    return number


def integer(name: str, value: object, low: int | None = None, high: int | None = None) -> int:
    """Return `value` as an int if it is an integer (NumPy's included) from `low` to `high`.

    Raises
    ------
    TypeError
        If `value` is not an integer type (bool and float included).
    ValueError
        If it is outside the range.
    """
    wanted = "an integer"
    if low is not None and high is not None:
        wanted += f" from {low} to {high}"
    elif low is not None:
        wanted += f" >= {low}"
    elif high is not None:
        wanted += f" <= {high}"
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{name} = {value!r} must be {wanted}, not {type(value).__name__}")
    number = int(value)
    if (low is not None and number < low) or (high is not None and number > high):
        raise ValueError(f"{name} = {number} must be {wanted}")
    return number


def one_of(name: str, value: T, allowed: Iterable[T]) -> T:
    """Return `value` if it equals one of `allowed` (strings, or None, as a rule).

    Raises
    ------
    TypeError
        If `value` is of none of the types of `allowed`.
    ValueError
        If it is of a right type but not among them.
    """
    choices = tuple(allowed)
    wanted = "one of " + ", ".join(repr(choice) for choice in choices)
    # Exact types: True == 1 and must not pass for it.
    if type(value) not in {type(choice) for choice in choices}:
        raise TypeError(f"{name} = {value!r} must be {wanted}, not {type(value).__name__}")
    if value not in choices:
        raise ValueError(f"{name} = {value!r} must be {wanted}")
    return value


def vector(
    name: str,
    value: object,
    dim: int | None = None,
    check: Callable[[str, Any], float] | None = None,
) -> tuple[float, ...]:
    """Return `value` as a tuple of 2 or 3 floats, or of `dim` floats if `dim` is given.

    Each component is checked by `check`, which is `finite` by default.

    Raises
    ------
    TypeError
        If `value` is not a sequence of real numbers.
    ValueError
        If its length is wrong or a component is refused.
    """
    wanted = f"{dim} numbers" if dim is not None else "2 or 3 numbers"
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, np.ndarray)):
        raise TypeError(f"{name} = {value!r} must be {wanted}, not {type(value).__name__}")
    if np.ndim(value) != 1 or len(value) not in ((2, 3) if dim is None else (dim,)):
        raise ValueError(f"{name} = {value!r} must be {wanted}")
    check = finite if check is None else check
    return tuple(check(f"{name}[{i}]", component) for i, component in enumerate(value))


def kinds_of(owner: object, **kinds: type) -> None:
    """Refuse attributes of `owner` that are not instances of the given class."""
    for name, kind in kinds.items():
        value = getattr(owner, name)
        if not isinstance(value, kind):
            raise TypeError(f"{name} = {value!r} must be a {kind.__name__}")


def tuple_of(name: str, value: object, kinds: tuple[type, ...]) -> tuple[Any, ...]:
    """Return a sequence of instances of these classes as a tuple; errors name the index."""
    wanted = " or ".join(kind.__name__ for kind in kinds)
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise TypeError(f"{name} = {value!r} must be a sequence of {wanted}")
    for i, entry in enumerate(value):
        if not isinstance(entry, kinds):
            raise TypeError(f"{name}[{i}] = {entry!r} must be a {wanted}")
    return tuple(value)
