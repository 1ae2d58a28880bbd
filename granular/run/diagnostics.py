"""The verdict on a run, from the indicators of failure of its monitor (`granular.run.monitor`).

Failures that are known before a run are refused or raise a warning (`granular.mpm.limits`). The
others happen during the run and without an error: the bulk loses its contacts, densities no longer
match the volume that the points occupy, energy is created, or the law is ill posed in the flow at
hand.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from granular.measure.cell_sums import CellSums
from granular.measure.result import Result, Table
from granular.model.plausible import suspect_numbers
from granular.run.monitor import Monitor
from granular.tools.notebook import table

if TYPE_CHECKING:
    from granular.model.scene import BaseScene
    from granular.model.state import State

__all__ = ["Health", "Indicator", "StabilityWarning", "health", "scene_warnings", "warn"]


class StabilityWarning(UserWarning):
    """A scene has settings that are known to give wrong results without an error."""


def scene_warnings(scene: BaseScene) -> list[str]:
    """List the settings of a scene that are known to fail without an error, one sentence each.

    Each is a failure that was measured (benchmark `stability_map`, the page "Stability and
    limits"), or an implausible number (`granular.model.plausible`); a simulation issues them as
    `StabilityWarning`.
    """
    return scene.known_failures() + suspect_numbers(scene)


def warn(scene: BaseScene, stacklevel: int = 3) -> None:
    """Issue a `StabilityWarning` for each of `scene_warnings`."""
    for sentence in scene_warnings(scene):
        warnings.warn(sentence, StabilityWarning, stacklevel=stacklevel)


@dataclass(frozen=True)
class Indicator:
    """One indicator of failure: a number of a run and its limit.

    Attributes
    ----------
    name : str
    value : float
        nan if no sample of the run has a value.
    limit : float or None
        The largest value that is "ok"; None for an indicator that is only reported.
    doc : str
        Definition, and the meaning of a value beyond the limit.
    remedy : str
        What to do if the value is beyond the limit; empty for an indicator without one.
    """

    name: str
    value: float
    limit: float | None
    doc: str
    remedy: str = ""

    @property
    def verdict(self) -> str:
        """Verdict: "ok", "suspect", "reported" without a limit, "unknown" without a value."""
        if np.isnan(self.value):
            return "unknown"
        if self.limit is None:
            return "reported"
        return "ok" if self.value <= self.limit else "suspect"

    @property
    def row(self) -> str:
        """Value, limit and verdict, as in a table."""
        limit = f" (limit {self.limit:g})" if self.limit is not None else ""
        if np.isnan(self.value):
            return f"-{limit}: does not apply, or not known yet"
        return f"{self.value:.3g}{limit}: {self.verdict}"

    def __str__(self) -> str:
        if self.limit is None:
            return f"{self.name} = {self.value:.3g}"
        return f"{self.name} = {self.value:.3g} (limit {self.limit:g})"


@dataclass(frozen=True)
class Health(Result):
    """Indicators of failure of a run.

    Attributes
    ----------
    samples : int
        Number of samples taken so far.
    indicators : tuple of Indicator
    failure : str
        Message of the `granular.SimulationError` that ended the run; empty if none did.
    """

    samples: int
    indicators: tuple[Indicator, ...]
    failure: str = ""

    @property
    def ok(self) -> bool:
        """True if the run has not failed, and no indicator is suspect."""
        return not self.failure and not self.suspect

    @property
    def suspect(self) -> tuple[Indicator, ...]:
        """Indicators beyond their limits."""
        return tuple(indicator for indicator in self.indicators if indicator.verdict == "suspect")

    @property
    def verdict(self) -> str:
        """Verdict in words, with what to do if it is "suspect".

        The first line is "ok" or "suspect" with the indicators that have a value and a limit, or
        "unknown" if there is none, or "failed" with the error; further lines explain those beyond
        their limits.
        """
        judged = [
            indicator for indicator in self.indicators if indicator.verdict in ("ok", "suspect")
        ]
        if self.failure:
            before = f"; before: {', '.join(map(str, judged))}" if judged else ""
            return "\n".join([f"verdict: failed, {self.failure}{before}", *self.warnings()])
        if not judged:
            return (
                "verdict: unknown, as no step has been made or no point is left; "
                "judge the run after some steps (`sim.run` or `granular resume` goes on)"
            )
        head = f"verdict: {'ok' if self.ok else 'suspect'}, {', '.join(map(str, judged))}"
        return "\n".join([head, *self.warnings()])

    def warnings(self) -> list[str]:
        """One sentence for each indicator beyond its limit: what it means, and what to do."""
        return [
            f"{indicator} is suspect: {indicator.doc}; {indicator.remedy}"
            for indicator in self.suspect
        ]

    def __getitem__(self, name: str) -> Indicator:
        for indicator in self.indicators:
            if indicator.name == name:
                return indicator
        raise KeyError(name)

    def __iter__(self) -> Iterator[Indicator]:
        return iter(self.indicators)

    def rows(self) -> dict[str, str]:
        """Table of the indicators: name -> "value (limit): verdict"."""
        return {indicator.name: indicator.row for indicator in self.indicators}

    def to_dataframe(self) -> Any:
        """Return a `pandas.DataFrame` with a row for each indicator: value, limit, verdict, remedy.

        Raises
        ------
        ModuleNotFoundError
            If pandas is not installed: ``pip install 'granular-flow[tables]'``.
        """
        return self._table().to_dataframe().set_index("name")

    def _table(self) -> Table:
        names = ("name", "value", "limit", "verdict", "doc", "remedy")
        columns = {name: [getattr(one, name) for one in self.indicators] for name in names}
        constants = {"samples": self.samples, **({"failure": self.failure} if self.failure else {})}
        return Table(columns, constants, {})

    def __repr__(self) -> str:
        return f"<Health of {self.samples} samples: {self.verdict.splitlines()[0]}>"

    def __str__(self) -> str:
        failed = [f"failed: {self.failure}"] if self.failure else []
        return "\n".join(failed + [f"{name:>16}  {text}" for name, text in self.rows().items()])

    def _repr_html_(self) -> str:
        failed = f", failed: {self.failure}" if self.failure else ""
        return table(f"Health, {self.samples} samples{failed}", self.rows())


def health(scene: BaseScene, values: Mapping[str, float], failure: str = "") -> Health:
    """Judge a run by the values of its indicators.

    Parameters
    ----------
    scene : Scene
    values : mapping of str to float
        Values by the names of `Scene.indicators`, nan or absent where there is none, and the number
        of "samples"; see `granular.run.monitor.Monitor.values`.
    failure : str
        Message of the error that ended the run.
    """
    remedies = scene.remedies
    indicators = tuple(
        Indicator(name, values.get(name, np.nan), limit, doc, remedies.get(name, ""))
        for name, _, limit, doc in scene.indicators
    )
    return Health(int(values.get("samples", 0)), indicators, failure)


def health_of_frame(state: State) -> Health:
    """Judge a run without samples by one frame.

    Indicators that need more than a frame have no value: the energy created, and those of the
    method of the scene.
    """
    monitor = Monitor(state.scene)
    row = monitor.row(CellSums.from_state(state), {}) if state.step else None
    return health(state.scene, monitor.values(row))
