"""Gravity, constant or changing in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from granular.tools.arrays import Array
from granular.tools.checks import (
    ascending,
    check_fields,
    finite,
    integer,
    non_negative,
    sequence,
    set_fields,
    vector,
)
from granular.tools.description import Description

EARTH = 9.81
"""Gravity of the earth [m/s2]: the default of all of `granular.theory`. Scenes of a paper have the
gravity of the paper, so that a comparison with them must pass it on."""
DUNATUNGA_KAMRIN = 9.8
"""Gravity of Dunatunga & Kamrin 2015 and of the scenes after it [m/s2]."""


@dataclass(frozen=True)
class Gravity(Description):
    """Gravity that varies linearly between given times and is constant before and after them.

    The default is the 2D ramp of Dunatunga & Kamrin 2015, section 4: 9.8 m/s2 in 0.1 s.

    Parameters
    ----------
    times : tuple of float, length k >= 1
        Times [s], >= 0, ascending.
    vectors : tuple of k tuples of float, length dim
        Acceleration at these times [m/s2].
    {raises}.
    """

    times: tuple[float, ...] = (0.0, 0.1)
    vectors: tuple[tuple[float, ...], ...] = ((0.0, 0.0), (0.0, -DUNATUNGA_KAMRIN))

    def __post_init__(self) -> None:
        if np.ndim(self.times) == 1 and any(np.less(self.times, 0.0)):
            raise ValueError(
                f"times = {self.times} must be >= 0: for a constant gravity take "
                f"Gravity.constant({self.times})"
            )
        check_fields(self, ascending, "times")
        vectors = sequence("vectors", self.vectors)
        if len(self.times) != len(vectors):
            raise ValueError(f"times = {self.times} must be as many as vectors")
        dim = len(vector("vectors[0]", vectors[0]))
        checked = tuple(vector(f"vectors[{i}]", v, dim) for i, v in enumerate(vectors))
        set_fields(self, vectors=checked)

    @classmethod
    def constant(cls, value: float | Sequence[float], dim: int = 2) -> Self:
        """Return a gravity that does not change.

        Parameters
        ----------
        value : float or sequence of float
            Magnitude [m/s2], >= 0, against the last axis, or a vector [m/s2].
        dim : {2, 3}
            Dimension, for a magnitude.
        {raises}.

        Examples
        --------
        >>> moon = gr.Gravity.constant(1.62)
        >>> tilted = gr.Gravity.constant((3.0, -9.3))
        """
        if isinstance(value, Sequence | np.ndarray):
            return cls((0.0,), (vector("value", value),))
        size = non_negative("value", value)
        return cls((0.0,), ((*(0.0,) * (integer("dim", dim, 2, 3) - 1), -size),))

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return len(self.vectors[0])

    def at(self, t: float) -> Array:
        """Acceleration at time `t` [s], shape (dim,) [m/s2]."""
        t = finite("t", t)
        return np.array([np.interp(t, self.times, g) for g in zip(*self.vectors, strict=True)])

    def swings(self, begin: float, end: float, window: float) -> bool:
        """True if the path of gravity in a window [s] is longer, by a hundredth, than its net
        change.

        The windows follow each other from `begin` to `end` [s]. The work of such a gravity does not
        follow from the states at the ends of the windows.
        """
        times = np.array(self.times)
        inside = times[(times > begin) & (times < end)]
        if not len(inside):
            return False
        edges = np.linspace(begin, end, int(np.ceil((end - begin) / window)) + 1)
        all_times = np.union1d(edges, inside)
        vectors = np.array(
            [np.interp(all_times, times, g) for g in zip(*self.vectors, strict=True)]
        )
        way = np.cumsum(np.r_[0.0, np.linalg.norm(np.diff(vectors, axis=1), axis=0)])
        at = np.searchsorted(all_times, edges)
        change = np.linalg.norm(np.diff(vectors[:, at], axis=1), axis=0)
        return bool(np.any(np.diff(way[at]) > 1.01 * change + 1e-12 * way[-1]))
