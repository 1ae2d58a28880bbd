"""Gravity, constant or changing in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from granular.checks import finite, non_negative, vector

__all__ = ["Gravity"]


@dataclass(frozen=True)
class Gravity:
    """Gravity that varies linearly between given times and is constant before and after them.

    Parameters
    ----------
    times : tuple of float, length k >= 1
        Times [s], >= 0, ascending.
    vectors : tuple of k tuples of float, length dim
        Acceleration at these times [m/s2].

    The default is the ramp of Dunatunga & Kamrin 2015, section 4: 9.8 m/s2 in 0.1 s.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    times: tuple[float, ...] = (0.0, 0.1)
    vectors: tuple[tuple[float, ...], ...] = ((0.0, 0.0), (0.0, -9.8))

    def __post_init__(self) -> None:
        for name in ("times", "vectors"):
            value = getattr(self, name)
            if isinstance(value, str) or not isinstance(value, (Sequence, np.ndarray)):
                raise TypeError(f"{name} = {value!r} must be a sequence")
        times = tuple(non_negative(f"times[{i}]", t) for i, t in enumerate(self.times))
        if not times or len(times) != len(self.vectors):
            raise ValueError(f"times = {times} must be as many as vectors, and at least one")
        if any(b <= a for a, b in pairwise(times)):
            raise ValueError(f"times = {times} must ascend")
        vectors = [vector("vectors[0]", self.vectors[0])]
        for i, value in enumerate(self.vectors[1:], start=1):
            vectors.append(vector(f"vectors[{i}]", value, len(vectors[0])))
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "vectors", tuple(vectors))

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return len(self.vectors[0])

    def at(self, t: float) -> NDArray[np.float64]:
        """Acceleration at time `t` [s], shape (dim,) [m/s2]."""
        t = finite("t", t)
        return np.array([np.interp(t, self.times, g) for g in zip(*self.vectors, strict=True)])
