"""What computes a run: the threads of a processor, or a device."""

from __future__ import annotations

from dataclasses import dataclass

from granular import _core
from granular.tools.buffers import default_isa
from granular.tools.checks import integer, one_of, set_fields

DEVICES = ("emulated",)
"""Devices that are not processors."""


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

    @property
    def kernels(self) -> str:
        """Instruction set of the kernels; an empty string means the best available."""
        if self.device is not None:
            return "one_lane"
        return default_isa() if self.isa is None else self.isa

    def refuse_device(self, what: str) -> None:
        """Raise ValueError if a device is to do what only processors do."""
        if self.device is not None:
            raise ValueError(f"device = {self.device!r} must not be given: {what}")
