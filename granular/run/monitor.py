"""Samples of a run, at equal numbers of steps, from which its indicators of failure are computed.

Samples depend on the steps alone: neither on how long a run is meant to be, nor on the frames that
are recorded, nor on how it is divided into calls of `run`. A checkpoint holds them, so that a run
that goes on takes the samples of an unbroken one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.measure.bulk import Bulk, gaps
from granular.measure.cell_sums import CellSums
from granular.tools.arrays import Array

if TYPE_CHECKING:
    from granular.model.scene import BaseScene
    from granular.record.checkpoint import Checkpoint


SPACING = _core.TALLY_INTERVAL
"""Steps between two samples at first: those between two tallies of the energy by the core."""

LEAST = 20
"""Least number of samples of a run of as many times SPACING steps or more.

When there are twice as many, every second one is dropped, and the distance is doubled. A sample
takes as long as some six steps (of 13,000 points in 2D, measured), so that all take about 8 % of a
run of 10,000 steps, and 1 % of one of 100,000.
"""

THOROUGH = 4
"""Samples from one that counts points within bodies and blocks to the next: it takes three times as
long as another one."""

FEWEST = 50
"""Least number of points in a bulk whose stress-free share is reported: a share of a tenth is then
accurate to 0.04."""

PACKED = 0.9
"""Density, as a fraction of rho_c, from which material in the bulk should bear stress.

