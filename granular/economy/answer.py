"""A number with an error bar: the runs that it takes, from coarse to fine, and what they cost."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from granular.economy.error_bar import ErrorBar, Sample, error_bar
from granular.economy.quantities import quantity
from granular.economy.trials import Options, Trials
from granular.economy.variants import Variants
from granular.measure.result import Table
from granular.mpm.scene import Scene
from granular.record import Trajectory
from granular.run.diagnostics import StabilityWarning, warn
from granular.tools.checks import in_range, positive, truth
from granular.tools.progress import bar


@dataclass(frozen=True)
class Answer(ErrorBar):
    """A number, and the interval in which it lies with a probability of 95 %.

    Attributes
    ----------
    value : float
        The number in fine cells, and for stiff grains, in the unit of the measure.
    uncertainty : float
        Half of the interval: its three parts, added in squares.
    of_cells, of_stiffness, of_scatter : float
        Parts of the uncertainty: by the size of the cells, by E, and by the scatter between runs
        whose points differ.
    tolerance : float
        That was asked for, relative to the value.
    samples : tuple of Sample
        The runs.
    remark : str
        Why the tolerance was not reached; else empty.
    """

    tolerance: float
    samples: tuple[Sample, ...]
    remark: str

    @property
    def reached(self) -> bool:
        """True if the uncertainty is within the tolerance."""
        return not self.remark

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
    rigid: bool | None = None,
    every: float | None = None,
    wall_forces: bool = False,
    tractions: bool = False,
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
    rigid : bool, optional
        True for the number of stiff grains, which E only approximates; False for that of material
        with the E of the scene, of which there are no softer or stiffer runs then. By default True,
        but False if a material bears tension, such as an elastic solid. Take False where E was
        measured, as that of a soil under a footing.
    every : float, optional
        Time between frames [s], see `Simulation.run`.
    wall_forces, tractions : bool
        As of `Simulation`, for measures that need them.
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
    2.6 times as large as the finest, and with `rigid` for E to infinity. Its uncertainty has three
    parts: the part of the cells is all that is extrapolated beyond the finest; that of the
    stiffness all that is extrapolated beyond the largest E; that of the scatter is the standard
    error of the value times Student's t for 95 %. What all runs have in common is not contained:
    the law, the size of the domain, the number of points per cell.

    "discharge" is the rate while the material that leaves in the run passes from 20 to 80 % [kg/s,
    in 2D per metre of depth]. The others are numbers at the end of the run: "runout" is that of
    99.9 % of the mass, over the half-width; "height" the largest height of the surface [m];
    "repose_angle" the mean slope [deg]; "mean_speed" that of all points [m/s].
    """
    in_range("tolerance", tolerance, 1e-3, 1.0)
    in_range("order", order, 0.5, 4.0)
    variants = Variants(scene)
    options = Options(
        every=every,
        threads=threads,
        budget=positive("budget", budget),
        rigid=_is_granular(variants.first) if rigid is None else truth("rigid", rigid),
        wall_forces=wall_forces,
        tractions=tractions,
    )
    trials = Trials(variants, quantity(measure), options, folder)
    warn(variants.first)
    with (
        trials,
        bar(disable=not progress, desc="answer", unit="run") as done,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore", StabilityWarning)  # coarse and soft runs are on purpose
        trials.add(trials.first(), done)
        error, remark = error_bar(trials.samples, order), ""
        while not remark and not error.uncertainty <= tolerance * abs(error.value):
            try:
                further, remark = trials.further(error)
                trials.add(further, done)
            except Exception as failure:  # such as a fixed time step in finer cells
                remark = f"a further run failed: {type(failure).__name__}: {failure}"
            else:
                error = error_bar(trials.samples, order)
        return Answer(
            **vars(error), tolerance=tolerance, samples=tuple(trials.samples), remark=remark
        )


def _is_granular(scene: Scene) -> bool:
    """True if all materials separate, so that their E is a number of the method."""
    return all(material.granular for material in scene.materials)
