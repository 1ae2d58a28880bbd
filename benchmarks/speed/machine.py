"""Capability of one core of this machine: multiply-adds, bandwidth of a cache and of the memory."""

from __future__ import annotations

import ctypes
import functools
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from shared import least_time

CHAINS, LANES = 12, 8
"""Vectors of the loop of multiply-adds, enough to hide the time that one takes, and numbers in each
of them: of AVX-512. With AVX2 a vector is two registers."""

SOURCE = f"""
typedef double vector __attribute__((vector_size(8 * {LANES})));
double work(long n)
{{
    vector a[{CHAINS}], b, c;
    for (int k = 0; k < {LANES}; k++) {{ b[k] = 0.999; c[k] = 0.001; }}
    for (int k = 0; k < {CHAINS}; k++) a[k] = b * k;
    for (long i = 0; i < n; i++)
        for (int k = 0; k < {CHAINS}; k++) a[k] = a[k] * b + c;
    for (int k = 1; k < {CHAINS}; k++) a[0] += a[k];
    double sum = 0;
    for (int k = 0; k < {LANES}; k++) sum += a[0][k];
    return sum;
}}
"""
FLAGS = ("-O3", "-march=native", "-mprefer-vector-width=512", "-ffp-contract=fast", "-shared")


@functools.cache
def _loop() -> ctypes._CFuncPtr:
    """Loop of multiply-adds of independent vectors, compiled for this processor."""
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder, "loop.c"), Path(folder, "loop.so")
        source.write_text(SOURCE)
        subprocess.run(["cc", *FLAGS, "-fPIC", source, "-o", library], check=True)
        loop = ctypes.CDLL(str(library)).work
    loop.restype, loop.argtypes = ctypes.c_double, [ctypes.c_long]
    return loop


def peak(turns: int = 1_000_000) -> float:
    """Operations per second of a loop of multiply-adds, each of which is two operations.

    A product of matrices is no measure of this: its library may be held to older instructions.
    """
    loop = _loop()
    return 2.0 * CHAINS * LANES * turns / least_time(lambda: loop(turns), 20)


def bandwidth(megabytes: float) -> float:
    """Bytes per second of c = a + b; the three arrays together have this size."""
    n = int(megabytes * 1e6 / 24)
    a, b, c = np.ones(n), np.ones(n), np.ones(n)
    passes = max(int(1e7 / n), 1)

    def add() -> None:
        for _ in range(passes):
            np.add(a, b, out=c)

    return 24.0 * n * passes / least_time(add, 20)


def capability(quick: bool) -> dict[str, float]:
    """Rates of this machine, by their names with units."""
    return {
        "multiply-adds [Gflop/s]": peak(10_000 if quick else 1_000_000) / 1e9,
        "second-level cache [GB/s]": bandwidth(0.3) / 1e9,
        "memory [GB/s]": bandwidth(3.0 if quick else 300.0) / 1e9,
    }
