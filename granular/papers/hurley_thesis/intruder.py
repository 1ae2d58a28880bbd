"""Figures 3.7 to 3.10: forces in a bed of discs that an intruder hits.

The bed is synthetic, with the sizes, the width, the friction and the speed of section 3.4; the
depth of the bed, the stiffness and the density of the discs were chosen. Stresses have an error of
10 %, and rotations are unknown. Experiments differ by the packing of the bed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from granular import plot
from granular.grain_scale import inference
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.errors import (
    needs_solver,
    quietly,
    relative_error,
    with_noise,
)
from granular.papers.hurley_thesis.grains import Grains, layered_positions
from granular.papers.hurley_thesis.impacts import MU, Record, film
from granular.papers.runs import Runs
from granular.tools.arrays import Array

STIFFNESS, DENSITY, STEEL = 9e6, 1100.0, 7850.0
RADII = (0.0127, 0.015875)
WIDTH, GRAINS, INTRUDER, SPEED = 0.81, 330, 0.1, 2.4
THICKNESS = 0.0095
"""Depth of the grains [m]; forces are inferred per metre of depth."""
FRAMES, RATE = 180, 4500.0
BINS = 10


@dataclass(frozen=True)
class Experiment:
    """Data of an impact: record, inferred and true forces, distances from the intruder."""

    record: Record
    forces: list[Array]
    true: list[Array]
    distances: list[Array]

    @property
    def error(self) -> float:
        """Error of all forces, eq. 2.15."""
        return relative_error(np.concatenate(self.forces), np.concatenate(self.true))

    def lift(self, forces: Sequence[Array]) -> Array:
        """Vertical force on the intruder in each frame [N]."""
        force = np.zeros(len(self.record.times))
        for k, case, f in zip(self.record.touching, self.record.frames, forces, strict=True):
            force[k] = -f[case.packing.bodies[:, 1] == inference.OUTSIDE, 1].sum()
        return force

    def largest(self) -> Array:
        """Largest force by the distance from the intruder, in bins of the smallest diameter."""
        return inference.largest_by_distance(
            self.forces, self.distances, bin_width=2 * RADII[0], bins=BINS
        )


def bed(seed: int, shift: float = 0.0) -> Grains:
    """Grains at rest under gravity, and an intruder that is about to touch them."""
    rng = np.random.default_rng(seed)
    R = np.append(rng.choice(RADII, GRAINS), INTRUDER)
    x = np.zeros((GRAINS + 1, 2))
    x[:-1] = layered_positions(GRAINS, (24,), WIDTH / 24, 2, rng)
    x[-1] = WIDTH / 2, 2.0
    x[:-1, 0] += shift
    m = DENSITY * np.pi * R**2
    m[-1] = STEEL * np.pi * INTRUDER**2
    system = Grains(
        x, R, m, 0.0, [WIDTH, np.inf], dim=2, kn=STIFFNESS, kt=2 / 3 * STIFFNESS, mu=MU,
        dt=1 / RATE / 6, damping=0.2, drag=5.0, gravity=9.81,
    )  # fmt: skip
    for _ in range(5):
        system.step(2500)
        system.x[-1, 1], system.v[-1] = 2.0, 0.0
    system.drag = 0.0
    # The intruder is as low as possible without a contact.
    offset = abs(system.x[:-1, 0] - WIDTH / 2)
    reach = INTRUDER + R[:-1]
    near = offset < reach
    rise = np.sqrt(reach[near] ** 2 - offset[near] ** 2)
    system.x[-1, 1] = (system.x[:-1, 1][near] + rise).max()
    system.v[:] = 0.0
    system.v[-1, 1] = -SPEED
    system.search()
    return system


def experiment(seed: int, every: int, shift: float = 0.0) -> Experiment:
    """Every `every`-th frame of an impact, with forces inferred from stresses with errors."""
    system, rng = bed(seed, shift), np.random.default_rng(100 + seed)
    record = film(system, GRAINS, FRAMES // every, every / RATE)
    forces, distances = [], []
    for k, case in zip(record.touching, record.frames, strict=True):
        packing = replace(
            with_noise(case.packing, rng, bias=0.0), inertias=None, angular_accelerations=None
        )
        inferred = quietly(inference.infer_dynamic, packing, mu=MU, mu_wall=0.0)
        forces.append(THICKNESS * inferred.forces)
        away = np.linalg.norm(packing.positions - record.others[k, 0], axis=1)
        distances.append(np.maximum(away - INTRUDER, 0.0))
    true = [THICKNESS * case.forces for case in record.frames]
    return Experiment(record, forces, true, distances)


def experiments(runs: Runs, seeds: Sequence[int]) -> dict[str, Experiment]:
    """Impacts on beds of these seeds, by name."""
    needs_solver()
    every = 20 if runs.quick else 2
    runs.remarks.append(f"{GRAINS} discs, synthetic record at {RATE / every:g} Hz")
    shift = runs.settings.shift
    return {
        f"experiment {seed + 1}": runs.once(f"bed {seed}", partial(experiment, seed, every, shift))
        for seed in seeds
    }


def network(runs: Runs, seed: int) -> Drawn:
    """Forces of one experiment at six times, and how long a chain lasts below the intruder.

    It counts as one while the force on the intruder is more than half of the largest.
    """
    (one,) = experiments(runs, (seed,)).values()
    frames = (np.linspace(0.1, 0.9, 6) * len(one.forces)).astype(int)
    panels = {
        f"{1e3 * one.record.times[one.record.touching[k]]:.1f} ms": (
            one.record.frames[k].packing,
            one.forces[k],
        )
        for k in frames
    }
    lift, times = one.lift(one.forces), one.record.times
    pushed = np.flatnonzero(lift > 0.5 * lift.max())
    numbers: dict[str, Number] = {
        "error of all forces, eq. 2.15": one.error,
        "force chain below the intruder, from [ms]": 1e3 * float(times[pushed[0]]),
        "force chain below the intruder, until [ms]": 1e3 * float(times[pushed[-1]]),
    }
    return Drawn({"": plot.force_networks(panels, columns=2)}, numbers)


@PAPER.figure(
    "3.7",
    "forces in a bed of discs at six times during the impact of an intruder",
    seconds=10.0,
    paper={
        "force chain below the intruder, from [ms]": 5.0,
        "force chain below the intruder, until [ms]": 28.0,
    },
)
def first_bed(runs: Runs) -> Drawn:
    """Forces in the first bed."""
    return network(runs, 0)


@PAPER.figure(
    "3.8",
    "the same in a bed with another packing",
    seconds=10.0,
    paper={"force chain below the intruder, until [ms]": "other than in figure 3.7"},
)
def second_bed(runs: Runs) -> Drawn:
    """Forces in the second bed."""
    return network(runs, 1)


@PAPER.figure(
    "3.9",
    "vertical force on the intruder over time in the beds of figures 3.7 and 3.8",
    seconds=17.0,
    paper={"peaks above half of the largest, experiment 1": "several"},
)
def force_on_intruder(runs: Runs) -> Drawn:
    """Sum the inferred forces at the contacts of the intruder."""
    both = experiments(runs, (0,) if runs.quick else (0, 1))
    series, numbers = {}, {}
    for name, one in both.items():
        lifts = {"true": one.lift(one.true), "inferred": one.lift(one.forces)}
        series[name] = (one.record.times, lifts)
        numbers[f"largest force, {name} [N]"] = float(lifts["inferred"].max())
        numbers[f"error of the force over time, {name}"] = relative_error(
            lifts["inferred"], lifts["true"]
        )
        numbers[f"peaks above half of the largest, {name}"] = float(peaks(lifts["inferred"]))
    return Drawn({"": plot.force_histories(series, ylabel="force on the intruder [N]")}, numbers)


def peaks(series: Array) -> int:
    """Number of local maxima above half of the largest value."""
    high = series[1:-1] > 0.5 * series.max()
    return int((high & (series[1:-1] > series[:-2]) & (series[1:-1] >= series[2:])).sum())


@PAPER.figure(
    "3.10",
    "largest force against the distance from the intruder in three beds",
    seconds=24.0,
    paper={"spread of the three curves over their mean": "very similar"},
)
def forces_by_distance(runs: Runs) -> Drawn:
    """Largest force of all frames in bins of one diameter of the smaller grains.

    The spread is the mean over the bins of the standard deviation over the mean of the curves.
    """
    three = experiments(runs, (0,) if runs.quick else (0, 1, 2))
    curves = {name: one.largest() for name, one in three.items()}
    values = np.array(list(curves.values()))
    numbers: dict[str, Number] = {
        f"largest force within {n:g} diameters, mean [N]": float(values[:, n - 1].mean())
        for n in (1, 5, 10)
    }
    if len(values) > 1:
        spread = values.std(axis=0, ddof=1) / values.mean(axis=0)
        numbers["spread of the three curves over their mean"] = float(spread.mean())
    return Drawn({"": plot.force_distances(curves, 2 * RADII[0])}, numbers)
