"""The restart state: all arrays and scalars of the engine, stored to the last bit."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from numbers import Integral, Real

import h5py
import numpy as np

from granular.record.layout import (
    DTYPES,
    Rows,
    as_attribute,
    attribute,
    check_type,
    checked,
    checksums,
    count_of_rows,
    hard,
    seal,
)


@dataclass(frozen=True, eq=False, kw_only=True)
class Checkpoint:
    """Full-precision restart state.

    Parameters
    ----------
    time, step, dt
        Time [s], step number, time step [s].
    scalars
        Other numbers of the engine; int (64 bits) or float.
    arrays
        All arrays of the engine in its own order of rows; float64 or int64, any shape.

    Raises
    ------
    TypeError, ValueError
        If a number or array cannot be stored bit for bit, or a name cannot be stored.
    """

    time: float
    step: int
    dt: float
    scalars: Mapping[str, float | int] = field(default_factory=dict)
    arrays: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in (*self.scalars, *self.arrays):
            if not name or "/" in name or name == "." or not name.isascii():
                raise ValueError(f"name = {name!r} must be non-empty ASCII without '/'")
        for name in ("time", "dt"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, Real):
                raise TypeError(f"{name} = {value!r} must be an int or a float")
        if isinstance(self.step, bool) or not isinstance(self.step, Integral):
            raise TypeError(f"step = {self.step!r} must be an int")
        for name, value in self.scalars.items():
            if isinstance(value, bool) or not isinstance(value, Real):
                raise TypeError(f"scalars[{name!r}] = {value!r} must be an int or a float")
            if isinstance(value, Integral) and not -(2**63) <= value < 2**63:
                raise ValueError(f"scalars[{name!r}] = {value} must fit into 64 bits")
        for name, array in self.arrays.items():
            check_type(f"arrays[{name!r}]", array)

    @property
    def digest(self) -> bytes:
        """Digest of all content (32 bytes)."""
        sums = {name: checksums(array) for name, array in self.arrays.items()}
        return digest_of(self, sums)


@dataclass(frozen=True, eq=False, kw_only=True)
class CheckpointRows:
    """A checkpoint with arrays that are made, or read, row by row: one is never held as a whole."""

    time: float
    step: int
    dt: float
    scalars: Mapping[str, float | int]
    arrays: Mapping[str, np.ndarray | Rows]

    def whole(self) -> Checkpoint:
        """Return the checkpoint with all its arrays."""
        arrays = {name: _whole(array) for name, array in self.arrays.items()}
        return Checkpoint(
            time=self.time, step=self.step, dt=self.dt, scalars=self.scalars, arrays=arrays
        )


def _whole(array: np.ndarray | Rows) -> np.ndarray:
    if isinstance(array, np.ndarray):
        return array
    out = np.empty(array.shape, dtype=array.dtype)
    count = count_of_rows(array.shape)
    if count:
        for k, into in enumerate(out.reshape(count, -1)):
            into[:] = array.row(k)
    return out


def digest_of(checkpoint: Checkpoint | CheckpointRows, sums: Mapping[str, bytes]) -> bytes:
    """Digest of a checkpoint with these `granular.record.layout.checksums` of its arrays."""
    clock = struct.pack("<dqd", checkpoint.time, checkpoint.step, checkpoint.dt)
    parts: list[str | bytes | np.ndarray] = [clock]
    for name in sorted(checkpoint.scalars):
        parts += [name, number(checkpoint.scalars[name])]
    for name in sorted(sums):
        parts += [name, sums[name]]
    return seal(*parts)


def number(value: float | int) -> np.ndarray:
    """Convert a scalar to the array that is stored, with all its bits."""
    return np.array(value, dtype="<i8" if isinstance(value, Integral) else "<f8")


def write_checkpoint(group: h5py.Group, checkpoint: CheckpointRows) -> bytes:
    """Store a checkpoint in an empty group; return its digest."""
    group.attrs["time"] = float(checkpoint.time)
    group.attrs["step"] = int(checkpoint.step)
    group.attrs["dt"] = float(checkpoint.dt)
    scalars, arrays, sums = group.create_group("scalars"), group.create_group("arrays"), {}
    for name, value in checkpoint.scalars.items():
        scalars.create_dataset(name, data=number(value))
    for name, array in checkpoint.arrays.items():
        data = arrays.create_dataset(name, shape=array.shape, dtype=array.dtype)
        sums[name] = checksums(array, partial(_put, data))
    digest = digest_of(checkpoint, sums)
    group.attrs["digest"] = as_attribute(digest)
    return digest


def _put(data: h5py.Dataset, k: int, row: np.ndarray) -> None:
    """Put a row of an array into its dataset."""
    if count_of_rows(data.shape) > 1:
        data[k] = row
    elif row.size:
        data[...] = row.reshape(data.shape)


def read_checkpoint(group: h5py.Group) -> Checkpoint:
    """Read and verify a checkpoint.

    Errors are those of `checked`; ValueError if the digest does not match.
    """
    scalars, arrays = hard(group, "scalars", h5py.Group), hard(group, "arrays", h5py.Group)
    ranks = range(33)
    checkpoint = Checkpoint(
        time=attribute(group, "time", "f"),
        step=attribute(group, "step", "i"),
        dt=attribute(group, "dt", "f"),
        scalars={name: checked(scalars, name, DTYPES, 0)[()].item() for name in scalars},
        arrays={name: np.asarray(checked(arrays, name, DTYPES, *ranks)[()]) for name in arrays},
    )
    if checkpoint.digest != attribute(group, "digest", "u"):
        raise ValueError("the checkpoint does not match its digest")
    return checkpoint
