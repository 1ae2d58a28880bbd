"""The runs from which an answer is made: which there are, which come next, and what they cost."""

from __future__ import annotations

import hashlib
import math
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from granular.economy.cost import cost
from granular.economy.error_bar import ErrorBar, Sample, different, in_fit, levels
from granular.economy.quantities import Quantity
from granular.economy.variants import Variants
from granular.mpm.scene import Scene
from granular.record import RecordError, open_trajectory
from granular.run.cases import is_whole
from granular.run.simulation import Simulation

SOFTER = 4.0
"""Factor between two E, at which steps are twice as long."""
SLACK = 0.1
"""Share by which the next runs may exceed the rest of a budget, as costs are estimates."""

Wanted = tuple[float, float, int]
"""A run: the size of the cells [m], the softness and the seed."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Arguments of `answer` that concern the runs."""

    every: float | None
    threads: int | None
    budget: float
    rigid: bool
    wall_forces: bool
    tractions: bool


class Trials:
    """The runs of an answer, and their results."""

    def __init__(
        self, variants: Variants, measure: Quantity, options: Options, folder: str | Path | None
    ) -> None:
        self.variants, self.samples = variants, list[Sample]()
        self._measure, self._options = measure, options
        self._temporary = tempfile.TemporaryDirectory() if folder is None else None
        self._folder = Path(self._temporary.name if self._temporary else folder or ".")
        self._folder.mkdir(parents=True, exist_ok=True)
        self._reused: set[Wanted] = set()

    def __enter__(self) -> Trials:
        return self

    def __exit__(self, *error: object) -> None:
        if self._temporary is not None:
            self._temporary.cleanup()

    # ---- runs ----

    def first(self) -> list[Wanted]:
        """The runs that are always made, the cheaper ones first."""
        cell = self.variants.cell
        middle, wide = self.variants.coarser(cell)
        softer = [(middle, SOFTER, 0)] * self._options.rigid
        seeds = [(size, 1.0, seed) for size in (wide, middle) for seed in (0, 1)]
        return [*seeds, *softer, (cell, 1.0, 0)]

    def add(self, wanted: list[Wanted], done: Any) -> None:
        """Make runs; if one of them fails, none of them counts."""
        before = len(self.samples)
        try:
            for run in wanted:
                self.samples.append(self._sample(run))
                done.update()
        except BaseException:
            del self.samples[before:]
            raise

    def _sample(self, run: Wanted) -> Sample:
        cell, softness, seed = run
        scene = self.variants.scene(*run)
        path = self._folder / self._name(scene, run)
        begin = time.process_time()
        if _is_complete(path, scene):
            self._reused.add(run)
        else:
            simulation: Simulation = Simulation(
                scene,
                threads=self._options.threads,
                wall_forces=self._options.wall_forces,
                tractions=self._options.tractions,
            )
            simulation.run(save=path, every=self._options.every, overwrite=True)
        with open_trajectory(path) as record:
            seconds = time.process_time() - begin
            value = self._measure(record)
            suspect = ", ".join(indicator.name for indicator in record.health().suspect)
        if self._temporary is not None:
            path.unlink()
        verdict = f"suspect: {suspect}" if suspect else "ok"
        E = float(getattr(scene.material, "E", math.nan))
        return Sample(cell, E, softness, seed, value, seconds, verdict)

    def _name(self, scene: Scene, run: Wanted) -> str:
        """Name of a record, of its own for each scene and what its frames hold."""
        how = self._options
        held = f"{scene.to_json()} {how.every} {how.wall_forces} {how.tractions}"
        digest = hashlib.sha256(held.encode()).hexdigest()[:8]
        cell, softness, seed = run
        return f"cell_{cell:.6g}_softness_{softness:g}_seed_{seed}_{digest}.h5"

    # ---- which come next ----

    def further(self, error: ErrorBar) -> tuple[list[Wanted], str]:
        """Runs that make the largest part of the uncertainty smaller, or why there are none."""
        wanted = getattr(self, f"_for_{error.largest}")()
        spent = math.fsum(sample.core_seconds for sample in self.samples)
        next_ = math.fsum(self._seconds(one) for one in wanted)
        if spent + next_ > (1 + SLACK) * self._options.budget:
            return [], (
                f"the largest part is that of the {error.largest}; the next {len(wanted)} runs "
                f"would take {next_:.3g} s beyond the {spent:.3g} s spent, and the budget is "
                f"{self._options.budget:g} s"
            )
        return wanted, ""

    def _for_cells(self) -> list[Wanted]:
        """A run in finer cells, and another one in the finest so far."""
        (stiff, _), finest = levels(self.samples), min(s.cell for s in in_fit(self.samples))
        return self._new((self.variants.finer(finest), stiff, 0), (finest, stiff, 1))

    def _for_scatter(self) -> list[Wanted]:
        """Another run in each size of cells that counts, and with the smaller E in one of them.

        Finer cells instead, if other points make no difference.
        """
        counted = in_fit(self.samples)
        if len(different(counted)) < len(counted):
            return self._for_cells()
        stiff, soft = levels(self.samples)
        wanted = [
            (cell, stiff, self._next_seed(cell, stiff))
            for cell in sorted({sample.cell for sample in counted})
        ]
        if soft is not None:
            known = {sample.cell for sample in self.samples if sample.softness == stiff}
            at = max(s.cell for s in self.samples if s.softness == soft and s.cell in known)
            seed = self._next_seed(at, soft)
            wanted += [(at, stiff, seed), (at, soft, seed)]
        return self._new(*wanted)

    def _for_stiffness(self) -> list[Wanted]:
        """All runs that count with a larger E."""
        return [(s.cell, s.softness / SOFTER, s.seed) for s in in_fit(self.samples)]

    def _new(self, *wanted: Wanted) -> list[Wanted]:
        """Those of some runs that were not made."""
        made = {(sample.cell, sample.softness, sample.seed) for sample in self.samples}
        return [run for run in dict.fromkeys(wanted) if run not in made]

    def _next_seed(self, cell: float, softness: float) -> int:
        alike = [s.seed for s in self.samples if (s.cell, s.softness) == (cell, softness)]
        return 1 + max(alike, default=-1)

    def _seconds(self, wanted: Wanted) -> float:
        """Processor time of a run as estimated, in proportion to the longest that was made."""
        estimate = cost(self.variants.scene(*wanted)).seconds
        ran = [s for s in self.samples if (s.cell, s.softness, s.seed) not in self._reused]
        if not ran:
            return estimate
        longest = max(ran, key=lambda sample: sample.core_seconds)
        of_longest = self.variants.scene(longest.cell, longest.softness, longest.seed)
        return estimate / cost(of_longest).seconds * longest.core_seconds


def _is_complete(path: Path, scene: Scene) -> bool:
    """True if a file is the record of a scene to its end."""
    if not path.exists():
        return False
    try:
        with open_trajectory(path) as record:
            return is_whole(record) and record.scene.to_json() == scene.to_json()
    except RecordError:  # damaged: it is made again
        return False
