"""Figures 4 and 5: silos that drain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.ticker import LogFormatter

from granular import measure, scenes, theory
from granular.materials import glass_beads
from granular.model.gravity import EARTH
from granular.model.state import State
from granular.papers.dunatunga2015.document import SCHEMES, figure_of_runs
from granular.papers.dunatunga2015.panels import (
    States,
    axes_grid,
    label_axes,
    panel,
    same_count,
    shades,
    time_title,
)
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.plot.canvas import Picture, View, color_bar
from granular.plot.fields import Brush
from granular.plot.mosaic import Panel, mosaic

CELL = 0.01
"""Cells of the document [m]."""
GRAVITY = 9.8


@figure_of_runs(
    "4",
    "silos with openings of 0.10, 0.14 and 0.18 m after 0, 2 and 5 s: shear rate",
    seconds=175.0,
    paper={
        "mass left at 5 s, D = 0.1 m": "over half",
        "mass left at 5 s, D = 0.18 m": "nearly empty",
    },
)
def silos(runs: Runs) -> Drawn:
    """Run three silos to 5 s, and measure the mass that is left."""
    grains, scheme = runs.grains(glass_beads), runs.choose(SCHEMES)
    cell, rows = 0.02 if runs.quick else CELL, []
    numbers: dict[str, float] = {}
    for orifice in (0.10, 0.14, 0.18) if not runs.quick else (0.12, 0.16, 0.20):
        scene = scenes.silo(orifice=orifice, cell=cell, material=grains, scheme=scheme)
        rows.append(runs.states_at(scene, (0.0, 2.0, 5.0), f"D = {orifice:g} m"))
        first, last = (float(rows[-1][k].mass.sum()) for k in (0, -1))
        numbers[f"mass left at 5 s, D = {orifice:g} m"] = last / first
    return Drawn({"": figure_4(rows)}, numbers)


@figure_of_runs(
    "5",
    "mass left in silos over time, and the rate of discharge against the opening",
    seconds=145.0,
    paper={
        "C at the exponent 3/2": 1.42,
        "C with a free exponent": 1.31,
        "free exponent": 1.47,
    },
    E=1e6,  # at 1e7 it takes three times as long
)
def discharge(runs: Runs) -> Drawn:
    """Drain silos until half of their material has left, and fit Beverloo's law.

    The document takes the distance from the first to the last free node for the opening. That is
    the width of the scene plus one cell, since the nodes at both ends of the scene's opening are
    free. Both are fitted.
    """
    grains, scheme = runs.grains(glass_beads), runs.choose(SCHEMES)
    orifices = (0.12, 0.16, 0.20) if runs.quick else np.arange(6, 21, 2) / 100
    cell, histories = 0.02 if runs.quick else CELL, {}
    for orifice in orifices:
        scene = scenes.silo(orifice=float(orifice), cell=cell, material=grains, scheme=scheme)
        # Long enough for 600 kg to leave at two thirds of the rate of the document.
        rate = theory.beverloo_rate(orifice, grains.rho_c, gravity=GRAVITY)
        until = min(scene.duration, 0.5 + 600 / (0.67 * float(rate)))
        times, mass = np.array(runs.frames(scene, until, 1 / 60, mass_left, f"D = {orifice:g} m")).T
        histories[float(orifice)] = measure.MassHistory(times, 2 * mass, 0.5)
    rates = [measure.discharge(history).rate for history in histories.values()]
    rho = grains.rho_c
    widths = np.array(list(histories))
    by_nodes, by_width = (
        measure.beverloo(D, rates, rho=rho, gravity=GRAVITY) for D in (widths + cell, widths)
    )
    few = {d: h for d, h in histories.items() if runs.quick or round(100 * d) % 4 == 2}
    numbers = beverloo_numbers(by_nodes)
    numbers |= {f"{name}, by the width of the scene": n for name, n in
                beverloo_numbers(by_width).items()}  # fmt: skip
    pictures = {
        "": figure_5(few, by_nodes, rho=rho, gravity=GRAVITY),
        "by_width": figure_5(few, by_width, rho=rho, gravity=GRAVITY),
    }
    return Drawn(pictures, numbers)


def beverloo_numbers(fit: measure.BeverlooFit) -> dict[str, float]:
    """Numbers of a fit of Beverloo's law."""
    return {
        "C at the exponent 3/2": fit.C,
        "C with a free exponent": fit.C_free,
        "free exponent": fit.exponent_free,
    }


