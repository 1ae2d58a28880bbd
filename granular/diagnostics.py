"""Watching a run for what only a run can show: cheap looks at its frames, and what they add up to.

What is known before a run is refused or warned of (`granular.mpm.limits`); what is left fails
without a word: a bulk that loses its contacts, densities that leave the room they stand for,
energy out of nowhere, a law that is ill posed in the flow at hand.
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

if TYPE_CHECKING:
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
"""Numbers of a sample of any method, in the order of a row; nan for what has no meaning there."""


class StabilityWarning(UserWarning):
    """A scene asks for what is known to go wrong without a word."""


def scene_warnings(scene: AnyScene) -> list[str]:
    """List what of a scene is known to go wrong without an error, one sentence each.

    Each is a failure that was measured (`benchmarks/stability_map.py`, the page "Limits and
    failures"); a simulation issues them as `StabilityWarning`.
    """
    return scene.known_failures()


def warn(scene: AnyScene, stacklevel: int = 3) -> None:
    """Issue a `StabilityWarning` for each of `scene_warnings`."""
    for sentence in scene_warnings(scene):
        warnings.warn(sentence, StabilityWarning, stacklevel=stacklevel)


PACKED = 0.9
"""Share of rho_c from which a body should bear stress, see `granular.measure.bulk.Bulk`."""

STEPS, POINT_STEPS = 2000, 2_000_000
"""A look costs about 0.5 us a point and 1 ms, a step 20 ns a point and some us: samples that are
STEPS + POINT_STEPS/points steps apart take less than 2 % of a run."""


NOTHING: Mapping[str, float] = MappingProxyType({})


class Monitor:
    """Looks at states and keeps what it saw.

    Attributes
    ----------
    rows : list of ndarray
        The samples, one number for each of `names`.
    names : tuple of str
        `NAMES`, and those of the method of the scene.
    """

    def __init__(self, scene: AnyScene) -> None:
        self.names = (*NAMES, *(name for name, *_ in scene.indicators))
        self.rows: list[NDArray[np.float64]] = []
        self._before: State | None = None
        self._step = 0

    def due(self, step: int, n_points: int) -> bool:
        """Whether a look is worth its price: by steps, so that a run tells the same each time."""
        return step == 0 or step - self._step >= STEPS + POINT_STEPS / max(n_points, 1)

    def sample(self, state: State, own: Mapping[str, float] = NOTHING) -> dict[str, float]:
        """Take a sample of a state and keep it; `own` are the numbers of the method.

        The first state of a run, in which nothing has happened, only opens the accounts.
        """
        row = self.peek(state, own)
        self._before, self._step = state, state.step
        if state.step == 0:
            return {}
        self.rows.append(row)
        return dict(zip(self.names, row.tolist(), strict=True))

    def peek(self, state: State, own: Mapping[str, float] = NOTHING) -> NDArray[np.float64]:
        """Take a sample of a state without keeping it."""
        if not state.n:
            return np.full(len(self.names), np.nan)
        bulk = Bulk(state, packed=PACKED)
        material = state.scene.material
        before = work = created = np.nan
        if self._before is not None and state.scene.knows_all_work:
            before, work, created = _account(self._before, state)
        row = {
            "disconnected": bulk.disconnected() if material.granular else np.nan,
            "density_drift": bulk.drift() if material.granular else np.nan,
            "ill_posed": ill_posed_fraction(state) if hasattr(material, "xi") else np.nan,
            "courant": _courant(state),
            "gaps": np.nan if material.granular else gaps(bulk),
            "held_before": before,
            "work": work,
            "created": created,
        } | dict(own)
        return np.array([row[name] for name in self.names])

    def columns(self, last: NDArray[np.float64] | None = None) -> dict[str, NDArray[np.float64]]:
        """The numbers of all samples, and of a last one that is not remembered, by name."""
        rows = [*self.rows, *([] if last is None else [last])]
        return dict(zip(self.names, np.array(rows).reshape(-1, len(self.names)).T, strict=True))

    def recall(self, samples: Mapping[str, NDArray[np.float64]]) -> None:
        """Take over what was seen before a restart; nan for what was not told then."""
        count = max((len(column) for column in samples.values()), default=0)
        unknown = np.full(count, np.nan)
        self.rows = list(np.array([samples.get(name, unknown) for name in self.names]).T)


def _fastest(state: State) -> float:
    return float(np.sqrt(np.max(np.sum(state.v**2, axis=1))))


def _courant(state: State) -> float:
    """(c + max speed) dt/dx of the last step."""
    scene = state.scene
    return (scene.material.wave_speed + _fastest(state)) * state.dt / scene.grid.cell


def _account(before: State, after: State) -> tuple[float, float, float]:
    """What was held [J] at an earlier state, the work of gravity since, and energy from nowhere.

    created = change of what is held + outflow + plastic dissipation - work: minus what transfers
    and disconnections lost, which is not known, plus what was made. It is not positive in a sound
    run. Plastic power counts by the trapezoidal rule, work as in `granular.measure.energy_budget`.
    """
    held, now = (float((kinetic_of(s) + elastic_of(s)).sum()) for s in (before, after))
    work, outflow = between(before, after)
    plastic = (plastic_power(before) + plastic_power(after)) / 2 * (after.time - before.time)
    return held, work, now - held + outflow + plastic - work


# ---- what the samples add up to ----


@dataclass(frozen=True)
class Indicator:
    """One line of a `Health`.

    Attributes
    ----------
    name : str
    value : float
        nan where the run had nothing to tell.
    limit : float or None
        The largest sound value; None for what is only reported.
    doc : str
        What it is, and what it means beyond the limit.
    """

    name: str
    value: float
    limit: float | None
    doc: str

    @property
    def verdict(self) -> str:
        """ "ok", "suspect", "reported", or "unknown" without a value."""
        if np.isnan(self.value):
            return "unknown"
        if self.limit is None:
            return "reported"
        return "ok" if self.value <= self.limit else "suspect"


@dataclass(frozen=True)
class Health:
    """What the looks at a run say of it.

    Attributes
    ----------
    samples : int
        How many there were.
    indicators : tuple of Indicator
    """

    samples: int
    indicators: tuple[Indicator, ...]

    @property
    def ok(self) -> bool:
        """Whether no indicator is doubtful."""
        return all(indicator.verdict != "suspect" for indicator in self.indicators)

    def __getitem__(self, name: str) -> Indicator:
        for indicator in self.indicators:
            if indicator.name == name:
                return indicator
        raise KeyError(name)

    def __iter__(self) -> Iterator[Indicator]:
        return iter(self.indicators)

    def rows(self) -> dict[str, str]:
        """Name and "value (limit): verdict" of every indicator, for a table."""
        return {
            indicator.name: f"{indicator.value:.3g}"
            + (f" (limit {indicator.limit:g})" if indicator.limit is not None else "")
            + f": {indicator.verdict}"
            for indicator in self.indicators
        }

    def __str__(self) -> str:
        return "\n".join(f"{name:>16}  {text}" for name, text in self.rows().items())

    def _repr_html_(self) -> str:
        return table(f"Health, {self.samples} samples", self.rows())


def _later(column: NDArray[np.float64]) -> float:
    """Median of the later half: neither an impact nor the begin, when nothing bears stress yet."""
    seen = column[~np.isnan(column)]
    return float(np.median(seen[len(seen) // 2 :])) if len(seen) else np.nan


def _largest(column: NDArray[np.float64]) -> float:
    seen = column[~np.isnan(column)]
    return float(seen.max()) if len(seen) else np.nan


_SUMMARIES: Mapping[str, Callable[[NDArray[np.float64]], float]] = {
    "later": _later,
    "later absolute": lambda column: _later(np.abs(column)),
    "largest": _largest,
}

_INDICATORS: tuple[tuple[str, str, float | None, str], ...] = (
    (
        "disconnected",
        "later",
        0.1,
        "stress-free share of the packed bulk: beyond, the flow is made by the scheme",
    ),
    (
        "density_drift",
        "later absolute",
        0.05,
        "tracked volume over room, less one: beyond, points have collapsed into one another",
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
"""Name, how samples add up, limit, and meaning of the indicators with one number a look."""

ENERGY_LIMIT = 0.05
"""Largest energy from nowhere, as a share of the energy that was turned over."""


def health(scene: AnyScene, samples: Mapping[str, NDArray[np.float64]]) -> Health:
    """What samples say of a run.

    Parameters
    ----------
    scene : Scene
    samples : mapping of str to ndarray
        The numbers of the samples by the names of `NAMES`, in the order of time.

    Returns
    -------
    Health
    """
    nothing = np.full(0, np.nan)
    indicators = [
        Indicator(name, _SUMMARIES[how](samples.get(name, nothing)), limit, doc)
        for name, how, limit, doc in (*_INDICATORS, *scene.indicators)
    ]
    indicators.append(
        Indicator(
            "courant",
            _largest(samples.get("courant", nothing)),
            scene.courant_limit,
            "(c + max speed) dt/dx: beyond, a run may fail without a NaN",
        )
    )
    indicators.append(
        Indicator(
            "energy_created",
            _created(*(samples.get(name, nothing) for name in ("held_before", "work", "created"))),
            ENERGY_LIMIT,
            "energy from nowhere over all work of gravity and what was held at the begin",
        )
    )
    return Health(max((len(column) for column in samples.values()), default=0), tuple(indicators))


def _created(
    held: NDArray[np.float64], work: NDArray[np.float64], created: NDArray[np.float64]
) -> float:
    """Largest rise of the sum of what was created, over the energy that was turned over."""
    known = ~np.isnan(created)
    total = held[known][:1].sum() + np.abs(work[known]).sum()
    if not total:
        return np.nan
    account = np.concatenate([[0.0], np.cumsum(created[known])])
    return float(np.max(account - np.minimum.accumulate(account)) / total)
