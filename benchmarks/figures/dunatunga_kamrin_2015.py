"""Figures of Dunatunga & Kamrin (2015): `python benchmarks dunatunga_kamrin_2015 figure_2 --quick`.

2: column collapses of aspect 2, 1 and 0.5. 3: run-out against aspect ratio, of both schemes. 4:
silos with orifices of 0.10, 0.14 and 0.18 m after 0, 2 and 5 s. 5: mass left in silos, and the rate
of discharge against the orifice. 6 and 7: hourglasses after 0, 1, 2 and 5 s, by shear rate and by
phase. 9 and 10: flow down inclines over time, against the angle, and its profile. 11: a
disconnected slug flies, meets a wall, and comes to rest as a heap. 13: the stress update along the
path of appendix B against Runge-Kutta.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

import granular as gr
from figures.common import RUN, SCHEMES, frames, options, save, states_at
from granular.plot import dunatunga_kamrin_2015 as plot
from granular.verify.constitutive import DURATION, STEPS, constitutive_path

P0 = 500.0
"""Pressure at the start of the path of appendix B [Pa]."""
APPENDIX_E = 1e4
"""Young's modulus of appendix B [Pa]."""


def figure_2(chosen: argparse.Namespace) -> None:
    cell, columns = 0.02 if chosen.quick else None, []
    for aspect in (2.0, 1.0, 0.5):
        scene = gr.scenes.column_collapse(aspect=aspect, cell=cell, **chosen.settings)
        name = f"a = {aspect:g}"
        columns.append(states_at(scene, (0.0, 0.5, 2.0), chosen, name=name))
    save(plot.figure_2(columns), chosen, "figure_2")


