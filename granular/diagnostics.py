"""Monitoring of a run: cheap samples of its frames, and the indicators of failure made of them.

Failures that are known before a run are refused or warned of (`granular.mpm.limits`). The others
happen during the run and without an error: the bulk loses its contacts, densities no longer match
the volume that the points occupy, energy is created, or the law is ill posed in the flow at hand.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granular.measure.bulk import Bulk, gaps, ill_posed_fraction
from granular.measure.energy import between, elastic_of, kinetic_of, plastic_power
from granular.notebook import table
from granular.plausible import suspect_numbers

if TYPE_CHECKING:
    from granular.gravity import Gravity
    from granular.state import State
    from granular.typing import AnyScene

__all__ = [
    "NAMES",
    "Health",
    "Indicator",
    "Monitor",
    "StabilityWarning",
    "health",
    "scene_warnings",
    "warn",
]

NAMES = (
    "disconnected",
    "density_drift",
    "ill_posed",
    "courant",
    "gaps",
    "held_before",
    "work",
    "created",
)
"""Names of the numbers in a sample of any method, in the order of a row; nan if not applicable."""


class StabilityWarning(UserWarning):
    """A scene has settings that are known to give wrong results without an error."""


def scene_warnings(scene: AnyScene) -> list[str]:
    """List the settings of a scene that are known to fail without an error, one sentence each.

    Each is a failure that was measured (`benchmarks/stability_map.py`, the page "Limits and
    failures"), or a number that is hardly meant (`granular.plausible`); a simulation issues them as
    `StabilityWarning`.
    """
    return scene.known_failures() + suspect_numbers(scene)


def warn(scene: AnyScene, stacklevel: int = 3) -> None:
    """Issue a `StabilityWarning` for each of `scene_warnings`."""
    for sentence in scene_warnings(scene):
        warnings.warn(sentence, StabilityWarning, stacklevel=stacklevel)


PACKED = 0.9
"""Density, as a fraction of rho_c, from which material in the bulk should bear stress.

See `granular.measure.bulk.Bulk`.
"""

STEPS, POINT_STEPS = 2000, 2_000_000
"""Steps between two samples: STEPS + POINT_STEPS/(number of points).

A sample costs about 1 ms plus 0.5 us per point, a step some us plus 20 ns per point, so that
samples at this distance take less than 2 % of a run.
"""


NOTHING: Mapping[str, float] = MappingProxyType({})


class Monitor:
    """Takes samples of states during a run and keeps them.

    Attributes
    ----------
    rows : list of ndarray
        The samples; each holds one number for each of `names`.
    names : tuple of str
        `NAMES`, and the names of the indicators that the method of the scene adds.
    """

    def __init__(self, scene: AnyScene) -> None:
        self.names = (*NAMES, *(name for name, *_ in scene.indicators))
        self.rows: list[NDArray[np.float64]] = []
        self._before: tuple[State, float] | None = None
        self._step = 0

    def due(self, step: int, n_points: int) -> bool:
        """True if enough steps have passed since the last sample.

        Steps and not seconds are counted, so that repeated runs take the same samples.
        """
        return step == 0 or step - self._step >= STEPS + POINT_STEPS / max(n_points, 1)

    def sample(
        self, state: State, own: Mapping[str, float] = NOTHING, work: float = 0.0
    ) -> dict[str, float]:
        """Take a sample of a state and keep it.

        Nothing is kept of the first state of a run (step 0): it only starts the energy budget.

        Parameters
        ----------
        state : State
        own : mapping
            Numbers of the method.
        work : float
            Work on the material since the start of the run besides that of gravity [J]; nan if it
            is not known.
        """
        row = self.peek(state, own, work)
        self._before, self._step = (state, work), state.step
        if state.step == 0:
            return {}
        self.rows.append(row)
        return dict(zip(self.names, row.tolist(), strict=True))

    def peek(
        self, state: State, own: Mapping[str, float] = NOTHING, work: float = 0.0
    ) -> NDArray[np.float64]:
        """Take a sample of a state without keeping it; see `sample`."""
        if not state.n:
            return np.full(len(self.names), np.nan)
        bulk = Bulk(state, packed=PACKED)
        materials = state.scene.materials
        granular = all(material.granular for material in materials)
        account = (np.nan, np.nan, np.nan)
        before, work_before = self._before or (state, work)
        if before.step < state.step and not np.isnan(work):
            account = _account(before, state, work - work_before)
        row = {
            "disconnected": bulk.disconnected() if _bears(state) else np.nan,
            "density_drift": bulk.drift() if granular else np.nan,
            "ill_posed": ill_posed_fraction(state) if _knows_inertia(state) else np.nan,
            "courant": _courant(state),
            "gaps": np.nan if granular else gaps(bulk),
            **dict(zip(("held_before", "work", "created"), account, strict=True)),
            **own,
        }
        return np.array([row.get(name, np.nan) for name in self.names])

    def columns(self, last: NDArray[np.float64] | None = None) -> dict[str, NDArray[np.float64]]:
        """Columns of all samples by name, with `last` as an additional row that is not kept."""
        rows = [*self.rows, *([] if last is None else [last])]
        return dict(zip(self.names, np.array(rows).reshape(-1, len(self.names)).T, strict=True))

    def recall(self, samples: Mapping[str, NDArray[np.float64]], steps: NDArray) -> None:
        """Restore the samples taken before a restart.

        Parameters
        ----------
        samples : mapping of ndarray, shape (n,)
            Columns of the frames, nan in frames of which no sample was taken. Columns that were not
            recorded are nan.
        steps : ndarray, shape (n,)
            Numbers of the steps of these frames.
        """
        unknown = np.full(len(steps), np.nan)
        table = np.array([samples.get(name, unknown) for name in self.names]).T
        self.rows = list(table)
        taken = ~np.isnan(table).all(axis=1)
        self._step = int(steps[taken].max(initial=0))


def _knows_inertia(state: State) -> bool:
    """True if a material has a mu(I) law."""
    return any(hasattr(material, "xi") for material in state.scene.materials)


def _bears(state: State) -> bool:
    """True for grains that could bear stress by now: waves have crossed them up and down.

    Points are stress-free at the start, and gravity may be switched on slowly.
    """
    scene = state.scene
    lows, highs = zip(*(source.region.bounds for source in scene.sources), strict=True)
    height = max(high[-1] for high in highs) - min(low[-1] for low in lows)
    pull = np.linalg.norm(scene.gravity.vectors, axis=1)
    begin = scene.gravity.times[int(np.argmax(pull >= (1 - 1e-9) * pull.max()))]
    slowest = min(material.wave_speed for material in scene.materials)
    bears = any(material.granular for material in scene.materials)
    return bears and state.time > begin + 2 * height / slowest


def _courant(state: State) -> float:
    """Courant number (c + max speed) dt/dx of the last step."""
    scene, fastest = state.scene, float(np.sqrt(np.max(np.sum(state.v**2, axis=1))))
    return (scene.wave_speed + fastest) * state.dt / scene.grid.cell


def _account(before: State, after: State, others: float) -> tuple[float, float, float]:
    """Energy held at an earlier state, work since then, and energy created since [J].

    The work is that of gravity, as in `granular.measure.energy_budget`, and that of `others`, the
    bodies. The held energy is the kinetic and elastic energy of the points. The energy created is
    (change of the held energy) + outflow + (plastic dissipation) - work. Energy that transfers and
    disconnections lose, an unknown amount, makes it smaller; energy that the scheme creates makes
    it larger. It is not positive if the scheme creates none.

    Samples are too far apart to integrate the plastic power in a fall or an impact. The smaller of
    its values at both ends is taken, so that the energy created is not overestimated as long as
    the power rises or falls in between, or has a peak.
    """
    held, now = (float((kinetic_of(s) + elastic_of(s)).sum()) for s in (before, after))
    by_gravity, outflow = between(before, after)
    work = by_gravity + others + _work_on_entered(before, after)
    if _goes_back_and_forth(after.scene.gravity, before.time, after.time):
        work = np.nan
    plastic = min(plastic_power(before), plastic_power(after)) * (after.time - before.time)
    return held, work, now - held + outflow + plastic - work


def _goes_back_and_forth(gravity: Gravity, begin: float, end: float) -> bool:
    """True if gravity takes a longer way between two times than to its change, by a hundredth.

    The paths of the points between two samples then do not follow from their states there.
    """
    times = np.array(gravity.times)
    inside = times[(times > begin) & (times < end)]
    vectors = np.array([gravity.at(time) for time in (begin, *inside, end)])
    way = np.linalg.norm(np.diff(vectors, axis=0), axis=1).sum()
    return bool(way > 1.01 * np.linalg.norm(vectors[-1] - vectors[0]))


def _work_on_entered(before: State, after: State) -> float:
    """Work of gravity on the points that entered between two states [J], from the lower corner on.

    The work of the inflows contains that from the inlet to the corner (`InflowState`); nan while
    gravity changes, and with gravity along a periodic axis, whose rounds are not counted. Of points
    that have also left in the meantime the work is not known, so that the energy created comes out
    too small.
    """
    scene = after.scene
    if not getattr(scene, "inflows", ()):
        return 0.0
    periodic = np.array(scene.grid.periodic)
    if before.time < scene.gravity.times[-1] or np.any(scene.gravity.vectors[-1], where=periodic):
        return np.nan
    new = ~np.isin(after.id, before.id, assume_unique=True)
    fallen = (after.x[new] - np.array(scene.grid.lower)) @ scene.gravity.at(after.time)
    return float(after.mass[new] @ fallen)


# ---- indicators from the samples ----


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
class Health:
    """Indicators of failure of a run, from all its samples.

    Attributes
    ----------
    samples : int
        Number of samples.
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
        return tuple(found for found in self.indicators if found.verdict == "suspect")

    @property
    def verdict(self) -> str:
        """Verdict in words, with what to do if it is "suspect".

        The first line is "ok" or "suspect" with the indicators that have a value and a limit, or
        "unknown" if there is none, or "failed" with the error; further lines explain those beyond
        their limits.
        """
        judged = [found for found in self.indicators if found.verdict in ("ok", "suspect")]
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
        return [f"{found} is suspect: {found.doc}; {found.remedy}" for found in self.suspect]

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

    def __str__(self) -> str:
        failed = [f"failed: {self.failure}"] if self.failure else []
        return "\n".join(failed + [f"{name:>16}  {text}" for name, text in self.rows().items()])

    def _repr_html_(self) -> str:
        failed = f", failed: {self.failure}" if self.failure else ""
        return table(f"Health, {self.samples} samples{failed}", self.rows())


def _later(column: NDArray[np.float64]) -> np.floating:
    """Median of the later half of the samples.

    It is neither affected by an impact nor by the beginning, when all points are stress-free.
    """
    return np.median(column[len(column) // 2 :])


_SUMMARIES: Mapping[str, Callable[[NDArray[np.float64]], np.floating]] = {
    "later": _later,
    "later absolute": lambda column: _later(np.abs(column)),
    "largest": np.max,
}


def _summary(how: str, column: NDArray[np.float64]) -> float:
    """Summary of the samples that have a value; nan if none has."""
    seen = column[~np.isnan(column)]
    return float(_SUMMARIES[how](seen)) if len(seen) else np.nan


_INDICATORS: tuple[tuple[str, str, float | None, str], ...] = (
    (
        "disconnected",
        "later",
        0.1,
        "stress-free share of the packed bulk: beyond the limit the flow is an artefact of the "
        "scheme, unless the material is in free flight",
    ),
    (
        "density_drift",
        "later absolute",
        0.05,
        "volume of the points over the volume they occupy, minus one: beyond the limit points have "
        "collapsed into one another, or drifted apart",
    ),
    (
        "ill_posed",
        "later",
        None,
        "share of the flowing points at which the mu(I) law is ill posed: no refinement need "
        "converge where it is large",
    ),
    ("gaps", "largest", 0.0, "empty cells in a stressed body: torn by the discretisation"),
)
"""Name, key of `_SUMMARIES`, limit and meaning of the indicators with one number per sample.

The limits hold for methods that have a remedy for the indicator, see `Scene.remedies`.
"""

ENERGY_LIMIT = 0.05
"""Largest energy created that is ok, as a fraction of the energy turned over (`_created`)."""


def health(
    scene: AnyScene, samples: Mapping[str, NDArray[np.float64]], failure: str = ""
) -> Health:
    """Compute the indicators of failure of a run from its samples.

    Parameters
    ----------
    scene : Scene
    samples : mapping of str to ndarray
        Columns of the samples by the names of `NAMES`, in the order of time.
    failure : str
        Message of the error that ended the run.

    Returns
    -------
    Health
    """
    nothing = np.full(0, np.nan)
    limited = scene.remedies
    indicators = []

    def add(name: str, value: float, limit: float | None, doc: str) -> None:
        own = limit if name in limited else None
        indicators.append(Indicator(name, value, own, doc, limited.get(name, "")))

    for name, how, limit, doc in (*_INDICATORS, *scene.indicators):
        add(name, _summary(how, samples.get(name, nothing)), limit, doc)
    courant = _summary("largest", samples.get("courant", nothing))
    text = "(c + max speed) dt/dx: beyond the limit a run may fail without a NaN"
    add("courant", courant, scene.courant_limit, text)
    created = _created(*(samples.get(n, nothing) for n in ("held_before", "work", "created")))
    text = "energy created over the sum of all work and the energy at the beginning"
    add("energy_created", created, ENERGY_LIMIT, text)
    count = max((len(column) for column in samples.values()), default=0)
    return Health(count, tuple(indicators), failure)


def health_of_frame(state: State) -> Health:
    """Compute the indicators of failure from one frame, for a run without samples.

    Those that need more than a frame have no value: the energy created and those that the method
    of the scene adds.
    """
    monitor = Monitor(state.scene)
    last = monitor.peek(state, work=np.nan) if state.step else None
    return health(state.scene, monitor.columns(last))


def _created(
    held: NDArray[np.float64], work: NDArray[np.float64], created: NDArray[np.float64]
) -> float:
    """Largest rise of the cumulative energy created, over the energy turned over.

    The energy turned over is the energy held at the first sample plus the sum of abs(work).
    """
    known = ~np.isnan(created)
    total = held[known][:1].sum() + np.abs(work[known]).sum()
    if not total:
        return np.nan
    account = np.concatenate([[0.0], np.cumsum(created[known])])
    return float(np.max(account - np.minimum.accumulate(account)) / total)
