"""The present state of a simulation: time, counts, a snapshot of the points."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from granular.model.state import State
from granular.record.fresh import Streamed
from granular.record.session import Session
from granular.run.method import Method
from granular.run.running import default_threads
from granular.tools.notebook import table


class Present(Method):
    """The present state of a simulation, by whatever method; the base of `granular.Simulation`."""

    _threads: int | None
    _session: Session
    _due: int | None

    @property
    def threads(self) -> int:
        """Threads that the core uses."""
        return default_threads(self.n_points) if self._threads is None else self._threads

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._engine.scalars()["time"]

    @property
    def steps(self) -> int:
        """Number of steps made."""
        return int(self._engine.scalars()["step"])

    @property
    def dt(self) -> float:
        """Time step [s] of the last step; before the first step, of the first one."""
        return self._engine.scalars()["dt"] or self._engine.stable_dt()

    @property
    def n_points(self) -> int:
        """Number of points in the domain; those that have left do not count."""
        return int(self._engine.scalars()["n_points"])

    @property
    def record(self) -> Path | None:
        """Path of the record of the last recorded run, to which further runs append; or None."""
        return self._session.path

    @property
    def frame_is_stored(self) -> bool:
        """False if the frame of the present step could not be stored; the next run stores it."""
        return self._due is None

    @property
    def isa(self) -> str:
        """Instruction set of the kernels."""
        return self._engine.isa

    @property
    def state(self) -> State:
        """A snapshot of the points, ordered by id."""
        return self._snapshot()

    def _snapshot(self, recorded: bool = False) -> State:
        return self._state_of(self._fields(recorded), **self._extra_state())

    def _state_of(self, fields: dict[str, NDArray], **extra: Any) -> State:
        """Make a state of the present time, step and time step from fields."""
        scalars = self._engine.scalars()
        time, step, dt = scalars["time"], int(scalars["step"]), scalars["dt"]
        return State(scene=self.scene, time=time, step=step, dt=dt, fields=fields, **extra)

    def _streamed(self) -> State | Streamed:
        """Return the part of the present state that a record stores, one column in memory at a
        time."""
        return self._snapshot(recorded=True)

    def __repr__(self) -> str:
        return (
            f"Simulation({self.scene.name}, t = {self.time:.6g} s, step {self.steps}, "
            f"{self.n_points} points)"
        )

    def _repr_html_(self) -> str:
        rows = {
            "time [s]": self.time,
            "step": self.steps,
            "dt [s]": self.dt,
            "points": self.n_points,
            "threads": self.threads,
            "kernels": self.isa,
        }
        return table(f"Simulation of {self.scene.name}", rows)
