"""Files with one restart state: a sealed header, and the arrays one after the other."""

import math
import os
import struct
from pathlib import Path

import numpy as np

from granular.record.checkpoint import Checkpoint, number
from granular.record.layout import DTYPES, FORMAT, check_format, reading
from granular.record.sealed import END, START, sealed, unsealed, whole
from granular.record.storage import replacing, write_all

CLOCK = struct.Struct("<dqd")  # time, step, dt as bytes, because JSON would lose the sign of a nan


def write_restart(path: Path, checkpoint: Checkpoint) -> None:
    """Store a restart state, durably, completely or not at all."""
    clock = CLOCK.pack(checkpoint.time, checkpoint.step, checkpoint.dt)
    scalars = {name: number(value) for name, value in checkpoint.scalars.items()}
    header = {
        "format": FORMAT,
        "size": sum(array.nbytes for array in checkpoint.arrays.values()),
        "clock": clock.hex(),
        "scalars": {name: (a.dtype.str, a.tobytes().hex()) for name, a in scalars.items()},
        "arrays": {name: (a.dtype.str, a.shape) for name, a in checkpoint.arrays.items()},
        "digest": checkpoint.digest.hex(),
    }
    with replacing(path, path.with_suffix(".tmp")) as fd:
        write_all(fd, sealed(header))
        for array in checkpoint.arrays.values():
            write_all(fd, np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)


def read_restart(path: Path) -> Checkpoint:
    """Read and verify the state stored by `write_restart`; RecordError if it is damaged."""
    with reading(path), open(path, "rb") as file:
        size = os.fstat(file.fileno()).st_size
        start = file.read(START.size)
        length = START.unpack(start)[1]
        if not 0 <= length <= size:
            raise ValueError("not a restart state")
        header, offset = unsealed(memoryview(start + file.read(length + len(END))))
        check_format(path, header["format"])
        if size != offset + whole(header["size"]):
            raise ValueError(f"it has {size} bytes, not those that its header says")
        time, step, dt = CLOCK.unpack(bytes.fromhex(header["clock"]))
        scalars = {
            name: np.frombuffer(bytes.fromhex(raw), dtype=_known(dtype)).reshape(()).item()
            for name, (dtype, raw) in header["scalars"].items()
        }
        arrays = {}
        for name, (dtype, shape) in header["arrays"].items():
            length = 8 * math.prod(map(whole, shape))
            if length > header["size"]:
                raise ValueError(f"array {name} has shape {shape}, more than the file can hold")
            arrays[name] = np.empty(shape, dtype=_known(dtype))
            if file.readinto(arrays[name].reshape(-1).view(np.uint8).data) != length:
                raise ValueError(f"array {name} is not whole")
        checkpoint = Checkpoint(time=time, step=step, dt=dt, scalars=scalars, arrays=arrays)
        if checkpoint.digest != bytes.fromhex(header["digest"]):
            raise ValueError("the checkpoint does not match its digest")
    return checkpoint


def _known(dtype: str) -> str:
    if dtype not in DTYPES:
        raise ValueError(f"type {dtype!r} must be one of {DTYPES}")
    return dtype
