"""Figure 5.2: slopes that remain after material has left a box through an orifice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from granular import plot, scenes
from granular.model.state import State
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.errors import standard_error
from granular.papers.hurley_thesis.sph_measures import BETAS, packed, slope_deg, surface_line
from granular.papers.runs import Runs
from granular.plot.canvas import Picture, View
from granular.sph import Scene

PHIS = (20.0, 25.0, 30.0, 35.0, 40.0)
"""Angles of friction [deg]."""
PACKINGS = 3
"""Packings over which angles are averaged: one alone is known to half a degree."""
DURATION = {"quick": 5.0, "normal": 10.0, "full": 16.0}
"""Time with the orifice open [s]; slopes do not change after 8 s."""
EVERY, MEAN = 0.25, 1.1
"""Time between two samples of the slope, and the last time over which they are averaged [s]."""


@dataclass(frozen=True)
class Slope:
    """Slope of one packing: its angle [deg], and the states at the opening and at the end."""

    angle_deg: float
    start: State
    end: State


def below(phi: float) -> dict[str, str]:
    """Statements of the thesis on the slopes of an angle of friction."""
    words = (f"slightly below {phi:g}", f"near {phi:g}") if phi <= 30 else ("deviates",) * 2
    return {
        f"slope at phi = {phi:g} deg, {name} [deg]": text
        for name, text in zip(BETAS, words, strict=True)
    }


@PAPER.figure(
    "5.2",
    "slopes left by material that flows out of a box, against the angle of friction; pressure",
    seconds=500.0,
    paper={name: text for phi in PHIS for name, text in below(phi).items()}
    | {"pressure of the lowest layer over that of the second": "slightly below 1"},
)
def repose(runs: Runs) -> Drawn:
    """Open the orifice of boxes of all angles of friction, and average over several packings.

    In 2D; in full size in 3D with the period of the thesis, 6 cm.
    """
    phis, packings = (PHIS, PACKINGS) if not runs.quick else ((20.0, 30.0), 1)
    slopes = {
        (phi, name): [slope_of(runs, box(runs, phi, beta, seed)) for seed in range(packings)]
        for phi in phis
        for name, beta in BETAS.items()
    }
    numbers: dict[str, Number] = {}
    for (phi, name), many in slopes.items():
        angles = [one.angle_deg for one in many]
        numbers[f"slope at phi = {phi:g} deg, {name} [deg]"] = float(np.mean(angles))
        numbers[f"standard error at phi = {phi:g} deg, {name} [deg]"] = standard_error(angles)
    drawn = slopes[30.0, "no dilation"]
    ratios = [lowest_pressure(one.end) for one in drawn]
    numbers["pressure of the lowest layer over that of the second"] = float(np.mean(ratios))
    return Drawn({"": figure_5_2(drawn[0], slopes)}, numbers)


def box(runs: Runs, phi: float, beta: float, seed: int) -> Scene:
    """A box with one packing of the particles."""
    scene = scenes.slump_sph(
        phi_deg=phi,
        dilation=beta,
        width=0.06 if runs.full else 0.0,
        duration=DURATION[runs.settings.size],
        spacing=0.02 if runs.quick else 0.01,
        orifice=0.06 if runs.quick else 0.05,  # whole spacings
    )
    return packed(scene, seed)


def slope_of(runs: Runs, scene: Scene) -> Slope:
    """Run a box, and average the slope over the last second."""
    phi, beta = scene.parameters["phi_deg"], scene.material.dilation
    name = f"phi = {phi:g} deg, beta up to {beta:g}, packing {scene.seed + 1}"
    states = runs.frames(scene, scene.duration, EVERY, lambda state: state, name)
    angles = [slope_deg(state) for state in states if state.time > scene.duration - MEAN]
    settle = float(scene.parameters["settle"])
    start = next(state for state in states if state.time >= settle)
    return Slope(float(np.mean(angles)), start, states[-1])


def lowest_pressure(state: State) -> float:
    """Pressure of the particles of the lowest layer divided by that of the second layer."""
    cell, parameters = state.scene.grid.cell, state.scene.parameters
    within = state.x[:, 0] < float(parameters["length"]) - 2 * float(parameters["orifice"])
    rows = [within & (np.floor(state.x[:, -1] / cell) == k) for k in (0, 1)]
    lowest, second = (float(state.pressure[row].mean()) for row in rows)
    return lowest / second


# ---- drawing ----


def figure_5_2(shown: Slope, slopes: Mapping[tuple[float, str], Sequence[Slope]]) -> Picture:
    """Box before and after, slopes against the angle of friction, and pressure at the end.

    The colours of the first two panels are the heights of the particles before the opening.
    """
    picture = Picture(figsize=(9.0, 7.4), layout="compressed")
    (before, after), (angles, pressure) = picture.subplots(2, 2)
    heights = np.zeros(int(shown.start.id.max()) + 1)
    heights[shown.start.id] = shown.start.x[:, -1]
    extent = View(2).extent([shown.start, shown.end])
    for ax, state, title in (
        (before, shown.start, "(a) before the orifice opens"),
        (after, shown.end, "(b) at the end"),
    ):
        plot.frame(
            state, heights[state.id], ax=ax, extent=extent, limits=(0.0, heights.max()), bar=False,
            title=title,
        )  # fmt: skip
    slope, intercept = surface_line(shown.end)
    parameters = shown.end.scene.parameters
    floor = float(parameters["length"]) - float(parameters["orifice"])
    x = np.array([floor / 8, 7 * floor / 8])
    after.plot(x, slope * x + intercept, color="C3", linewidth=1.5, zorder=5)
    after.text(x.mean(), slope * x.mean() + intercept + 0.04, f"{shown.angle_deg:.1f}°", color="C3")
    draw_angles(angles, slopes)
    plot.frame(shown.end, "pressure", ax=pressure, title="(d) pressure at the end")
    return picture


def draw_angles(ax: Axes, slopes: Mapping[tuple[float, str], Sequence[Slope]]) -> None:
    """Mean slopes against the angle of friction; bars are standard errors of the means."""
    phis = sorted({phi for phi, _ in slopes})
    ax.plot(phis, phis, "o--", color="black", fillstyle="none", linewidth=1.0, label="slope = phi")
    for name, marker, color in zip(BETAS, "sv", ("C0", "C3"), strict=True):
        angles = [[one.angle_deg for one in slopes[phi, name]] for phi in phis]
        means, bars = [np.mean(a) for a in angles], [standard_error(a) for a in angles]
        ax.errorbar(phis, means, bars, fmt=marker, color=color, capsize=2, label=name)
    ax.set(xlabel="angle of friction phi [deg]", ylabel="slope [deg]", title="(c)")
    ax.legend()
