"""The restart state: all arrays and scalars of the engine, stored to the last bit."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Integral, Real

import h5py
import numpy as np

from granular.record.layout import DTYPES, as_attribute, attribute, check_type, checked, hard, seal


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
        parts: list[str | bytes | np.ndarray] = [struct.pack("<dqd", self.time, self.step, self.dt)]
        for name in sorted(self.scalars):
            parts += [name, number(self.scalars[name])]
        for name in sorted(self.arrays):
            parts += [name, self.arrays[name]]
        return seal(*parts)


def number(value: float | int) -> np.ndarray:
    """Convert a scalar to the array that is stored, with all its bits."""
    return np.array(value, dtype="<i8" if isinstance(value, Integral) else "<f8")


def write_checkpoint(group: h5py.Group, checkpoint: Checkpoint) -> None:
    """Store a checkpoint in an empty group."""
    group.attrs["time"] = float(checkpoint.time)
    group.attrs["step"] = int(checkpoint.step)
    group.attrs["dt"] = float(checkpoint.dt)
    group.attrs["digest"] = as_attribute(checkpoint.digest)
    scalars, arrays = group.create_group("scalars"), group.create_group("arrays")
    for name, value in checkpoint.scalars.items():
        scalars.create_dataset(name, data=number(value))
    for name, array in checkpoint.arrays.items():
        arrays.create_dataset(name, data=array)


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
