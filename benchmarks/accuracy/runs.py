"""One case: its scene, its run and the processor time, and the measurements."""

from __future__ import annotations

import math
import os
import time
from functools import cache
from typing import Any

import numpy as np

import granular as gr
from accuracy.cases import HYDRODYNAMICS, SCHEMES, Case
from granular import sph
from granular.theory import beverloo_rate

GRAVITY = 9.8
HEIGHT = 0.2
"""Height of the layer on an incline [m]."""
COLUMNS = 8
"""Columns of cells of the two-dimensional incline."""
JITTER = 0.6
"""Jitter of the seeding, in point spacings."""
ORIFICE = 0.2
"""Opening of the silo [m]. The silo is half as wide as the paper's, to halve its cost, and as
high."""
SILO = {"orifice": ORIFICE, "width": 0.48, "height": 1.0}
FILL = 720.0
"""Mass in the full silo [kg]."""
WINDOW = (0.8 * FILL, 0.6 * FILL)
"""Remaining mass at the begin and end of the measurement of the discharge rate [kg]."""
FRAME = 1 / 120
"""Time between two readings of the mass [s]."""
UNTIL = {"incline": 20.0, "incline_2d": 10.0, "collapse": 1.5, "silo": 2.0}
"""Durations [s]; the silo stops at the end of its mass window."""
BIN = 0.025
"""Width of the bins of the profile of a heap [m], independent of the cell."""
REACH = 1.5
"""Length of the profile of a heap [m]."""
PROBE = 100
"""Number of first steps from which the cost of a run is estimated."""


def scene_of(case: Case) -> gr.Scene | sph.Scene:
    """The scene of a case."""
    if case.scheme == HYDRODYNAMICS and case.scene == "incline_2d":
        return sph_incline(case)
    common: dict[str, Any] = {
        "cell": case.cell,
        "points_per_cell": case.points,
        "material": gr.materials.glass_beads.replace(E=case.E),
        "scheme": SCHEMES.get(case.scheme, gr.schemes.default),  # not used by peers
        "seed": case.seed,
        "duration": case.until or UNTIL[case.scene],
    }
    if case.scene == "incline":
        return gr.scenes.incline(angle_deg=case.angle_deg, height=HEIGHT, **common)
    if case.scene == "incline_2d":
        layer = {"angle_deg": case.angle_deg, "height": HEIGHT, "columns": COLUMNS}
        return gr.scenes.incline(**layer, jitter=JITTER, **common)
    if case.scene == "collapse":
        # Seeds differ by a jitter of a tenth of a point spacing, to measure the random scatter.
        common["jitter"] = 0.1 if case.seed else 0.0
        common["method"] = "sph" if case.scheme == HYDRODYNAMICS else "mpm"
        return gr.scenes.column_collapse(aspect=1.0, **common)
    return gr.scenes.silo(**SILO, **common)


def sph_incline(case: Case) -> sph.Scene:
    """SPH scene of the incline, with matching friction at half the weight."""
    beads, per = gr.materials.glass_beads.replace(E=case.E), math.isqrt(case.points)
    across = math.cos(math.radians(case.angle_deg))
    pressure = 0.5 * beads.rho_c * GRAVITY * across * HEIGHT
    return gr.scenes.incline_sph(
        angle_deg=case.angle_deg,
        height=HEIGHT,
        spacing=case.cell / per,
        columns=COLUMNS * per,
        gravity=GRAVITY,
        duration=case.until or UNTIL[case.scene],
        material=sph.Viscoplastic.matching(beads, pressure),
    )


class TooLong(Exception):
    """A case whose estimated cost is above the limit."""


