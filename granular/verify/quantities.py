"""Quantities of interest of the paper's scenes: the numbers that a cheaper run must reproduce."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from granular import measure
from granular.measure.discharge import WINDOW
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.run.simulation import Simulation
from granular.tools.arrays import Array
from granular.verify.hourglass import heap

FRAME = 1 / 60
"""Time between two samples of a run [s]."""

FLOW_TIMES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""Times at which the mean velocity of an incline is read [s], up to the end of the run."""

LAYERS = 20
"""Bins of the velocity profile over the height of an incline."""

POURING = (1.0, 3.0)
"""Start and end of the interval in which the rate of an hourglass is measured [s]."""

COLUMNS = 40
"""Bins of a heap's outline over the width of the domain."""


@dataclass(frozen=True)
class Outcome:
    """Results and cost of a run.

    Attributes
    ----------
    numbers : mapping of str to ndarray
        The quantities of interest; see `quantities`.
    seconds : float
        Processor time [s].
    steps, point_steps : int
        Number of steps, and sum over the steps of the number of points.
    mean_dt : float
        Simulated time divided by the number of steps [s].
    """

    numbers: Mapping[str, Array]
    seconds: float
    steps: int
    point_steps: int
    mean_dt: float


class _Watch:
    """Run a simulation to given times and record its cost."""

    def __init__(self, scene: Scene) -> None:
        self.sim = Simulation(scene, threads=1)
        self.begin = clock.process_time()
        self.point_steps = 0

    def to(self, time: float) -> State:
        """State at the first step at or after a time [s]."""
        while self.sim.time < time:
            before, points = self.sim.steps, self.sim.n_points
            self.sim.run(until=min(time, self.sim.time + FRAME))
            self.point_steps += (self.sim.steps - before) * points
        return self.sim.state

    def outcome(self, numbers: Mapping[str, Array | float]) -> Outcome:
        return Outcome(
            {name: np.atleast_1d(np.asarray(value, float)) for name, value in numbers.items()},
            clock.process_time() - self.begin,
            self.sim.steps,
            self.point_steps,
            self.sim.time / self.sim.steps,
        )


def _incline(watch: _Watch, scene: Scene) -> dict[str, Array | float]:
    times = [t for t in (*FLOW_TIMES, scene.duration) if t <= scene.duration]
    means = []
    for time in dict.fromkeys(times):
        state = watch.to(time)
        means.append(np.average(state.v[:, 0], weights=state.mass))
    height = scene.parameters["height"]
    layer = np.minimum((state.x[:, 1] / height * LAYERS).astype(int), LAYERS - 1)
    weight = np.bincount(layer, state.mass, LAYERS)
    profile = np.bincount(layer, state.mass * state.v[:, 0], LAYERS) / np.maximum(weight, 1e-300)
    return {"mean velocity": np.array(means), "profile": profile}


def _outline(state: State) -> Array:
    """Height of a heap [m], by mass, in equal bins over the width of the domain."""
    grid = state.scene.grid
    width = grid.upper[0] - grid.lower[0]
    bins = ((state.x[:, 0] - grid.lower[0]) / width * COLUMNS).astype(int)
    mass = np.bincount(np.clip(bins, 0, COLUMNS - 1), state.mass, COLUMNS)
    return mass / (state.scene.material.rho_c * width / COLUMNS)


def _centre(state: State) -> Array:
    return np.average(state.x, axis=0, weights=state.mass)


def _collapse(watch: _Watch, scene: Scene) -> dict[str, Array | float]:
    state = watch.to(scene.duration)
    runout = measure.runout(state)
    return {
        "run-out": runout.quantile,
        "toe": runout.toe,
        "contiguous": runout.contiguous,
        "centre": _centre(state),
        "outline": _outline(state),
        "slope": measure.repose_angle(state).mean_deg,
    }


def _silo(watch: _Watch, scene: Scene) -> dict[str, Array | float]:
    times, mass = [0.0], [2 * float(watch.sim.state.mass.sum())]
    while mass[-1] > WINDOW[1] and times[-1] < scene.duration:
        state = watch.to(times[-1] + FRAME)
        times.append(state.time)
        mass.append(2 * float(state.mass.sum()))
    outflow = measure.discharge(measure.MassHistory(np.array(times), np.array(mass), 0.5))
    return {"rate": outflow.rate, "window spread": outflow.window_spread}


def _hourglass(watch: _Watch, scene: Scene) -> dict[str, Array | float]:
    begin, end = POURING
    times = np.arange(round(begin / FRAME), round(end / FRAME) + 1) * FRAME
    drop, rows = scene.parameters["drop"], []
    for time in times[times <= scene.duration + FRAME / 2]:
        state = watch.to(time)
        rows.append((state.time, 2 * state.mass[state.x[:, 1] > drop].sum()))
    t, mass = np.array(rows).T
    numbers: dict[str, Array | float] = {"rate": -np.polyfit(t, mass, 1)[0]}
    if scene.duration > end:
        state = watch.to(scene.duration)
        numbers |= {"slope": heap(state).mean_deg, "outline": _outline(state)}
    return numbers


def _slug(watch: _Watch, scene: Scene) -> dict[str, Array | float]:
    state = watch.to(1 / 240)
    full = 0.5 * float(state.mass @ state.v[:, 0])
    before: tuple[float, float] | None = None
    while (now := (state.time, float(state.mass @ state.v[:, 0])))[1] > full:
        before = now
        state = watch.to(state.time + 1 / 240)
    if before is None:
        raise ValueError(f"scene {scene.name!r} met its wall before the first sample")
    (t0, p0), (t1, p1) = before, now
    impact = t0 + (t1 - t0) * (p0 - full) / (p0 - p1)
    state = watch.to(scene.duration)
    return {"impact": impact, "centre": _centre(state), "outline": _outline(state)}


_OF: Mapping[str, Callable[[_Watch, Scene], dict[str, Array | float]]] = {
    "incline": _incline,
    "column_collapse": _collapse,
    "cylinder_collapse": _collapse,
    "silo": _silo,
    "hourglass_flat": _hourglass,
    "hourglass_sloped": _hourglass,
    "slug": _slug,
}


def quantities(scene: Scene) -> Outcome:
    """Run a ready-made scene with one thread and measure its quantities of interest.

    Incline: mean velocity [m/s] at `FLOW_TIMES` and the profile at the end. Columns: the three
    run-outs, centre of mass [m], outline [m] and slope [deg] at the end. Silo: rate of discharge
    [kg/s per metre of depth] of the full silo in the window of the paper, and its spread there.
    Hourglass: rate between 1 and 3 s and, if the run is longer, slope and outline of the heap at
    the end. Slug: the time [s] at which the wall has taken half of its horizontal momentum, and
    centre of mass and outline at the end.

    Raises
    ------
    ValueError
        If the scene is none of these.
    """
    if scene.name not in _OF:
        raise ValueError(f"scene.name = {scene.name!r} must be one of {tuple(_OF)}")
    watch = _Watch(scene)
    return watch.outcome(_OF[scene.name](watch, scene))


def change(value: Array, reference: Array) -> float:
    """Root mean square of the difference, divided by that of the reference."""
    return float(np.linalg.norm(value - reference) / np.linalg.norm(reference))
