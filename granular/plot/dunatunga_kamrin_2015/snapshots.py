"""Figures 2, 4, 6, 7 and 11 of Dunatunga & Kamrin 2015: states side by side.

The functions take states and simulate nothing; the runs are in `benchmarks/figures`.
"""

import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes

from granular import measure
from granular.materials import MuI
from granular.model.state import State
from granular.plot.canvas import Extent, Picture, View, color_bar
from granular.plot.fields import Brush
from granular.plot.frame import Drawing
from granular.plot.mosaic import Panel, mosaic
from granular.tools.checks import one_of

States = Sequence[State]

TOLERANCE = 0.02
"""Relative shortfall of the nodal density that is still shown as dense.

Points at rest never fill the cells evenly.
"""


def _rectangular(name: str, columns: Sequence[States]) -> int:
    """Number of states in each column."""
    counts = {len(states) for states in columns}
    if len(counts) != 1 or 0 in counts:
        raise ValueError(
            f"{name} holds {[len(states) for states in columns]} states: "
            "all must hold the same number, at least 1"
        )
    return counts.pop()


def _panel(ax: Axes, state: State, brush: Brush, extent: Extent, title: str) -> None:
    Drawing(ax, state, brush, View(state.dim), extent)
    _dress(ax, title)


def _dress(ax: Axes, title: str) -> None:
    ax.set_title(title, pad=3)
    ax.set(xlabel="", ylabel="")


def _label(axes: Sequence[Sequence[Axes]]) -> None:
    """Names of the axes where they are not repeated: left and below."""
    for row in axes:
        row[0].set_ylabel("y [m]")
    for ax in axes[-1]:
        ax.set_xlabel("x [m]")


def _time(state: State) -> str:
    return f"t = {state.time:.2f} s"


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
    rows = _rectangular("columns", columns)
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
            _panel(axes[row][column], state, rate, extent, head + _time(state))
        last = states[-1]
        _panel(axes[rows][column], last, pressure, extent, head + _time(last))
        for row in (rows - 1, rows):
            _steepest(axes[row][column], last)
    _label(axes)
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
    rows = _rectangular("silos", silos)
    rate = Brush.fitted([state for states in silos for state in states], limits=limits)
    extents = [View(2).extent(states) for states in silos]
    fig, axes, (bar,) = mosaic([[Panel(extent) for extent in extents]] * rows, (rows,))
    for column, (states, extent) in enumerate(zip(silos, extents, strict=True)):
        orifice = states[0].scene.parameters.get("orifice")
        head = "" if orifice is None else f"D = {orifice:g} m, "
        for row, state in enumerate(states):
            _panel(axes[row][column], state, rate, extent, head + _time(state))
    _label(axes)
    color_bar(fig, rate, cax=bar)
    return fig


def figure_6(flat: States, sloped: States, *, limits: tuple[float, float] | None = None) -> Picture:
    """Shear rate in hourglasses with a flat and a sloped divider.

    Parameters
    ----------
    flat, sloped : sequence of State
        The same number of states for each, in the order of time (0, 1, 2 and 5 s in the paper).
    limits : (low, high), optional
        Limits of the shear rate [1/s].

    Raises
    ------
    ValueError
        If their numbers differ.
    """
    return _hourglasses(flat, sloped, Brush.fitted([*flat, *sloped], limits=limits))


def figure_7(
    flat: States, sloped: States, *, by: str = "nodal_density", tolerance: float = TOLERANCE
) -> Picture:
    """Dense and disconnected points in the hourglasses of `figure_6`.

    Parameters
    ----------
    flat, sloped : sequence of State
    by : {"nodal_density", "stress"}
        Criterion for dense points: their nodal density compared with rho_c, as in the paper (see
        `granular.measure.phase`), or that they are under pressure. Points that fell onto a heap lie
        unevenly, with a density that varies by some 7 % from node to node. By the nodal density
        such a heap therefore has disconnected points although all of it is under stress.
    tolerance : float
        Relative shortfall of the nodal density that still counts as dense.

    Raises
    ------
    ValueError
        If their numbers differ, or `by` is neither of the two.
    """
    one_of("by", by, ("nodal_density", "stress"))
    if by == "stress":
        return _hourglasses(flat, sloped, Brush.fitted([], "dense"))
    phase = [measure.phase(state, tolerance=tolerance).astype(float) for state in (*flat, *sloped)]
    return _hourglasses(flat, sloped, Brush.fitted([], "phase"), phase)


