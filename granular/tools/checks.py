"""Argument checks: each returns its value, or raises naming argument, value and allowed range.

Wrong kinds raise ``TypeError``; wrong values, lengths and numbers out of range, NaN among them,
raise ``ValueError``. A bool is never a number here: ``half_width=True`` is a mistake, not one
metre. NumPy's numbers are numbers. Numbers in SI units are at most `LARGEST`, and those above zero
at least `LEAST`, so that no product or ratio of a few of them overflows or vanishes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from numbers import Integral, Real
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")

LARGEST, LEAST = 1e30, 1e-30
"""Largest size of a number in SI units, and the least of one that must be above zero. Ten factors
of this size stay within the range of floats."""


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
    """Return `value` as a float if it is a finite number."""
    number = _real(name, value, "a finite number")
    if math.isinf(number):
        raise ValueError(f"{name} = {number} must be a finite number")
    return _of_size(name, number)


def _of_size(name: str, number: float, *, above_zero: bool = False) -> float:
    """Return a number if it is not too large, or too near to a zero that it must not be."""
    if LARGEST < abs(number) < math.inf:
        raise ValueError(f"{name} = {number} must be at most {LARGEST:g} in size")
    if above_zero and number < LEAST:
        raise ValueError(f"{name} = {number} must be at least {LEAST:g}")
    return number


def positive(name: str, value: object, *, allow_inf: bool = False) -> float:
    """Return `value` as a float if it is greater than zero; infinity needs `allow_inf`."""
    wanted = "a number > 0" if allow_inf else "a finite number > 0"
    number = _real(name, value, wanted)
    if number <= 0.0 or (math.isinf(number) and not allow_inf):
        raise ValueError(f"{name} = {number} must be {wanted}")
    return _of_size(name, number, above_zero=True)


def non_negative(name: str, value: object, *, allow_inf: bool = False) -> float:
    """Return `value` as a float if it is zero or greater; infinity needs `allow_inf`."""
    wanted = "a number >= 0" if allow_inf else "a finite number >= 0"
    number = _real(name, value, wanted)
    if number < 0.0 or (math.isinf(number) and not allow_inf):
        raise ValueError(f"{name} = {number} must be {wanted}")
    return _of_size(name, number)


def in_range(
    name: str,
    value: object,
    low: float,
    high: float,
    *,
    open_low: bool = False,
    open_high: bool = False,
) -> float:
    """Return `value` as a float if it lies between `low` and `high` (ends included unless open)."""
    wanted = f"in {'(' if open_low else '['}{low}, {high}{')' if open_high else ']'}"
    number = _real(name, value, wanted)
    below = number <= low if open_low else number < low
    above = number >= high if open_high else number > high
    if below or above:
        raise ValueError(f"{name} = {number} must be {wanted}")
    return _of_size(name, number, above_zero=open_low and low == 0)


def integer(name: str, value: object, low: int | None = None, high: int | None = None) -> int:
    """Return `value` as an int if it is an integer (NumPy's included) from `low` to `high`."""
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
    """Return `value` if it equals one of `allowed` (strings, or None, as a rule)."""
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
    """
    wanted = f"{dim} numbers" if dim is not None else "2 or 3 numbers"
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, np.ndarray)):
        raise TypeError(f"{name} = {value!r} must be {wanted}, not {type(value).__name__}")
    if np.ndim(value) != 1 or len(value) not in ((2, 3) if dim is None else (dim,)):
        raise ValueError(f"{name} = {value!r} must be {wanted}")
    check = finite if check is None else check
    return tuple(check(f"{name}[{i}]", component) for i, component in enumerate(value))


def truth(name: str, value: object) -> bool:
    """Return `value` if it is True or False."""
    if not isinstance(value, bool):
        raise TypeError(f"{name} = {value!r} must be True or False")
    return value


def sequence(name: str, value: object) -> tuple[Any, ...]:
    """Return the entries of a sequence or array as a tuple."""
    if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
        raise TypeError(f"{name} = {value!r} must be a sequence, not {type(value).__name__}")
    return tuple(value)


def _unmasked(name: str, value: Any) -> None:
    """Refuse an array whose mask NumPy would drop, with the positions of the masked entries."""
    if np.ma.is_masked(value):
        masked = np.argwhere(np.ma.getmaskarray(value))
        first = ", ".join(map(str, masked[0]))
        raise ValueError(f"{name}: {len(masked)} entries are masked, the first {name}[{first}]")


def array(name: str, value: Any, shape: Sequence[int | None], dtype: type = float) -> NDArray[Any]:
    """Return a read-only copy of an array of finite numbers (or of bools) of a shape.

    None in `shape` stands for any length.
    """
    _unmasked(name, value)
    try:
        numbers = np.array(value)
    except ValueError:
        raise ValueError(f"{name} must be an array: its rows must be of one length") from None
    kinds = "b" if dtype is bool else "fiu"
    if numbers.dtype.kind not in kinds:
        raise TypeError(f"{name} of {numbers.dtype} must be an array of {dtype.__name__}")
    wanted = tuple("any" if n is None else n for n in shape)
    fits = numbers.ndim == len(shape) and all(
        n in (None, length) for n, length in zip(shape, numbers.shape, strict=True)
    )
    if not fits:
        raise ValueError(f"{name} of shape {numbers.shape} must have the shape {wanted}")
    if not np.isfinite(numbers).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(numbers))[0])
        raise ValueError(f"{name}[{', '.join(map(str, place))}] must be a finite number")
    if dtype is not bool and numbers.size:
        _of_size(f"{name}, its largest,", float(max(numbers.max(), -numbers.min(), key=abs)))
    numbers = np.ascontiguousarray(numbers, dtype=dtype)
    numbers.setflags(write=False)
    return numbers


def real_array(name: str, value: object, *, float32: bool = False) -> NDArray[Any]:
    """Return a read-only C-contiguous array of floats; without a copy where it is one already.

    Raises
    ------
    TypeError, ValueError
        If it does not hold numbers, or numbers that are not finite; the first is named.
    """
    _unmasked(name, value)
    array = np.asarray(value)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{name} of dtype {array.dtype} must hold real numbers")
    keep = float32 and array.dtype == np.float32
    array = np.ascontiguousarray(array, dtype=np.float32 if keep else np.float64).view()
    array.flags.writeable = False
    if not np.isfinite(array).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name}{list(first)} = {array[first]} must be finite")
    if array.size and max(abs(float(array.min())), abs(float(array.max()))) > LARGEST:
        raise ValueError(f"{name} reaches from {array.min()} to {array.max()}, must be below 1e30")
    return array


def ascending(name: str, value: object) -> tuple[float, ...]:
    """Return a sequence of at least one time as floats >= 0 that ascend."""
    times = tuple(non_negative(f"{name}[{i}]", t) for i, t in enumerate(sequence(name, value)))
    if not times or any(b <= a for a, b in pairwise(times)):
        raise ValueError(f"{name} = {times} must ascend, and be at least one")
    return times


def spans(name: str, value: object) -> tuple[tuple[float, float], ...]:
    """Return one or two pairs (low, high) of floats, the low end first."""
    pairs = sequence(name, value)
    if len(pairs) not in (1, 2):
        raise ValueError(f"{name} = {value!r} must be pairs (low, high), one for each other axis")
    result = []
    for i, pair in enumerate(pairs):
        low, high = vector(f"{name}[{i}]", pair, 2)
        if not high > low:
            raise ValueError(f"{name}[{i}] = {(low, high)} must have its low end first")
        result.append((low, high))
    return tuple(result)


def kinds_of(owner: object, **kinds: type) -> None:
    """Refuse attributes of `owner` that are not instances of the given class."""
    for name, kind in kinds.items():
        instance(name, getattr(owner, name), kind)


def instance(name: str, value: object, kind: type) -> None:
    """Refuse a value that is not an instance of a class."""
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


def set_fields(part: object, **values: object) -> None:
    """Set attributes of a frozen dataclass."""
    for name, value in values.items():
        object.__setattr__(part, name, value)


def check_fields(
    part: object, check: Callable[..., Any], *names: str, optional: bool = False, **limits: Any
) -> None:
    """Replace attributes of a frozen dataclass by the results of `check`.

    `limits` are further arguments of `check`. Where `optional`, None is left as it is.
    """
    for name in names:
        value = getattr(part, name)
        if value is not None or not optional:
            object.__setattr__(part, name, check(name, value, **limits))
