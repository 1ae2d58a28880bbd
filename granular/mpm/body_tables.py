"""Shapes of rigid bodies that are made of arrays: how they compare, and what the core gets."""

from __future__ import annotations

import hashlib
from dataclasses import fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from granular.mpm.body_shapes import Shape

__all__ = ["ArrayShape", "real_array"]


class ArrayShape(Shape):
    """A shape with arrays; two are equal if all their numbers are."""

    @cached_property
    def digest(self) -> str:
        """Digest of all numbers of the shape."""
        told = hashlib.blake2b(type(self).__name__.encode(), digest_size=20)
        for field in fields(self):  # type: ignore[arg-type]  # subclasses are dataclasses
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                told.update(f"{field.name}{value.dtype.str}{value.shape}".encode())
                told.update(np.ascontiguousarray(value).data)
            else:
                told.update(f"{field.name}={value!r}".encode())
        return told.hexdigest()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self is other or self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        parts = []
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            told = f"array of {value.shape}" if isinstance(value, np.ndarray) else repr(value)
            parts.append(f"{field.name}={told}")
        return f"{type(self).__name__}({', '.join(parts)})"


def real_array(name: str, value: object, *, float32: bool = False) -> NDArray:
    """Return a read-only C-contiguous array of floats; without a copy where it is one already.

    Raises
    ------
    TypeError, ValueError
        If it does not hold numbers, or numbers that are not finite; the first is named.
    """
    array = np.asarray(value)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{name} of dtype {array.dtype} must hold real numbers")
    keep = float32 and array.dtype == np.float32
    array = np.ascontiguousarray(array, dtype=np.float32 if keep else np.float64).view()
    array.flags.writeable = False
    if not np.isfinite(array).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise ValueError(f"{name}{list(first)} = {array[first]} must be finite")
    if array.size and max(abs(float(array.min())), abs(float(array.max()))) > 1e30:
        raise ValueError(f"{name} reaches from {array.min()} to {array.max()}, must be below 1e30")
    return array
