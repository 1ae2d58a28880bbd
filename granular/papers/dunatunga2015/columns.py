"""Figures 2 and 3, table 3: columns that collapse to heaps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from granular import measure, scenes, theory
from granular.materials import MuI, glass_beads
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
from granular.papers.figure import Drawn, Number, labelled
from granular.papers.runs import Runs
from granular.plot.canvas import MARKERS, Picture, View, color_bar
from granular.plot.fields import Brush
from granular.plot.mosaic import Panel, mosaic

OTHERS: dict[str, Any] = {
    "lube": "-.",
    "lagree": ":",
    "staron": "--",
    "mast": (0, (5, 1, 1, 1, 1, 1)),
}
"""Lines of the other laws of table 3."""
ASPECTS = (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
TRANSITION = 2.83
"""Aspect ratio of the transition between the two regimes (table 3)."""


@figure_of_runs(
    "2",
    "columns of aspect 2, 1 and 0.5 at three times: shear rate, and pressure at the end",
    seconds=30.0,
    paper={f"mean slope at a = {aspect:g} [deg]": "below 20.9" for aspect in (2.0, 1.0, 0.5)}
    | {
        f"pressure on the axis over the largest on the floor, a = {a:g}": "a dip"
        for a in (2.0, 1.0)
    },
)
def collapses(runs: Runs) -> Drawn:
    """Run three columns to 2 s, and measure the slopes and the pressure on the floor."""
    scheme, grains = runs.choose(SCHEMES), runs.grains(glass_beads)
    cell = 0.02 if runs.quick else None
    columns: list[list[State]] = []
    numbers: dict[str, float] = {}
    for aspect in (2.0, 1.0, 0.5):
        scene = scenes.column_collapse(aspect=aspect, cell=cell, material=grains, scheme=scheme)
        columns.append(runs.states_at(scene, (0.0, 0.5, 2.0), f"a = {aspect:g}"))
        last = columns[-1][-1]
        numbers[f"mean slope at a = {aspect:g} [deg]"] = measure.repose_angle(last).mean_deg
        axis, largest = floor_pressure(last)
        numbers[f"pressure on the axis over the largest on the floor, a = {aspect:g}"] = (
            axis / largest
        )
    return Drawn({"": figure_2(columns)}, numbers)


def floor_pressure(state: State) -> tuple[float, float]:
    """Smoothed pressure [Pa] in the lowest row of cells: next to the axis, and the largest."""
    cell = state.scene.grid.cell
    pressure = measure.smooth(state, "pressure")
    low = state.x[:, 1] < cell
    column = (state.x[low, 0] / cell).astype(int)
    mass, weighted = (
        np.bincount(column, weights=w) for w in (state.mass[low], state.mass[low] * pressure[low])
    )
    means = weighted[mass > 0] / mass[mass > 0]
    return float(means[0]), float(means.max())


def of_both_schemes(numbers: Mapping[str, Number]) -> dict[str, Number]:
    """The same numbers of the document for the runs with each scheme."""
    return labelled(dict.fromkeys(("published scheme", "default scheme"), numbers))


@figure_of_runs(
    "3",
    "run-out over half-width against the aspect ratio, with the laws of table 3",
    seconds=195.0,
    paper=of_both_schemes(
        {
            "exponent below a = 2.83": 1.00,
            "exponent above": 0.66,
            "run-out at a = 1": 2.28,
            "run-out at a = 4": 8.09,
        }
    ),
    schemes=(),  # it has both
)
def runouts(runs: Runs) -> Drawn:
    """Run columns with both schemes, and fit the exponents of both regimes."""
    aspects = (0.5, 1.0, 2.0, 4.0, 6.0) if runs.quick else ASPECTS
    measured = measured_runouts(runs, aspects)
    numbers = labelled({name: fits(aspects, values) for name, values in measured.items()})
    return Drawn({"": figure_3(aspects, measured)}, numbers)


@figure_of_runs(
    "table_3",
    "coefficients and exponents of the run-out in both regimes",
    seconds=195.0,
    paper=of_both_schemes(
        {
            "exponent below a = 2.83": 1.00,
            "coefficient below": 2.28,
            "exponent above": 0.66,
            "coefficient above": 3.24,
        }
    ),
    schemes=(),  # it has both
)
def table_3(runs: Runs) -> Drawn:
    """Numbers of figure 3 alone."""
    return Drawn({}, runouts(runs).numbers)


def measured_runouts(runs: Runs, aspects: Sequence[float]) -> dict[str, list[measure.Runout]]:
    """Run-outs of the columns by scheme."""
    grains, cell = runs.grains(glass_beads), 0.02 if runs.quick else None
    measured: dict[str, list[measure.Runout]] = {}
    for key in ("published", "default"):
        for aspect in aspects:
            scene = scenes.column_collapse(
                aspect=aspect, cell=cell, material=grains, scheme=SCHEMES[key]
            )
            name = f"{key} scheme"
            (last,) = runs.states_at(scene, (scene.duration,), f"{name}, a = {aspect:g}")
            measured.setdefault(name, []).append(measure.runout(last))
    return measured


def fits(aspects: Sequence[float], values: Sequence[measure.Runout]) -> dict[str, float]:
    """Power laws of the run-out below and above the transition, and two of the run-outs."""
    a, r = np.array(aspects), np.array([value.quantile for value in values])
    numbers: dict[str, float] = {}
    for side, chosen in (("below", a < TRANSITION), ("above", a > TRANSITION)):
        exponent, log = np.polyfit(np.log(a[chosen]), np.log(r[chosen]), 1)
        at = f" a = {TRANSITION:g}" if side == "below" else ""
        numbers |= {f"exponent {side}{at}": float(exponent)}
        numbers |= {f"coefficient {side}": float(np.exp(log))}
    return numbers | {f"run-out at a = {k:g}": float(r[a == k][0]) for k in (1.0, 4.0)}


def figure_2(columns: Sequence[States], *, limits: tuple[float, float] | None = None) -> Picture:
    """Column collapses: shear rate over time, and pressure at the end.

    Parameters
    ----------
    columns : sequence of sequences of State
        For each aspect ratio the states in the order of time (0, 0.5 and 2 s in the paper).
    limits : (low, high), optional
        Limits of the shear rate [1/s].

    Returns
    -------
    Picture
        One column of panels per aspect ratio, each with its own scale of lengths. The last row
        shows the pressure, smoothed over the nodes (eqs. 4.1-4.3). A dotted line rises from the toe
        at the angle atan(mu_s).

    Raises
    ------
    ValueError
        If the columns do not hold the same number of states.
    """
    rows = same_count("columns", columns)
    flat = [state for states in columns for state in states]
    rate = Brush.fitted(flat, "shear_rate", limits=limits)
    pressure = Brush.fitted([states[-1] for states in columns], "pressure", smooth=True)
    extents = [View(2).extent(states) for states in columns]
    widest = max(right - left for (left, right), _ in extents)
    panels = [Panel(e, zoom=widest / (e[0][1] - e[0][0])) for e in extents]
    fig, axes, bars = mosaic([panels] * (rows + 1), (rows, 1))
    for column, (states, extent) in enumerate(zip(columns, extents, strict=True)):
        aspect = states[0].scene.parameters.get("aspect")
        head = "" if aspect is None else f"a = {aspect:g}, "
        for row, state in enumerate(states):
            panel(axes[row][column], state, rate, extent, head + time_title(state))
        last = states[-1]
        panel(axes[rows][column], last, pressure, extent, head + time_title(last))
        for row in (rows - 1, rows):
            _steepest(axes[row][column], last)
    label_axes(axes)
    color_bar(fig, rate, cax=bars[0])
    color_bar(fig, pressure, cax=bars[1])
    return fig


def _steepest(ax: Axes, state: State) -> None:
    """Draw a line at the static angle from the 99.9 % quantile of mass; heaps should be below."""
    toe = 1.0 + measure.runout(state, half_width=1.0).quantile  # m: over a half-width of 1 m
    mu_s = cast(MuI, state.scene.material).mu_s
    top = ax.get_ylim()[1]
    ax.plot([toe, toe - top / mu_s], [0.0, top], color="0.4", linewidth=0.9, linestyle=":")
    text = rf"$\arctan\,\mu_s$ = {math.degrees(math.atan(mu_s)):.1f}°"
    ax.text(0.97, 0.95, text, ha="right", va="top", color="0.3", transform=ax.transAxes)


def figure_3(aspects: ArrayLike, runouts: Mapping[str, Sequence[measure.Runout]]) -> Picture:
    """Run-out against aspect ratio, with the laws of table 3.

    Parameters
    ----------
    aspects : array_like, shape (k,)
        Height divided by half-width.
    runouts : mapping of str to k Runouts
        Run-outs by the name of the set, for example of a scheme. The marker shows the 99.9 %
        quantile of the mass; the bar spans all three measures.

    Raises
    ------
    ValueError
        If there is not one run-out for each aspect ratio.
    """
    aspects = np.asarray(aspects, dtype=float)
    fig, ((ax,),) = axes_grid(1, height=4.4)
    along = np.geomspace(0.8 * aspects.min(), 1.25 * aspects.max(), 200)
    for name, dashes in OTHERS.items():
        law = theory.RUNOUT_LAWS[name]
        ax.plot(along, law(along), linestyle=dashes, color="0.5", linewidth=1.2, label=law.source)
    law = theory.RUNOUT_LAWS["dunatunga"]
    ax.plot(along, law(along), color="black", linewidth=1.8, label=law.source)
    _slopes(ax, law)
    for (name, values), shade, marker in zip(
        runouts.items(), shades(len(runouts)), MARKERS, strict=False
    ):
        if len(values) != len(aspects):
            raise ValueError(
                f"runouts[{name!r}] holds {len(values)}, not {len(aspects)} as aspects"
            )
        ways = np.array([(r.quantile, r.toe, r.contiguous) for r in values])
        value = ways[:, 0]
        bars = (value - np.nanmin(ways, axis=1), np.nanmax(ways, axis=1) - value)
        ax.errorbar(
            aspects, value, bars, fmt=marker, color=shade, markersize=5, capsize=2, label=name
        )
    ax.set(xscale="log", yscale="log", xlabel="aspect ratio a", ylabel="run-out / half-width")
    ax.set_xticks(aspects, labels=[f"{a:g}" for a in aspects])
    ax.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
    ax.legend()
    return fig


def _slopes(ax: Axes, law: theory.RunoutLaw) -> None:
    """Draw the exponents of a source that gives no coefficients, below the run-outs of a law."""
    for key, ends, dashes in (
        ("balmforth_wide", (0.5, TRANSITION), "-"),
        ("balmforth_narrow", (TRANSITION, 8.0), "--"),
    ):
        known = theory.RUNOUT_LAWS[key]
        a, exponent = np.array(ends), known.pieces[0].exponent
        middle = math.sqrt(ends[0] * ends[1])
        below = 0.6 * float(law(middle))
        label = f"{known.source}, {known.method.partition(', ')[2]}: slope {exponent:g}"
        ax.plot(a, below * (a / middle) ** exponent, dashes, color="C4", linewidth=1.2, label=label)