def run(case: Case, simulation: Any = gr.Simulation, limit: float = math.inf) -> dict[str, Any]:
    """Run a case and return the row of its results. Only the steps are timed, not the set-up.

    Parameters
    ----------
    case : Case
    simulation : callable
        Makes a simulation of a scene, with `run(until=)`, `time`, `state`, `steps`, `dt` and
        `n_points` as in `granular.Simulation`; peers have such a class.
    limit : float
        Largest cost [core-seconds].

    Raises
    ------
    TooLong
        If it would take longer, estimated from its first steps.
    """
    load = os.getloadavg()[0]
    sim = simulation(scene_of(case), threads=1)
    points = sim.n_points
    begin = time.process_time()
    sim.run(until=PROBE * sim.dt)
    seconds = UNTIL["silo"] / 2 if case.scene == "silo" else sim.scene.duration
    foreseen = (time.process_time() - begin) * seconds / sim.time
    if foreseen > limit:
        raise TooLong(f"{foreseen:.0f} core-seconds foreseen")
    history = empty(sim) if case.scene == "silo" else sim.run(until=sim.scene.duration)
    seconds = time.process_time() - begin
    measured = discharge(history) if case.scene == "silo" else MEASURES[case.scene](sim.state)
    return case.row() | {
        "n_points": points,
        "time": sim.time,
        "steps": sim.steps,
        "dt": sim.dt,
        "core_seconds": round(seconds, 3),
        "load": round(load, 1),
        **{name: _short(value) for name, value in measured.items()},
    }


def _short(value: Any) -> Any:
    """Round numbers to six digits and leave out those that are not finite, which JSON lacks."""
    if np.ndim(value):
        return [_short(v) for v in value]
    return float(f"{value:.6g}") if np.isfinite(value) else None


@cache
def _exact(angle_deg: float, at: float) -> tuple[np.ndarray, np.ndarray]:
    """Heights and velocities of the one-dimensional equation, with the origin at the base."""
    exact = gr.theory.transient(angle_deg, HEIGHT, gr.materials.glass_beads, [at], 9.8)
    return exact.y, np.ravel(exact.v)


def incline(state: gr.State) -> dict[str, Any]:
    """Errors of the velocity profile against the one-dimensional equation, L2 over the points."""
    settled = state.scene.parameters.get("settle", 0.0)  # before the tilt
    y, v = _exact(state.scene.parameters["angle_deg"], state.time - settled)
    along = state.v[:, 0]
    exact = np.interp(state.x[:, 1], y, v)
    mean, exact_mean = np.average(along, weights=state.mass), np.trapezoid(v, y) / HEIGHT
    miss = np.sum(state.mass * (along - exact) ** 2) / np.sum(state.mass * exact**2)
    return {
        "profile_error": np.sqrt(miss),
        "mean_error": mean / exact_mean - 1,
        "height": gr.measure.layer_height(state) / HEIGHT,
        "stress_free": np.average(~state.dense, weights=state.mass),
    }


def collapse(state: gr.State) -> dict[str, Any]:
    """Run-outs, and the profile of the heap: its height by mass in bins of BIN."""
    runout = gr.measure.runout(state)
    edges = np.linspace(0.0, REACH, round(REACH / BIN) + 1)
    mass = np.histogram(state.x[:, 0], bins=edges, weights=state.mass)[0]
    return {
        "runout_quantile": runout.quantile,
        "runout_toe": runout.toe,
        "runout_contiguous": runout.contiguous,
        "profile": mass / (BIN * state.scene.material.rho_c),
        "stress_free": gr.measure.disconnected_fraction(state),
    }


def empty(sim: Any) -> gr.measure.MassHistory:
    """Run a silo to the end of its mass window; the mass of the full silo at every frame."""
    times, mass = [], []
    while sim.time < sim.scene.duration and (not mass or mass[-1] >= WINDOW[1]):
        sim.run(until=(len(times) + 1) * FRAME)
        times.append(sim.time)
        mass.append(2 * float(np.sum(sim.state.mass)))
    return gr.measure.MassHistory(np.array(times), np.array(mass), 0.5)


def discharge(history: gr.measure.MassHistory) -> dict[str, Any]:
    """Discharge rate of the full silo, and Beverloo's C at the exponent 3/2."""
    flow = gr.measure.discharge(history, window=WINDOW)
    unit = beverloo_rate(ORIFICE, gr.materials.glass_beads.rho_c, C=1.0, gravity=9.8)
    return {"rate": flow.rate, "rate_spread": flow.window_spread, "C": flow.rate / unit}


MEASURES = {"incline": incline, "incline_2d": incline, "collapse": collapse}
