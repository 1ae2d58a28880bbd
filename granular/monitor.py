"""Watching a run for what only a run can show: cheap looks at its frames, and what they add up to.

What is known before a run is refused or warned of (`granular.stability`); what is left fails
without a word: a bulk that loses its contacts, densities that leave the room they stand for,
energy out of nowhere, a law that is ill posed in the flow at hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granular.measure.bulk import Bulk, gaps, ill_posed_fraction
from granular.measure.energy import between, elastic_of, kinetic_of, plastic_power
from granular.notebook import table
from granular.stability import MACH, courant_limit

if TYPE_CHECKING:
    from granular.scene import Scene
    from granular.state import State

__all__ = ["NAMES", "Health", "Monitor", "Sign", "health"]

NAMES = (
    "disconnected",
    "density_drift",
    "ill_posed",
    "courant",
    "gaps",
    "held_before",
    "work",
    "created",
    "mach",
    "stopped",
)
"""What a look tells, in the order of a row of numbers; nan for what has no meaning there."""

FLUID = ("mach", "stopped")
"""Those of particle hydrodynamics alone: others are silent about them."""

PACKED = 0.9
"""Share of rho_c from which a body should bear stress, see `granular.measure.bulk.Bulk`."""

STEPS, POINT_STEPS = 2000, 2_000_000
"""A look costs about 0.5 us a point and 1 ms, a step 20 ns a point and some us: looks that are
STEPS + POINT_STEPS/points steps apart take less than 2 % of a run."""


class Monitor:
    """Looks at states and keeps what it saw.

    Attributes
    ----------
    rows : list of ndarray
        What the looks told, one number for each of `NAMES`.
    """

    def __init__(self) -> None:
        self.rows: list[NDArray[np.float64]] = []
        self._before: State | None = None
        self._step = 0

    def due(self, step: int, n_points: int) -> bool:
        """Whether a look is worth its price: by steps, so that a run tells the same each time."""
        return step == 0 or step - self._step >= STEPS + POINT_STEPS / max(n_points, 1)

    def look(self, state: State, stopped: float = np.nan) -> dict[str, float]:
        """Look at a state, remember it, and tell what was seen.

        `stopped` is how often the run has stopped grains in walls.

        The first state of a run, in which nothing has happened, only opens the accounts.
        """
        row = self.peek(state, stopped)
        self._before, self._step = state, state.step
        if state.step == 0:
            return {}
        self.rows.append(row)
        return dict(zip(NAMES, row.tolist(), strict=True))

    def peek(self, state: State, stopped: float = np.nan) -> NDArray[np.float64]:
        """What a look at a state would tell, without remembering it."""
        if not state.n:
            return np.full(len(NAMES), np.nan)
        bulk = Bulk(state, packed=PACKED)
        material = state.scene.material
        before = work = created = np.nan
        # What bodies and the points of walls do to the material is not in the account.
        walled = state.scene.method == "sph" or state.scene.bodies
        if self._before is not None and not walled:
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
            "mach": _mach(state),
            "stopped": stopped,
        }
        return np.array([row[name] for name in NAMES])

    def columns(self, last: NDArray[np.float64] | None = None) -> dict[str, NDArray[np.float64]]:
        """The numbers of all looks, and of a last one that is not remembered, by name."""
        rows = [*self.rows, *([] if last is None else [last])]
        return dict(zip(NAMES, np.array(rows).reshape(-1, len(NAMES)).T, strict=True))

    def recall(self, looks: Mapping[str, NDArray[np.float64]]) -> None:
        """Take over what was seen before a restart; nan for what was not told then."""
        count = max((len(column) for column in looks.values()), default=0)
        unknown = np.full(count, np.nan)
        self.rows = list(np.array([looks.get(name, unknown) for name in NAMES]).T)


def _fastest(state: State) -> float:
    return float(np.sqrt(np.max(np.sum(state.v**2, axis=1))))


def _courant(state: State) -> float:
    """(c + max speed) dt/dx of the last step."""
    scene = state.scene
    return (scene.material.wave_speed + _fastest(state)) * state.dt / scene.grid.cell


def _mach(state: State) -> float:
    """Speed of the fastest grain over that of sound, where the density follows from the places."""
    if state.scene.method != "sph":
        return np.nan
    return _fastest(state) / state.scene.material.wave_speed


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


# ---- what the looks add up to ----


@dataclass(frozen=True)
class Sign:
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
        """ "sound", "doubtful", "reported", or "unknown" without a value."""
        if np.isnan(self.value):
            return "unknown"
        if self.limit is None:
            return "reported"
        return "sound" if self.value <= self.limit else "doubtful"


@dataclass(frozen=True)
class Health:
    """What the looks at a run say of it.

    Attributes
    ----------
    looks : int
        How many there were.
    signs : tuple of Sign
    """

    looks: int
    signs: tuple[Sign, ...]

    @property
    def sound(self) -> bool:
        """Whether no sign is doubtful."""
        return all(sign.verdict != "doubtful" for sign in self.signs)

    def __getitem__(self, name: str) -> Sign:
        for sign in self.signs:
            if sign.name == name:
                return sign
        raise KeyError(name)

    def __iter__(self) -> Iterator[Sign]:
        return iter(self.signs)

    def rows(self) -> dict[str, str]:
        """Name and "value (limit): verdict" of every sign, for a table."""
        return {
            sign.name: f"{sign.value:.3g}"
            + (f" (limit {sign.limit:g})" if sign.limit is not None else "")
            + f": {sign.verdict}"
            for sign in self.signs
        }

    def __str__(self) -> str:
        return "\n".join(f"{name:>16}  {text}" for name, text in self.rows().items())

    def _repr_html_(self) -> str:
        return table(f"Health, {self.looks} looks", self.rows())


def _later(column: NDArray[np.float64]) -> float:
    """Median of the later half: neither an impact nor the begin, when nothing bears stress yet."""
    seen = column[~np.isnan(column)]
    return float(np.median(seen[len(seen) // 2 :])) if len(seen) else np.nan


def _largest(column: NDArray[np.float64]) -> float:
    seen = column[~np.isnan(column)]
    return float(seen.max()) if len(seen) else np.nan


_SIGNS: tuple[tuple[str, Callable[[NDArray[np.float64]], float], float | None, str], ...] = (
    (
        "disconnected",
        _later,
        0.1,
        "stress-free share of the packed bulk: beyond, the flow is made by the scheme",
    ),
    (
        "density_drift",
        lambda column: _later(np.abs(column)),
        0.05,
        "tracked volume over room, less one: beyond, points have collapsed into one another",
    ),
    (
        "ill_posed",
        _later,
        None,
        "share of the flowing points at which the mu(I) law is ill posed: no refinement need "
        "converge where it is large",
    ),
    ("gaps", _largest, 0.0, "empty cells in a stressed body: torn by the discretisation"),
    ("mach", _largest, MACH, "largest speed over that of sound: beyond, densities are off"),
    ("stopped", _largest, None, "times that a grain came into a wall and was put back on it"),
)
"""Name, how looks add up, limit, and meaning of the signs with one number a look."""

ENERGY_LIMIT = 0.05
"""Largest energy from nowhere, as a share of the energy that was turned over."""


def health(scene: Scene, looks: Mapping[str, NDArray[np.float64]]) -> Health:
    """What looks say of a run.

    Parameters
    ----------
    scene : Scene
    looks : mapping of str to ndarray
        The numbers of the looks by the names of `NAMES`, in the order of time.

    Returns
    -------
    Health
    """
    nothing = np.full(0, np.nan)
    signs = [
        Sign(name, how(looks.get(name, nothing)), limit, doc)
        for name, how, limit, doc in _SIGNS
        if name not in FLUID or scene.method == "sph"
    ]
    signs.append(
        Sign(
            "courant",
            _largest(looks.get("courant", nothing)),
            courant_limit(scene),
            "(c + max speed) dt/dx: beyond, a run may fail without a NaN",
        )
    )
    signs.append(
        Sign(
            "energy_created",
            _created(*(looks.get(name, nothing) for name in ("held_before", "work", "created"))),
            ENERGY_LIMIT,
            "energy from nowhere over all work of gravity and what was held at the begin",
        )
    )
    return Health(max((len(column) for column in looks.values()), default=0), tuple(signs))


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
