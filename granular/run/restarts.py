"""The numbers of a restart state, checked before the core takes them.

A checkpoint may come from a file of a stranger, or be made by hand. These checks use the numbers
alone, for all methods; the core refuses impossible numbers of its clock, of inflows, bodies and
walls, and points outside of the grid.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from granular.record import Checkpoint
from granular.tools.checks import finite, integer

LARGEST = 1e60
"""Largest number of an array, as in the core: products of smaller numbers stay finite."""
LEAST = float(np.finfo(float).tiny)
"""Smallest number that must not be 0, such as a mass."""
MAY_LACK = ("samples", "sampling")
"""Arrays in which NaN stands for a missing value; see `granular.run.monitor`."""
LARGEST_ID = 2**62
"""Largest id of a point, far below the overflow of the ids of points that enter."""


def check_numbers(checkpoint: object) -> None:
    """Refuse a checkpoint of which a number cannot be one of a run.

    Raises
    ------
    TypeError
        If it is no checkpoint.
    ValueError
        If time and step do not agree with the numbers of the engine, a number of an
        array is not finite, a mass is negative, or two points have the same id.
    """
    if not isinstance(checkpoint, Checkpoint):
        kind = type(checkpoint).__name__
        raise TypeError(f"checkpoint must be a Checkpoint, of sim.checkpoint(), not {kind}")
    scalars, arrays = checkpoint.scalars, checkpoint.arrays
    for name, value in scalars.items():
        if isinstance(value, float):
            finite(f"{name} of the checkpoint", value)
    finite("dt of the checkpoint", checkpoint.dt)
    for name in ("time", "step"):
        value, of_engine = getattr(checkpoint, name), scalars.get(name)
        if of_engine is not None and value != of_engine:
            raise ValueError(
                f"{name} = {value!r} of the checkpoint must be {of_engine!r}, as in its scalars"
            )
    for name, array in arrays.items():
        if array.dtype.kind == "f":
            known = array[~np.isnan(array)] if name in MAY_LACK else array
            check_range({name: known}, name, -LARGEST, LARGEST)
    if "mass" in arrays:
        check_range(arrays, "mass", 0.0, LARGEST)
    ids = arrays.get("id", np.empty(0, dtype=np.int64))
    if ids.ndim != 1 or len(np.unique(ids)) != len(ids):
        raise ValueError("the ids of the checkpoint must be distinct, in one row")
    if "id" in arrays:
        check_range(arrays, "id", 0, LARGEST_ID)
    integer("step of the checkpoint", checkpoint.step, 0, LARGEST_ID)


def check_range(arrays: Mapping[str, NDArray], name: str, low: float, high: float) -> None:
    """Refuse an array of a checkpoint with a number outside of a range, which may be nan."""
    array = arrays[name]
    right = (array >= low) & (array <= high)
    if not right.all():
        place = tuple(int(k) for k in np.argwhere(~right)[0])
        index = ", ".join(map(str, place))
        raise ValueError(
            f"{name}[{index}] = {array[place]!s} of the checkpoint must be from {low:g} to {high:g}"
        )