See `granular.measure.bulk.Bulk`.
"""


class Energies(NamedTuple):
    """Energies of a run [J; in 2D per metre of depth], those of the core's tally.

    Attributes
    ----------
    held : float
        Kinetic and elastic energy of the points.
    lost : float
        Plastic work since the start, and the energy with which points left.
    work : float
        Work of gravity, of bodies, of walls, and energy of points that have entered, since the
        start.
    """

    held: float
    lost: float
    work: float


class Account:
    """Energy that the scheme has created, from the energies at tallies.

    The energy created since the first sample is the change of the held and the lost energy less the
    work. Energy that transfers and disconnections lose, an unknown amount, makes it smaller; energy
    that the scheme creates makes it larger. It never rises if the scheme creates none.
    """

    def __init__(self) -> None:
        self.numbers = np.full(6, np.nan)
        """Turnover; work; energy at the start; least of the energy created; its rise; time of the
        last entry."""

    def enter(self, now: Energies, time: float, known: bool = True) -> None:
        """Enter the energies at a time [s]; if the work since the last entry is not `known`,
        neither is the energy created since then."""
        balance = now.held + now.lost - now.work
        turnover, work, begin, least, rise, _ = self.numbers
        if np.isnan(turnover):
            self.numbers[:] = now.held, now.work, balance, 0.0, 0.0, time
            return
        if not known:
            self.numbers[:] = turnover, now.work, balance - least, least, rise, time
            return
        created = balance - begin
        least = min(least, created)
        rise = max(rise, created - least)
        self.numbers[:] = turnover + abs(now.work - work), now.work, begin, least, rise, time

    @property
    def time(self) -> float:
        """Time of the last entry [s]; nan before the first."""
        return float(self.numbers[5])

    @property
    def created(self) -> float:
        """Largest rise of the energy created, over the first energy and all work; nan if none."""
        turnover, _, _, _, rise, _ = self.numbers
        return float(rise / turnover) if turnover > 0 else np.nan


class Monitor:
    """Takes samples of states during a run.

    Attributes
    ----------
    names : tuple of str
        Names of the indicators of the scene.
    rows : list of ndarray
        Retained samples, at equal distances; each holds one number for each of `names`.
    spacing : int
        Steps between two samples now.
    count : int
        Number of samples taken.
    """

    def __init__(self, scene: BaseScene) -> None:
        self._gravity = scene.gravity
        self._how = {name: how for name, how, *_ in scene.indicators}
        self.names = tuple(self._how)
        self.rows: list[Array] = []
        self.spacing, self.count = SPACING, 0
        self._step = -1  # of the last sample
        self._largest = np.full(len(self.names), np.nan)
        self._account = Account()

    def next(self, step: int) -> int:
        """Step of the next sample after a step."""
        return (step // self.spacing + 1) * self.spacing

    def due(self, step: int) -> bool:
        """True if a sample is to be taken at a step; the first opens the account of energy."""
        return step % self.spacing == 0 and step > self._step

    @property
    def thorough(self) -> bool:
        """True if the next sample includes numbers that take long."""
        return self.count % THOROUGH == 0

    def enter(self, step: int, time: float, dt: float, energies: Energies | None) -> None:
        """Begin a sample with the energies at its time [s], if the method knows them."""
        self._step = step
        if energies is not None:
            known = not self._gravity.swings(self._account.time, time, SPACING * dt)
            self._account.enter(energies, time, known)

    def add(self, row: Array) -> None:
        """Store the numbers of a sample, of a `row`."""
        self.count += 1
        self.rows.append(row)
        self._largest = np.fmax(self._largest, row)
        if len(self.rows) == 2 * LEAST:
            self.rows = self.rows[1::2]  # those at multiples of the new distance
            self.spacing *= 2

    def row(self, sums: CellSums, extra: Mapping[str, float]) -> Array:
        """Return the numbers of a sample, without storing it.

        Parameters
        ----------
        sums : CellSums
            Sums of the points over cells.
        extra : mapping
            Numbers of the method; of those that any state has the larger ones count.
        """
        if not sums.n:
            return np.full(len(self.names), np.nan)
        bulk = Bulk(sums, packed=PACKED)
        granular = all(material.granular for material in sums.scene.materials)
        fastest, speed = sums.largest["speed"], sums.scene.wave_speed
        row = {
            "disconnected": _disconnected(bulk, sums),
            "density_drift": _drift(bulk) if granular else np.nan,
            "strings": bulk.strings() if granular and "strings" in self.names else np.nan,
            "ill_posed": sums.share("ill_posed", "flowing") if "flowing" in sums.of else np.nan,
            "courant": (speed + fastest) * sums.dt / sums.scene.grid.cell,
            "mach": fastest / speed,
            "compression": sums.largest["compression"],
            "dilution": sums.largest["dilution"],
            "gaps": np.nan if granular else gaps(bulk),
        }
        row |= {name: max(value, row.get(name, value)) for name, value in extra.items()}
        return np.array([row.get(name, np.nan) for name in self.names])

    def values(self, present: Array | None = None) -> dict[str, float]:
        """Values of the indicators so far, and the number of samples, by name.

        Parameters
        ----------
        present : ndarray, optional
            Numbers of the present state, by which a run without samples is judged.
        """
        rows, largest, count = self.rows, self._largest, self.count
        if not rows and present is not None:
            rows, largest, count = [present], present, 1
        numbers = {"samples": float(count)}
        for name, column, most in zip(
            self.names, np.reshape(rows, (-1, len(self.names))).T, largest, strict=True
        ):
            numbers[name] = float(most) if self._how[name] == "largest" else later(column)
        if "energy_created" in numbers:
            numbers["energy_created"] = self._account.created
        return numbers

    # ---- restart ----

    def arrays(self) -> dict[str, Array]:
        """Return all of it, as arrays of a checkpoint; none before the first sample."""
        if self._step < 0:
            return {}
        numbers = (float(self.spacing), float(self.count), float(self._step))
        return {
            "samples": np.array(self.rows).reshape(-1, len(self.names)),
            "sampling": np.array([*numbers, *self._account.numbers, *self._largest]),
        }

    def restore(self, arrays: Mapping[str, NDArray], step: int) -> None:
        """Go on from the arrays of a checkpoint of a step, or afresh without them.

        Raises
        ------
        ValueError
            If they are not those of a monitor of this scene.
        """
        if "sampling" not in arrays:
            return
        names, sampling = len(self.names), np.asarray(arrays["sampling"], dtype=float)
        rows = np.asarray(arrays.get("samples", np.empty(0)), dtype=float)
        if sampling.shape != (9 + names,) or rows.shape[1:] != (names,) or len(rows) >= 2 * LEAST:
            raise ValueError("the checkpoint does not hold the samples of its scene")
        spacing, count, last = sampling[:3]
        doublings = np.log2(spacing / SPACING) if spacing >= SPACING else np.nan
        if doublings not in range(58) or not (count >= len(rows) and 0 <= last <= step):
            raise ValueError(
                f"sampling = {sampling[:3].tolist()} of the checkpoint must have a distance of "
                f"{SPACING} steps or a power of 2 more, and a step up to {step}"
            )
        self.spacing, self.count, self._step = int(spacing), int(count), int(last)
        self._account.numbers, self._largest = sampling[3:9].copy(), sampling[9:].copy()
        self.rows = list(rows)


def unwatched(checkpoint: Checkpoint) -> Checkpoint:
    """Return a checkpoint without its samples, for a scene that has changed."""
    arrays = {
        name: a for name, a in checkpoint.arrays.items() if name not in ("samples", "sampling")
    }
    return replace(checkpoint, arrays=arrays)


def known(values: Mapping[str, float]) -> dict[str, float]:
    """Return the existing values, for a frame of a record."""
    return {name: value for name, value in values.items() if not np.isnan(value)}


def later(column: Array) -> float:
    """Median of the later half of the samples that have a value; nan if none has.

    It is neither affected by an impact nor by the beginning, when all points are stress-free.
    """
    known = column[~np.isnan(column)]
    return float(np.median(known[len(known) // 2 :])) if len(known) else np.nan


def _disconnected(bulk: Bulk, sums: CellSums) -> float:
    """Stress-free share of the bulk, where it could bear stress; nan of few points."""
    judged = bulk.n >= FEWEST and _bears(sums)
    return bulk.disconnected(pressed=1.0) if judged else np.nan


def _drift(bulk: Bulk) -> float:
    """Drift of the density, without its sign.

    Particles of SPH, one per cell, leave cells empty where they are distributed unevenly: only
    particles that have collapsed into one another count.
    """
    drift = bulk.drift()
    return max(drift, 0.0) if bulk.scene.method == "sph" else abs(drift)


def _bears(state: CellSums) -> bool:
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
