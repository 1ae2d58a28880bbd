"""A number with an error bar: the runs that it takes, from coarse to fine, and what they cost."""

from __future__ import annotations

import math
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from granular.economy.cost import cost
from granular.economy.error_bar import ErrorBar, Sample, different, error_bar, in_fit, levels
from granular.economy.quantities import Quantity, quantity
from granular.economy.variants import Variants
from granular.measure.result import Table
from granular.mpm.scene import Scene
from granular.record import Trajectory, open_trajectory
from granular.run.diagnostics import StabilityWarning, scene_warnings
from granular.run.simulation import Simulation
from granular.tools.checks import in_range, positive
from granular.tools.progress import bar

SOFTER = 4.0
"""Factor between two E, at which steps are twice as long."""
SLACK = 0.1
"""Share by which the next runs may exceed the rest of a budget, as costs are estimates."""


@dataclass(frozen=True)
class Answer:
    """A number, and the interval in which it lies with a probability of 95 %.

    Attributes
    ----------
    value : float
        The number in fine cells and for stiff grains, in the unit of the measure.
    uncertainty : float
        Half of the interval.
    of_cells, of_stiffness, of_scatter : float
        Parts of the uncertainty, which are added in squares: by the size of the cells, by E, and
        by the scatter between runs whose points differ.
    tolerance : float
        That was asked for, relative to the value.
    reached : bool
        True if the uncertainty is within it.
    samples : tuple of Sample
        The runs.
    remark : str
        Why the tolerance was not reached; else empty.
    """

    value: float
    uncertainty: float
    of_cells: float
    of_stiffness: float
    of_scatter: float
    tolerance: float
    reached: bool
    samples: tuple[Sample, ...]
    remark: str

    @property
    def core_seconds(self) -> float:
        """Processor time of all runs [s]."""
        return math.fsum(sample.core_seconds for sample in self.samples)

    @property
    def suspect(self) -> tuple[Sample, ...]:
        """Runs whose verdict is not ok."""
        return tuple(sample for sample in self.samples if sample.verdict != "ok")

    def to_dataframe(self) -> Any:
        """The runs as a `pandas.DataFrame`, a row for each.

        Raises
        ------
        ModuleNotFoundError
            If pandas is not installed: ``pip install 'granular-flow[tables]'``.
        """
        return self._table().to_dataframe()

    def _table(self) -> Table:
        columns = {
            name: [getattr(sample, name) for sample in self.samples]
            for name in ("cell", "E", "seed", "value", "core_seconds", "verdict")
        }
        constants = {"value": self.value, "uncertainty": self.uncertainty}
        return Table(columns, constants, {"cell": "m", "E": "Pa", "core_seconds": "s"})

    def runs_table(self) -> str:
        """The runs as text, a line for each."""
        head = f"{'cell [m]':>10s}  {'E [Pa]':>8s}  {'seed':>4s}  {'value':>10s}  {'time [s]':>8s}"
        lines = [
            f"{s.cell:10.4g}  {s.E:8.2g}  {s.seed:4d}  {s.value:10.5g}  {s.core_seconds:8.3g}"
            for s in self.samples
        ]
        return "\n".join(
            [
                f"{head}  verdict",
                *(f"{line}  {s.verdict}" for line, s in zip(lines, self.samples, strict=True)),
            ]
        )

    def __str__(self) -> str:
        parts = ", ".join(
            f"{name} {getattr(self, f'of_{name}'):.2g}"
            for name in ("cells", "stiffness", "scatter")
        )
        lines = [
            f"{self.value:.4g} +- {self.uncertainty:.2g} ({parts}; "
            f"{len(self.samples)} runs, {self.core_seconds:.3g} s of one core)"
        ]
        lines += [f"tolerance not reached: {self.remark}"] * bool(self.remark)
        for sample in self.suspect:
            lines.append(
                f"run in cells of {sample.cell:g} m with E = {sample.E:g} Pa: {sample.verdict}"
            )
        return "\n".join(lines)


