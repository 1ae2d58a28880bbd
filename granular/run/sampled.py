"""Samples that a simulation takes while it advances, and what they say about its health."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from granular.measure.cell_sums import CellSums
from granular.run.diagnostics import Health, StabilityWarning, health
from granular.run.monitor import Monitor
from granular.run.present import Present

if TYPE_CHECKING:
    from granular.model.typing import AnyScene
    from granular.run.running import Soundness
    from granular.tools.arrays import Array


class Sampled(Present):
    """The part of a simulation that watches it; a base of `granular.Simulation`."""

    _soundness: Soundness

    def _watch(self, scene: AnyScene) -> None:
        """Begin without samples."""
        self._monitor = Monitor(scene)
        self._warned: set[str] = set()

    def _sample_if_due(self) -> None:
        monitor, step = self._monitor, self.steps
        if monitor.due(step):
            row = self._row(monitor.thorough) if step else None
            monitor.enter(step, self.time, self._engine.scalars()["dt"], self._energies())
            if row is not None:
                monitor.add(row)

    def _sums(self, thorough: bool) -> CellSums:
        """Sums of the points over cells for a sample."""
        state = self._snapshot(recorded=True)
        return CellSums.from_state(state, self._marked(state, thorough))

    def _row(self, thorough: bool) -> Array:
        """Numbers of a sample of the present state."""
        sums = self._sums(thorough)
        return self._monitor.row(sums, self._indicators(sums))

    def _values(self) -> dict[str, float]:
        """Return the values of the indicators so far; without a sample the values of this state."""
        if self._monitor.rows or not self.steps or self._soundness.failure:
            return self._monitor.values()
        return self._monitor.values(self._row(thorough=True))

    def health(self) -> Health:
        """Indicators of failure from the samples so far, or without any from the present state.

        They do not depend on the frames, nor on how the run is divided into calls of `run`, and the
        record of the run has the same. After a `SimulationError`, whose state is invalid, the
        verdict is that the run failed.

        Returns
        -------
        Health
            Value, limit and verdict of each indicator; see `granular.run.diagnostics`.
        """
        return health(self.scene, self._values(), self._soundness.failure)

    def _warn_of_health(self) -> None:
        """Issue a warning for each indicator that has become suspect since the last warning."""
        health = self.health()
        for indicator, text in zip(health.suspect, health.warnings(), strict=True):
            if indicator.name not in self._warned:
                self._warned.add(indicator.name)
                warnings.warn(text, StabilityWarning, stacklevel=4)
