"""Steady layer with the mu(I) rheology on a rough incline: the closed form named after Bagnold."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from granular import scenes
from granular.materials import MuI
from granular.model.state import State
from granular.mpm import schemes
from granular.mpm.schemes import Scheme
from granular.run.simulation import Simulation
from granular.scenes._build import soft_beads
from granular.theory import bagnold_mean, bagnold_profile, bagnold_shape
from granular.verify.external.frame import Data, Outcome, below, case, load, near

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MU_S, MU_2, I0 = 0.38, 0.64, 0.3
RHO = 1500.0
"""Bulk density [kg/m3], which is also that of I = d (du/dy) sqrt(rho/p), as in the file."""

STIFFNESS = 1e4
"""Young's modulus over rho g h: the layer is compressed by 0.005 %."""

RELAXATIONS = 16.0
"""Duration in (speed of the surface)/(g (sin - mu_s cos)): after 8 of them a layer at 0.5 rad is
still 0.8 % too slow, and that deficit decays by e in 1.6."""

SCHEMES = {"default": schemes.default, "cell_averaged": schemes.cell_averaged}


def speeds(
    angle: float, d: float, cells: int, scheme: Scheme, until: float
) -> tuple[np.ndarray, np.ndarray]:
    """y/h and v/sqrt(g h) of the points of one periodic column, at a time in sqrt(h/g)."""
    material = MuI(E=STIFFNESS * RHO, mu_s=MU_S, mu_2=MU_2, I0=I0, d=d, rho_s=RHO, rho_c=RHO)
    scene = scenes.incline(
        angle_deg=math.degrees(angle), height=1.0, cell=1.0 / cells, gravity=1.0, ramp=1.0,
        duration=until, material=material, scheme=scheme,
    )  # fmt: skip
    state = Simulation(scene, threads=1).run().state
    return state.x[:, 1], state.v[:, 0]


def duration(data: Data, angle: float) -> tuple[float, float, float, float]:
    """Speed of the surface and mean speed, grain diameter and duration of a run, scaled."""
    k = int(np.flatnonzero(data["angle_rad"] == angle)[0])
    surface, mean, d = (float(data[c][k]) for c in ("u_surface", "u_mean", "d_over_h"))
    return surface, mean, d, RELAXATIONS * surface / (math.sin(angle) - MU_S * math.cos(angle))


def profile_error(y: np.ndarray, v: np.ndarray, surface: float, mean: float) -> float:
    """Root mean square difference from the closed form over the mean speed."""
    return float(np.sqrt(np.mean((v - surface * bagnold_shape(y, 1.0)) ** 2))) / mean


def layer_errors(data: Data, angle: float, cells: int, scheme: Scheme) -> tuple[float, float]:
    """Relative errors of the mean speed and of the profile."""
    surface, mean, d, until = duration(data, angle)
    y, v = speeds(angle, d, cells, scheme, until)
    return float(v.mean()) / mean - 1.0, profile_error(y, v, surface, mean)


def picture(outcome: Outcome) -> Figure:
    """Profiles of velocity: points of the run on the lines of the closed form."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0, 3.6), layout="constrained")
    axes = figure.add_subplot()
    y = np.linspace(0, 1, 101)
    colours: dict[float, str] = {}
    for curve in outcome.curves.values():
        surface, angle = curve["surface"], curve["angle"]
        if angle not in colours:
            colours[angle] = f"C{len(colours)}"
            known = surface * bagnold_shape(y, 1.0)
            axes.plot(known, y, color=colours[angle], label=f"{angle} rad")
        marker = "o" if curve["scheme"] == "default" else "x"
        axes.plot(curve["v"][::2], curve["y"][::2], marker, ms=4, mfc="none", color=colours[angle])
    for scheme, marker in (("default", "o"), ("cell_averaged", "x")):
        axes.plot([], [], marker, ms=4, mfc="none", color="k", label=f"run, {scheme}")
    axes.set(xlabel=r"velocity $v / \sqrt{g h}$", ylabel="height $y / h$")
    axes.legend(title="closed form at")
    return figure


@case(picture)
def bagnold(quick: bool) -> Outcome:
    """Steady mu(I) layer on a periodic rough incline, from rest, against the closed form."""
    data, outcome = load("bagnold_mui_analytic"), Outcome()
    angles, resolutions = ((0.43,), (10,)) if quick else ((0.43, 0.46, 0.5), (10, 20))
    for angle, cells, name in itertools.product(angles, resolutions, SCHEMES):
        surface, mean, d, until = duration(data, angle)
        with outcome.timed():
            y, v = speeds(angle, d, cells, SCHEMES[name], until)
        error = profile_error(y, v, surface, mean)
        tag, finest = f"{angle} rad, {cells} cells, {name}", cells == resolutions[-1]
        outcome.rows += [
            near(f"mean speed over sqrt(g h), {tag}", float(v.mean()), mean, 0.01, finest),
            below(f"rms error of the profile over the mean, {tag}", error, 0.01, gate=finest),
        ]
        curve = {"y": y.tolist(), "v": v.tolist(), "surface": surface, "angle": angle}
        if finest:
            outcome.curves[tag] = curve | {"scheme": name}
    return outcome


def _draw_chute(outcome: Outcome) -> Figure:
    """Thickness and mean speed along the chute over those of the steady layer."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 3.2), layout="constrained")
    axes = figure.add_subplot()
    axes.axhline(1.0, color="k", lw=0.8, label="steady layer of the same flux, closed form")
    for name, (x, thickness, speed) in outcome.curves.items():
        line = axes.plot(x, thickness, "o-", ms=3, lw=1, label=f"thickness, {name}")[0]
        axes.plot(x, speed, "x--", ms=4, lw=1, color=line.get_color(), label=f"speed, {name}")
    axes.set(xlabel="distance from the feeder's beginning [m]", ylabel="run over closed form")
    axes.legend()
    return figure


