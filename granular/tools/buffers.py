"""The build of the core, and the arrays that it borrows, for the engines of both methods."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.tools.arrays import Array

PAGE, LINE = 4096, 64  # bytes


def default_isa() -> str:
    """Instruction set requested by the environment; an empty string means the best available."""
    return os.environ.get("GRANULAR_ISA", "")


def stored_type(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the type in which the numbers of a buffer are stored: doubles instead of floats."""
    return np.dtype(np.float64) if dtype == np.float32 else dtype


def fill(buffers: Mapping[str, NDArray], stored: Mapping[str, NDArray], slots: NDArray) -> None:
    """Put the arrays of a checkpoint into buffers, at `slots` along the last axis.

    Raises
    ------
    ValueError
        If an array is missing, or has another shape or type. Buffers of floats take doubles.
    """
    for name, array in buffers.items():
        _check(name, stored.get(name), (*array.shape[:-1], len(slots)), array.dtype)
        array[..., slots] = stored[name]


def check_stored(engine: _core.Engine, stored: Mapping[str, NDArray], n: int) -> None:
    """Refuse arrays of a checkpoint that `fill` would refuse for the buffers of n points."""
    for name, count, _, _, dtype in engine.fields():
        _check(name, stored.get(name), (count, n), dtype)
    _check("id", stored.get("id"), (n,), np.dtype(np.int64))


def _check(name: str, values: NDArray | None, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    if values is None or values.shape != shape or values.dtype != stored_type(dtype):
        raise ValueError(f"the checkpoint does not hold {name} of {shape[-1]} points")


def show_config() -> _core.BuildInfo:
    """Return compiler and flags of the build, and the instruction set of simulations.

    Raises
    ------
    ValueError
        If the environment variable GRANULAR_ISA names a set that this machine does not have.
    """
    return _core.build_info(default_isa())


def allocate(engine: _core.Engine | _core.Sph, capacity: int) -> dict[str, NDArray]:
    """Make zeroed buffers: {field: (component, capacity)} and "id" (capacity,).

    All rows lie in one block at multiples of 64 bytes. The same index in different rows has
    different offsets in a memory page, so that the processor does not take loads from one row for
    stores to another (a precaution: on the one machine that was tried it had no effect).
    """
    rows = {name: (count, dtype) for name, count, _, _, dtype in engine.fields()}
    rows["id"] = 1, np.dtype(np.int64)
    size = min(dtype.itemsize for _, dtype in rows.values())
    skew = max(PAGE // sum(count for count, _ in rows.values()) // LINE, 1) * LINE
    slots = -(-capacity * size // PAGE) * (PAGE // size) + skew // size
    length = sum(count * slots * dtype.itemsize for count, dtype in rows.values())
    raw = engine.zeros(length + LINE)
    start = -raw.ctypes.data % LINE
    buffers: dict[str, NDArray] = {}
    for name, (count, dtype) in rows.items():
        end = start + count * slots * dtype.itemsize
        buffers[name] = raw[start:end].view(dtype).reshape(count, slots)
        start = end
    buffers["id"] = buffers["id"][0]
    buffers["id"][:] = -1
    return buffers


def rows_of(engine: _core.Engine | _core.Sph, fields: Mapping[str, NDArray], n: int) -> Array:
    """Fields of n points as one row for each, as the core packs them; zero for those not given."""
    parts = [
        np.asarray(fields[name], dtype=float).reshape(n, count)
        if name in fields
        else np.zeros((n, count))
        for name, count, *_ in engine.fields()
    ]
    return np.ascontiguousarray(np.concatenate(parts, axis=1))