def answer(
    scene: Scene | Callable[..., Scene],
    measure: str | Callable[[Trajectory], float],
    *,
    tolerance: float = 0.03,
    order: float = 1.0,
    budget: float = 3600.0,
    every: float | None = None,
    folder: str | Path | None = None,
    threads: int | None = None,
    progress: bool = True,
) -> Answer:
    """Compute a number with its uncertainty: runs in several cells, with several E and points.

    The scene is run as it is, in cells 1.5 and 2 times as large, there with other points as well,
    and with an E four times smaller. All this costs about twice as much as the first run. While the
    uncertainty exceeds the tolerance, the largest part of it determines what follows: runs in finer
    cells, runs with other points, or all runs with an E four times larger.

    Parameters
    ----------
    scene : Scene or callable
        A ready scene, as its function made it, in cells as coarse as they may be; or a function
        that makes a scene, with the keywords ``cell`` [m] and ``seed`` and their defaults. Points
        must depend on the seed, as by ``Fill(jitter=0.1)``; with the ready scenes those of the
        seeds after the first are jittered by a tenth of their spacing at least.
    measure : str or callable
        "discharge", "runout", "height", "repose_angle" or "mean_speed" (see Notes), or a function
        of the record of a run, a `Trajectory`, that returns a number.
    tolerance : float
        Relative uncertainty to reach, from 0.001 to 1.
    order : float
        Power p of the size of cells to which errors are proportional, 0.5 to 4.
    budget : float
        Largest processor time [s]. The first runs are made whatever they cost.
    every : float, optional
        Time between frames [s], see `Simulation.run`.
    folder : path, optional
        Folder of the records. Runs that are complete there are not made again. By default they are
        in a temporary folder, and are removed.
    threads : int, optional
        As of `Simulation`; no number depends on it.
    progress : bool
        Show a progress bar that counts runs.

    Returns
    -------
    Answer
        It prints as one line, and a line for each run whose verdict is not ok.

    Raises
    ------
    TypeError, ValueError
        For wrong arguments, a scene that was made by hand, one that does not fit into cells of
        other sizes, and a measure that does not return a finite number.

    Notes
    -----
    The value is the limit y_0 of y = y_0 + a dx^p, by least squares over all runs in cells up to
    2.6 times as large as the finest, for E to infinity. Its uncertainty has three parts: the part
    of the cells is all that is extrapolated beyond the finest; that of the stiffness all that is
    extrapolated beyond the largest E; that of the scatter is the standard error of the value times
    Student's t for 95 %. What all runs have in common is not contained: the law, the size of the
    domain, the number of points per cell.

    "discharge" is the rate while the material that leaves in the run passes from 20 to 80 % [kg/s,
    in 2D per metre of depth]. The others are numbers at the end of the run: "runout" is that of
    99.9 % of the mass, over the half-width; "height" the largest height of the surface [m];
    "repose_angle" the mean slope [deg]; "mean_speed" that of all points [m/s].
    """
    in_range("tolerance", tolerance, 1e-3, 1.0)
    in_range("order", order, 0.5, 4.0)
    runs = _Runs(
        Variants(scene), quantity(measure), every, folder, threads, positive("budget", budget)
    )
    warn_of(runs.variants.first)
    with (
        runs,
        bar(disable=not progress, desc="answer", unit="run") as done,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", StabilityWarning)  # coarse and soft runs are on purpose
        cells = [runs.variants.cell, *runs.variants.coarser(runs.variants.cell)]
        runs.add(done, *((cell, 1.0, 0) for cell in cells))
        runs.add(done, *((cell, 1.0, 1) for cell in cells[1:]), (cells[1], SOFTER, 0))
        error, remark = error_bar(runs.samples, order), ""
        while not remark and not error.uncertainty <= tolerance * abs(error.value):
            try:
                further, remark = runs.further(error)
                runs.add(done, *further)
            except ValueError as failure:  # such as a fixed time step in finer cells
                remark = f"a further run is not possible: {failure}"
            else:
                error = error_bar(runs.samples, order)
        return _answer(error, tolerance, runs.samples, remark)


def _answer(found: ErrorBar, tolerance: float, samples: Sequence[Sample], remark: str) -> Answer:
    return Answer(
        value=found.value,
        uncertainty=found.uncertainty,
        of_cells=found.of_cells,
        of_stiffness=found.of_stiffness,
        of_scatter=found.of_scatter,
        tolerance=tolerance,
        reached=not remark,
        samples=tuple(samples),
        remark=remark,
    )


def warn_of(scene: Scene) -> None:
    """Issue the warnings of the scene as it was given."""
    for sentence in scene_warnings(scene):
        warnings.warn(sentence, StabilityWarning, stacklevel=3)


Wanted = tuple[float, float, int]
"""A run: the size of the cells [m], the softness and the seed."""


class _Runs:
    """The runs of an answer, and what they found."""

    def __init__(
        self,
        variants: Variants,
        measure: Quantity,
        every: float | None,
        folder: str | Path | None,
        threads: int | None,
        budget: float,
    ) -> None:
        self.variants, self.samples = variants, list[Sample]()
        self._measure, self._every, self._threads = measure, every, threads
        self._budget = budget
        self._temporary = tempfile.TemporaryDirectory() if folder is None else None
        self._folder = Path(self._temporary.name if self._temporary else folder or ".")
        self._folder.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> _Runs:
        return self

    def __exit__(self, *error: object) -> None:
        if self._temporary is not None:
            self._temporary.cleanup()

    def add(self, done: Any, *wanted: Wanted) -> None:
        """Make these runs."""
        for cell, softness, seed in wanted:
            scene = self.variants.scene(cell, softness, seed)
            name = f"cell_{cell:.6g}_softness_{softness:g}_seed_{seed}"
            name += ".h5" if self._every is None else f"_every_{self._every:g}.h5"
            value, seconds, verdict = self._result(scene, self._folder / name)
            E = float(getattr(scene.material, "E", math.nan))
            self.samples.append(Sample(cell, E, softness, seed, value, seconds, verdict))
            done.update()

    def _result(self, scene: Scene, path: Path) -> tuple[float, float, str]:
        """Result of a run, its processor time and its verdict."""
        begin = time.process_time()
        if not _is_complete(path, scene):
            simulation: Simulation = Simulation(scene, threads=self._threads)
            simulation.run(save=path, every=self._every, overwrite=True)
        with open_trajectory(path) as record:
            seconds = time.process_time() - begin
            value = self._measure(record)
            suspect = ", ".join(indicator.name for indicator in record.health().suspect)
        if self._temporary is not None:
            path.unlink()
        return value, seconds, f"suspect: {suspect}" if suspect else "ok"

    def further(self, found: ErrorBar) -> tuple[list[Wanted], str]:
        """Runs that make the largest part of the uncertainty smaller, or why there are none."""
        try:
            wanted = getattr(self, f"_for_{found.largest}")()
        except ValueError as error:
            return [], f"the largest part is that of the {found.largest}, and {error}"
        spent = math.fsum(sample.core_seconds for sample in self.samples)
        next_ = math.fsum(self._seconds(one) for one in wanted)
        if spent + next_ > (1 + SLACK) * self._budget:
            return [], (
                f"the largest part is that of the {found.largest}; the next {len(wanted)} runs "
                f"would take {next_:.3g} s beyond the {spent:.3g} s spent, and the budget is "
                f"{self._budget:g} s"
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
        cells = sorted({sample.cell for sample in in_fit(self.samples)})
        at = max(
            s.cell for s in self.samples if s.softness == soft and s.cell in self._cells(stiff)
        )
        seed = self._next_seed(at, soft)
        return self._new(
            *((cell, stiff, self._next_seed(cell, stiff)) for cell in cells),
            *((at, softness, seed) for softness in (stiff, soft)),
        )

    def _for_stiffness(self) -> list[Wanted]:
        """All runs that count with a larger E."""
        return [(s.cell, s.softness / SOFTER, s.seed) for s in in_fit(self.samples)]

    def _new(self, *wanted: Wanted) -> list[Wanted]:
        """Those of some runs that were not made."""
        made = {(sample.cell, sample.softness, sample.seed) for sample in self.samples}
        return [run for run in dict.fromkeys(wanted) if run not in made]

    def _cells(self, softness: float) -> set[float]:
        return {sample.cell for sample in self.samples if sample.softness == softness}

    def _next_seed(self, cell: float, softness: float) -> int:
        alike = [s.seed for s in self.samples if (s.cell, s.softness) == (cell, softness)]
        return 1 + max(alike, default=-1)

    def _seconds(self, wanted: Wanted) -> float:
        """Processor time of a run: as estimated, in proportion to those that were made."""
        ran = max(self.samples, key=lambda sample: sample.core_seconds)
        estimates = [
            cost(self.variants.scene(*one)).seconds
            for one in (wanted, (ran.cell, ran.softness, ran.seed))
        ]
        return estimates[0] / estimates[1] * ran.core_seconds


def _is_complete(path: Path, scene: Scene) -> bool:
    """True if a file is the finished record of a scene."""
    if not path.exists():
        return False
    with open_trajectory(path) as record:
        return record.finished and record.scene.to_json() == scene.to_json()