def mass_left(state: State) -> tuple[float, float]:
    """Time [s] and mass in the half silo [kg/m]."""
    return state.time, float(state.mass.sum())


def figure_4(silos: Sequence[States], *, limits: tuple[float, float] | None = None) -> Picture:
    """Shear rate in silos that drain through orifices of different sizes.

    Parameters
    ----------
    silos : sequence of sequences of State
        For each orifice (0.10, 0.14 and 0.18 m in the paper) the states in the order of time (0, 2
        and 5 s).
    limits : (low, high), optional
        Limits of the shear rate [1/s].

    Raises
    ------
    ValueError
        If the silos do not hold the same number of states.
    """
    rows = same_count("silos", silos)
    rate = Brush.fitted([state for states in silos for state in states], limits=limits)
    extents = [View(2).extent(states) for states in silos]
    fig, axes, (bar,) = mosaic([[Panel(extent) for extent in extents]] * rows, (rows,))
    for column, (states, extent) in enumerate(zip(silos, extents, strict=True)):
        orifice = states[0].scene.parameters.get("orifice")
        head = "" if orifice is None else f"D = {orifice:g} m, "
        for row, state in enumerate(states):
            panel(axes[row][column], state, rate, extent, head + time_title(state))
    label_axes(axes)
    color_bar(fig, rate, cax=bar)
    return fig


def figure_5(
    histories: Mapping[float, measure.MassHistory],
    fit: measure.BeverlooFit,
    *,
    rho: float,
    gravity: float = EARTH,
    window: tuple[float, float] = (1200.0, 900.0),
) -> Picture:
    """Silos: remaining mass over time, and rate against orifice with Beverloo's law.

    Parameters
    ----------
    histories : mapping of float to MassHistory
        Histories by the width of the orifice [m]; a few representative ones.
    fit : BeverlooFit
        The fit, with all orifices and rates.
    rho, gravity : float
        Bulk density [kg/m3] and gravity [m/s2] of the fit.
    window : (float, float)
        Mass in the full silo [kg] between which the rates were taken (section 4.2).
    """
    fig, ((left, right),) = axes_grid(2)
    left.axhspan(*sorted(window), color="0.9", label="steady flow")
    for (orifice, history), shade in zip(
        sorted(histories.items()), shades(len(histories)), strict=True
    ):
        left.plot(history.times, history.mass, color=shade, label=f"D = {100 * orifice:.3g} cm")
    left.set(xlabel="time [s]", ylabel="mass in the silo [kg/m]", ylim=(0.0, None))
    left.legend()
    along = np.geomspace(0.9 * fit.orifices.min(), 1.1 * fit.orifices.max(), 50)
    law = theory.beverloo_rate(along, rho, C=fit.C, gravity=gravity)
    free = theory.beverloo_rate(
        along, rho, C=fit.C_free, gravity=gravity, exponent=fit.exponent_free
    )
    paper = theory.beverloo_rate(along, rho, gravity=gravity)
    right.plot(along, paper, color="0.7", linewidth=3, label="paper, C = 1.42, 3/2")
    right.plot(along, law, color="black", label=f"C = {fit.C:.3f}, 3/2")
    right.plot(
        along, free, "--", color="C0", label=f"C = {fit.C_free:.3f}, {fit.exponent_free:.3f}"
    )
    right.plot(fit.orifices, fit.rates, "o", color="C3", label="measured")
    right.set(xscale="log", yscale="log", xlabel="orifice D [cm]", ylabel="rate [kg/(s m)]")
    right.set_xticks(
        fit.orifices, labels=[f"{100 * d:.3g}" for d in fit.orifices], fontsize="small"
    )
    right.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
    for axis in (right.yaxis.set_major_formatter, right.yaxis.set_minor_formatter):
        axis(LogFormatter(labelOnlyBase=False, minor_thresholds=(2, 0.5)))
    right.legend(loc="lower right")
    return fig