DEPTH, FLOOR_DEG = 0.08, 27.0
"""Thickness of the layer on the chute [m] and inclination of the chute [deg]."""

WINDOW = (1.2, 0.6)
"""Distances [m] before the open end between which the layer is measured."""

DEPTH_CELLS = 12
"""Cells over the depth; 8 in quick runs, with which the error of the profile varies about 1 %."""

FILLING = 1.6
"""Duration over the length of the chute [s/m]. The front passes it in 0.9, but behind it the layer
is thinner than the steady one, by 20 % at 0.9, and within 0.5 % of it from 1.6 on."""


STEADY: dict[str, Any] = {
    "angle_deg": FLOOR_DEG, "height": DEPTH, "material": soft_beads, "gravity": 9.81,
}  # fmt: skip
"""The steady layer of the closed form."""


def fed(length: float, cells: int, scheme: Scheme) -> State:
    """Final state of a chute of a length [m], with a number of cells over the depth."""
    scene = scenes.chute_fed(
        angle_deg=FLOOR_DEG, height=DEPTH, speed=bagnold_mean(**STEADY), length=length,
        cell=DEPTH / cells, duration=FILLING * length, material=soft_beads, scheme=scheme,
    )  # fmt: skip
    return Simulation(scene, threads=1).run().state


def far_down(state: State, length: float) -> tuple[float, float, float]:
    """Thickness [m], mean speed [m/s] and relative error of the profile in `WINDOW`."""
    (x, y), v, mass = state.x.T, state.v[:, 0], state.mass
    here = (x > length - WINDOW[0]) & (x < length - WINDOW[1])
    h = float(mass[here].sum()) / (soft_beads.rho_c * (WINDOW[0] - WINDOW[1]))
    u = float(np.average(v[here], weights=mass[here]))
    miss = v[here] - bagnold_profile(np.minimum(y[here], DEPTH), **STEADY)
    return h, u, float(np.sqrt(np.mean(miss**2))) / bagnold_mean(**STEADY)


@case(_draw_chute)
def chute(quick: bool) -> Outcome:
    """Layer on a chute fed with the flux of the closed form: thickness, speed, profile far down."""
    outcome, length, cells = Outcome(), *((2.0, 8) if quick else (5.0, DEPTH_CELLS))
    mean = bagnold_mean(**STEADY)
    for name in ("default",) if quick else SCHEMES:
        with outcome.timed():
            state = fed(length, cells, SCHEMES[name])
        x, v, mass = state.x[:, 0], state.v[:, 0], state.mass
        width = 0.05 * length
        bins = np.minimum((x / width).astype(int), 19)
        along = np.bincount(bins, mass, 20)
        speed = np.bincount(bins, mass * v, 20) / along / mean
        thick = along / (soft_beads.rho_c * width * DEPTH)
        outcome.curves[name] = [
            ((np.arange(20) + 0.5) * width).tolist(), thick.tolist(), speed.tolist()
        ]  # fmt: skip
        h, u, miss = far_down(state, length)
        tag = f"{name}, {cells} cells"
        outcome.rows += [
            near(f"flux [m2/s], {tag}", h * u, DEPTH * mean, 0.01),
            near(f"thickness [m], {tag}", h, DEPTH, 0.01),
            near(f"mean speed [m/s], {tag}", u, mean, 0.01),
            below(f"rms of the profile over the mean, {tag}", miss, 0.01),
        ]
    return outcome