def _hourglasses(
    flat: States, sloped: States, brush: Brush, values: Sequence[Any] | None = None
) -> Picture:
    """Draw the flat hourglass in two rows, and the sloped one in the row below.

    `values` replace the field of the brush, state by state.
    """
    count = _rectangular("(flat, sloped)", (flat, sloped))
    half = (count + 1) // 2
    groups = [flat[:half], flat[half:], sloped] if count > 1 else [flat, sloped]
    wide, narrow = View(2).extent(flat), View(2).extent(sloped)
    shapes = [[Panel(narrow if group is sloped else wide)] * len(group) for group in groups]
    fig, axes, (bar,) = mosaic(shapes, (len(groups),))
    extents = [wide] * count + [narrow] * count
    brushes = [brush] * 2 * count if values is None else map(brush.with_values, values)
    panels = (ax for row in axes for ax in row)
    for ax, state, painter, extent in zip(panels, (*flat, *sloped), brushes, extents, strict=True):
        _panel(ax, state, painter, extent, _time(state))
    _label(axes)
    color_bar(fig, brush, cax=bar)
    return fig


def figure_11(flight: States, impact: States, heap: State) -> Picture:
    """A slug of initially stress-free material: its flight, its impact on the wall, its heap.

    Parameters
    ----------
    flight : sequence of State
        States drawn into one panel, with the parabola of the centre of mass from the first state.
    impact : sequence of State
        States drawn in one panel each, enlarged where the material meets the right wall and becomes
        denser.
    heap : State
        State at rest.

    Returns
    -------
    Picture
        Points are coloured by the nodal density (section 4.3); the colour bar marks rho_c.

    Raises
    ------
    ValueError
        If there is no state of the flight or the impact.
    """
    if not flight or not impact:
        raise ValueError("flight and impact must hold at least 1 state each")
    rho_c = heap.scene.material.rho_c
    brush = Brush.fitted([], "nodal_density", limits=(0.75 * rho_c, 1.05 * rho_c))
    view, half = View(2), (len(impact) + 1) // 2
    whole, last = view.extent([*flight, *impact, heap]), view.extent([heap])
    zoom = _near_wall(impact, whole)
    near = Panel(zoom, zoom=_tall(whole) / _tall(zoom))
    fig, axes, (bar,) = mosaic(
        [[Panel(whole), *[near] * half], [*[near] * (len(impact) - half), Panel(last)]], (2,)
    )
    (first, *upper), (*lower, end) = axes
    for state in flight:
        Drawing(first, state, brush, view, whole)
    _parabola(first, flight[0], flight[-1].time)
    _dress(first, "t = " + ", ".join(f"{state.time:.2f}" for state in flight) + " s")
    for ax, state in zip([*upper, *lower], impact, strict=True):
        _panel(ax, state, brush, zoom, _time(state))
    _panel(end, heap, brush, last, _time(heap))
    _label(axes)
    color_bar(fig, brush, cax=bar)
    bar.axhline(rho_c, color="black", linewidth=1.2)
    across = bar.get_yaxis_transform()
    bar.text(0.5, rho_c, r"$\rho_c$", transform=across, ha="center", va="bottom")
    return fig


def _tall(extent: Extent) -> float:
    return extent[1][1] - extent[1][0]


def _parabola(ax: Axes, start: State, until: float) -> None:
    """Draw the path of a point mass under the gravity at the start."""
    mass = start.mass / start.mass.sum()
    x, v = mass @ start.x, mass @ start.v
    t = np.linspace(0.0, until - start.time, 100)[:, None]
    path = x + v * t + 0.5 * start.scene.gravity.at(start.time) * t**2
    ax.plot(*path.T, color="black", linewidth=1.0, linestyle=(0, (4, 2)), zorder=4)


def _near_wall(states: States, extent: Extent) -> Extent:
    """Extent of the material during the impact on the wall, without the outermost points."""
    x = np.concatenate([state.x for state in states])
    low, high = np.percentile(x, 0.5, axis=0), np.percentile(x, 99.5, axis=0)
    margin = 0.08 * (high - low)
    right = extent[0][1]
    return (float(low[0] - margin[0]), right), (
        max(float(low[1] - margin[1]), extent[1][0]),
        float(high[1] + margin[1]),
    )