def figure_3(chosen: argparse.Namespace) -> None:
    aspects = (
        (0.5, 1.0, 2.0, 4.0) if chosen.quick else (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
    )
    cell, runouts = 0.02 if chosen.quick else None, {}
    for key in ("published", "default"):
        name = f"{key} scheme"
        runouts[name] = []
        for aspect in aspects:
            scene = gr.scenes.column_collapse(
                aspect=aspect, cell=cell, scheme=SCHEMES[key], **chosen.settings
            )
            label = f"{name}, a = {aspect:g}"
            (last,) = states_at(scene, (scene.duration,), chosen, name=label)
            runouts[name].append(gr.measure.runout(last))
    save(plot.figure_3(aspects, runouts), chosen, "figure_3")


def figure_4(chosen: argparse.Namespace) -> None:
    cell, silos = 0.02 if chosen.quick else 0.01, []
    for orifice in (0.10, 0.14, 0.18) if not chosen.quick else (0.12, 0.16, 0.20):
        scene = gr.scenes.silo(orifice=orifice, cell=cell, **chosen.settings)
        name = f"D = {orifice:g} m"
        silos.append(states_at(scene, (0.0, 2.0, 5.0), chosen, name=name))
    save(plot.figure_4(silos), chosen, "figure_4")


def left(state: gr.State) -> tuple[float, float]:
    """Time [s] and remaining mass [kg/m]."""
    return state.time, float(state.mass.sum())


def figure_5(chosen: argparse.Namespace) -> None:
    orifices = (0.12, 0.16, 0.20) if chosen.quick else np.arange(6, 21, 2) / 100
    cell, histories = 0.02 if chosen.quick else 0.01, {}
    for orifice in orifices:
        scene = gr.scenes.silo(orifice=float(orifice), cell=cell, **chosen.settings)
        # Long enough for 600 kg to leave at two thirds of the rate of the paper.
        rate = gr.theory.beverloo_rate(orifice, chosen.material.rho_c, gravity=9.8)
        until = min(scene.duration, 0.5 + 600 / (0.67 * float(rate)))
        name = f"D = {orifice:g} m"
        times, mass = np.array(frames(scene, until, 1 / 60, left, chosen, name=name)).T
        histories[float(orifice)] = gr.measure.MassHistory(times, 2 * mass, 0.5)
    rates = [gr.measure.discharge(history).rate for history in histories.values()]
    unit = {"rho": chosen.material.rho_c, "gravity": 9.8}
    fit = gr.measure.beverloo(list(histories), rates, **unit)
    chosen_depths = {d: h for d, h in histories.items() if chosen.quick or round(100 * d) % 4 == 2}
    save(plot.figure_5(chosen_depths, fit, **unit), chosen, "figure_5")


def figures_6_7(chosen: argparse.Namespace) -> None:
    widths = {"flat": 0.96, "sloped": 0.48} if chosen.quick else {"flat": None, "sloped": None}
    cell, fill = (0.02, 0.24) if chosen.quick else (0.01, 0.25)
    runs = []
    for kind, width in widths.items():
        scene = gr.scenes.hourglass(
            kind=kind, width=width, cell=cell, fill_height=fill, **chosen.settings
        )
        runs.append(states_at(scene, (0.0, 1.0, 2.0, 5.0), chosen))
    save(plot.figure_6(*runs), chosen, "figure_6")
    save(plot.figure_7(*runs), chosen, "figure_7")
    save(plot.figure_7(*runs, by="stress"), chosen, "figure_7_stress")


def figures_9_10(chosen: argparse.Namespace) -> None:
    angles = (19, 22, 25, 28, 31, 34) if chosen.quick else range(19, 35)
    until, cell = (2.0, 0.01) if chosen.quick else (20.0, 0.005)

    def scene(angle: float) -> gr.Scene:
        return gr.scenes.incline(angle_deg=float(angle), cell=cell, **chosen.settings)

    flows = []
    for angle in angles:
        states = frames(scene(angle), until, until / 100, lambda s: s, chosen, name=f"{angle} deg")
        flows.append(plot.InclineFlow.measured(states))
    (state,) = states_at(scene(25), (3 * until,), chosen, name="profile at 25 deg")
    grains = chosen.material
    chosen_flows = [flow for flow in flows if flow.angle_deg in (19, 22, 25, 28, 31, 34)]
    save(plot.figure_9(chosen_flows, mu_s=grains.mu_s, mu_2=grains.mu_2), chosen, "figure_9")
    save(plot.figure_10(flows, state), chosen, "figure_10")


def figure_11(chosen: argparse.Namespace) -> None:
    # The paper gives cells of 0.0083 m, 120 to a metre, but no size: here a box of 1 m, so that
    # the heap ends before the left wall; the distance to the right wall is as in the scene.
    cell = 0.025 if chosen.quick else 0.0083
    scene = gr.scenes.slug(center=(0.45, 0.25), wall_at=1.0, cell=cell, **chosen.settings)
    flight, impact = (0.0, 0.1, 0.2, 0.3), (0.34, 0.36, 0.38, 0.40, 0.42, 0.48)
    states = states_at(scene, (*flight, *impact, scene.duration), chosen)
    parts = states[: len(flight)], states[len(flight) : -1], states[-1]
    save(plot.figure_11(*parts), chosen, "figure_11")


def path_of(material: gr.materials.MuI, dt: float) -> plot.ConstitutivePath:
    """Path of appendix B with this time step."""
    times, stress = constitutive_path(material, P0, dt)
    p = -stress[:, :3].sum(axis=1) / 3
    deviator = stress[:, :3] + p[:, None]
    tau = np.sqrt((deviator**2).sum(axis=1) / 2 + stress[:, 3] ** 2)
    rate = gr.theory.plastic_shear_rate(p, tau, material)
    return plot.ConstitutivePath(dt, times, stress, rate)


def figure_13(chosen: argparse.Namespace) -> None:
    paths = [path_of(chosen.material, dt) for dt in (STEPS[:3] if chosen.quick else STEPS)]
    finest = min(paths, key=lambda path: path.dt)
    times = np.linspace(0.0, DURATION, len(finest.times))
    exact = gr.theory.reference(chosen.material, P0, times)
    save(plot.figure_13(paths, exact), chosen, "figure_13")


FIGURES: dict[str, tuple[Callable[[argparse.Namespace], None], dict[str, Any]]] = {
    "figure_5": (figure_5, {"E": 1e6}),  # five minutes; 1e7 takes three times as long
    "figure_3": (figure_3, {"without": ("scheme",)}),
    "figure_4": (figure_4, {}),
    "figures_6_7": (figures_6_7, {}),
    "figure_2": (figure_2, {}),
    "figures_9_10": (figures_9_10, {}),
    "figure_11": (figure_11, {}),
    "figure_13": (figure_13, {"E": APPENDIX_E, "quick_E": APPENDIX_E, "without": RUN}),
}
"""Figures and their options, the longest first, so that no worker of `paper_in_half_an_hour` waits
long for the other at the end."""


def main(argv: list[str] | None = None) -> None:
    """Draw the figure that comes first on the command line."""
    first, *rest = (sys.argv[1:] if argv is None else argv) or [""]
    if first not in FIGURES:
        raise SystemExit(f"the figure {first!r} must be one of {', '.join(FIGURES)}")
    draw, given = FIGURES[first]
    draw(options(f"{first} of the paper", rest, **given))
