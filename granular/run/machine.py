"""Machines that compute a run: the threads of a processor, or a device."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from granular import _core
from granular.tools.buffers import default_isa
from granular.tools.checks import integer, one_of, set_fields

DEVICES = ("gpu", "emulated")
"""Devices that are not processors."""


def _kernels() -> tuple[bytes, ...]:
    """Return the kernels for GPUs, in double and in single precision."""
    import gzip
    from importlib.resources import files

    texts = [files("granular") / f"gpu_{precision}.ptx.gz" for precision in ("double", "single")]
    if not all(text.is_file() for text in texts):
        raise RuntimeError(
            "this build has no kernels for GPUs; build it where there is clang 17 or later, with "
            "GRANULAR_GPU=1"
        )
    return tuple(gzip.decompress(text.read_bytes()) for text in texts)


@cache
def _load() -> None:
    """Load the driver of the GPU and the kernels, once."""
    double, single = _kernels()
    _core.open_gpu(double, single)


def open_gpu() -> _core.Gpu:
    """Open the GPU if it is not open, and return its name and its memory at present.

    Raises
    ------
    RuntimeError
        If there is no driver or no GPU, one of them is too old, or this build has no kernels.
    """
    try:
        _load()
        return _core.open_gpu(b"", b"")
    except RuntimeError as error:
        raise RuntimeError(f"device = 'gpu' cannot be used: {error}") from None


@dataclass(frozen=True)
class Machine:
    """Threads, instruction set and device of a simulation, see `granular.Simulation`."""

    threads: int | None = None
    isa: str | None = None
    device: str | None = None

    def __post_init__(self) -> None:
        if self.threads is not None:
            set_fields(self, threads=integer("threads", self.threads, 1, _core.MAX_THREADS))
        if self.device is None:
            return
        one_of("device", self.device, DEVICES)
        if self.isa not in (None, "one_lane"):
            raise ValueError(
                f"isa = {self.isa!r} must not be given with device = {self.device!r}, which "
                'computes as "one_lane" does'
            )
        if self.device == "gpu":
            open_gpu()

    @property
    def kernels(self) -> str:
        """Instruction set of the kernels; an empty string means the best available."""
        if self.device is not None:
            return "one_lane"
        return default_isa() if self.isa is None else self.isa

    @property
    def memory(self) -> float | None:
        """Memory of the device for a run [bytes]; None if it is that of this machine."""
        # Blocks are larger by a sixteenth at most, and a quarter more is kept (csrc/gpu/blocks.c).
        return float(open_gpu()["free"]) / (17 / 16 * 5 / 4) if self.device == "gpu" else None

    def refuse_device(self, what: str) -> None:
        """Raise ValueError if a device is to do what only processors do."""
        if self.device is not None:
            raise ValueError(f"device = {self.device!r} must not be given: {what}")
