"""Figures 2, 4, 6, 7 and 11 of Dunatunga & Kamrin 2015: states side by side.

Each takes states and simulates nothing; `benchmarks/figures` has the runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from granular import measure
from granular.plot.canvas import Extent, Picture, View, color_bar
from granular.plot.fields import Brush
from granular.plot.frame import draw

__all__ = ["figure_2", "figure_4", "figure_6", "figure_7", "figure_11"]

States = Sequence[Any]

WIDTH, HEIGHT = 10.0, 12.0
"""Of a figure [inches], at most."""
TOLERANCE = 0.02
"""Shortfall of the nodal density still shown as dense: points at rest never fill cells evenly."""


def _rectangular(name: str, columns: Sequence[States]) -> int:
    """Number of states in each column."""
    counts = {len(states) for states in columns}
    if len(counts) != 1 or 0 in counts:
        raise ValueError(
            f"{name} holds {[len(states) for states in columns]} states: "
            "all must hold the same number, at least 1"
        )
    return counts.pop()


def _size(extent: Extent) -> tuple[float, float]:
    return extent[0][1] - extent[0][0], extent[1][1] - extent[1][0]


def _mosaic(
    rows: Sequence[Sequence[Extent]], bars: Sequence[int]
) -> tuple[Picture, list[list[Axes]], list[Axes]]:
    """Axes at one scale for all, row by row, and one for each colour bar at the right.

    `bars` are the numbers of rows that share a bar, from the top.
    """
    gap, head, left, right, bottom = 0.5, 0.32, 0.65, 1.25, 0.55
    scale = min(
        (WIDTH - left - right - gap * (len(row) - 1)) / sum(_size(extent)[0] for extent in row)
        for row in rows
    )
    rest = len(rows) * head + (len(rows) - 1) * 0.25 + bottom
    scale = min(scale, (HEIGHT - rest) / sum(max(_size(e)[1] for e in row) for row in rows))
    tall = [scale * max(_size(extent)[1] for extent in row) for row in rows]
    height = sum(tall) + rest
    used = max(
        scale * sum(_size(extent)[0] for extent in row) + gap * (len(row) - 1) for row in rows
    )
    total = left + used + right
    fig = Picture(figsize=(total, height))

    def place(x: float, y: float, width: float, up: float) -> Axes:
        return fig.add_axes((x / total, y / height, width / total, up / height))

    axes, floors, top = [], [], height
    for row, up in zip(rows, tall, strict=True):
        top -= head + up
        x, placed = left, []
        for extent in row:
            width, size = (scale * length for length in _size(extent))
            placed.append(place(x, top, width, size))
            x += width + gap
        axes.append(placed)
        floors.append(top)
        top -= 0.25
    ends = np.cumsum(bars)
    return (
        fig,
        axes,
        [
            place(
                total - right + 0.2,
                floors[end - 1],
                0.16,
                floors[end - count] + tall[end - count] - floors[end - 1],
            )
            for count, end in zip(bars, ends, strict=True)
        ],
    )


def _panel(ax: Axes, state: Any, brush: Brush, extent: Extent, title: str) -> Any:
    points = draw(ax, state, brush, View(state.dim), extent)
    _dress(ax, title)
    return points.artist


def _dress(ax: Axes, title: str) -> None:
    ax.set_title(title, fontsize="small", pad=3)
    ax.tick_params(labelsize="x-small")
    ax.set(xlabel="", ylabel="")


def _label(axes: Sequence[Sequence[Axes]]) -> None:
    """Names of the axes where they are not repeated: left and below."""
    for row in axes:
        row[0].set_ylabel("y [m]", fontsize="small")
    for ax in axes[-1]:
        ax.set_xlabel("x [m]", fontsize="small")


def _time(state: Any) -> str:
    return f"t = {state.time:.2f} s"


def figure_2(columns: Sequence[States], *, limits: tuple[float, float] | None = None) -> Picture:
    """Column collapses: the shear rate over time, and the pressure at the end.

    Parameters
    ----------
    columns : sequence of sequences of State
        For each aspect ratio the states in the order of time (0, 0.5 and 2 s in the paper).
    limits : (low, high), optional
        Of the shear rate [1/s].

    Returns
    -------
    Picture
        One column an aspect ratio; the last row is the pressure, smoothed by the nodes
        (eqs. 4.1-4.3).

    Raises
    ------
    ValueError
        If the columns do not hold the same number of states.
    """
    rows = _rectangular("columns", columns)
    flat = [state for states in columns for state in states]
    rate = Brush.fitted(flat, "shear_rate", limits=limits)
    pressure = Brush.fitted([states[-1] for states in columns], "p", smooth=True)
    extents = [View(2).extent(states) for states in columns]
    fig, axes, bars = _mosaic([extents] * (rows + 1), (rows, 1))
    for column, (states, extent) in enumerate(zip(columns, extents, strict=True)):
        aspect = states[0].scene.parameters.get("aspect")
        head = "" if aspect is None else f"a = {aspect:g}, "
        for row, state in enumerate(states):
            shown = _panel(axes[row][column], state, rate, extent, head + _time(state))
        last = states[-1]
        pressed = _panel(axes[rows][column], last, pressure, extent, head + _time(last))
    _label(axes)
    color_bar(fig, shown, rate, cax=bars[0])
    color_bar(fig, pressed, pressure, cax=bars[1])
    return fig


def figure_4(silos: Sequence[States], *, limits: tuple[float, float] | None = None) -> Picture:
    """Silos that drain through orifices of different sizes: the shear rate.

    Parameters
    ----------
    silos : sequence of sequences of State
        For each orifice (0.10, 0.14 and 0.18 m in the paper) the states in the order of time (0, 2
        and 5 s).
    limits : (low, high), optional
        Of the shear rate [1/s].

    Raises
    ------
    ValueError
        If the silos do not hold the same number of states.
    """
    rows = _rectangular("silos", silos)
    rate = Brush.fitted([state for states in silos for state in states], limits=limits)
    extents = [View(2).extent(states) for states in silos]
    fig, axes, (bar,) = _mosaic([extents] * rows, (rows,))
    for column, (states, extent) in enumerate(zip(silos, extents, strict=True)):
        orifice = states[0].scene.parameters.get("orifice")
        head = "" if orifice is None else f"D = {orifice:g} m, "
        for row, state in enumerate(states):
            shown = _panel(axes[row][column], state, rate, extent, head + _time(state))
    _label(axes)
    color_bar(fig, shown, rate, cax=bar)
    return fig


def figure_6(flat: States, sloped: States, *, limits: tuple[float, float] | None = None) -> Picture:
    """Hourglasses with a flat and a sloped divider: the shear rate.

    Parameters
    ----------
    flat, sloped : sequence of State
        Equally many each, in the order of time (0, 1, 2 and 5 s in the paper).
    limits : (low, high), optional
        Of the shear rate [1/s].

    Raises
    ------
    ValueError
        If they are not equally many.
    """
    return _hourglasses(flat, sloped, Brush.fitted([*flat, *sloped], limits=limits))


def figure_7(flat: States, sloped: States, *, tolerance: float = TOLERANCE) -> Picture:
    """Hourglasses as in `figure_6`: which points are dense and which disconnected.

    By the nodal density, see `granular.measure.phase`; `tolerance` is its relative shortfall that
    still counts as dense.
    """
    brush = Brush.fitted([], "phase")
    phase = [
        [measure.phase(state, tolerance=tolerance).astype(float) for state in states]
        for states in (flat, sloped)
    ]
    return _hourglasses(flat, sloped, brush, phase)


def _hourglasses(
    flat: States, sloped: States, brush: Brush, values: Sequence[Sequence[Any]] | None = None
) -> Picture:
    """The flat one in two rows, below it the sloped one in as many columns."""
    count = _rectangular("(flat, sloped)", (flat, sloped))
    half = (count + 1) // 2
    groups = [flat[:half], flat[half:], sloped] if count > 1 else [flat, sloped]
    wide, narrow = View(2).extent(flat), View(2).extent(sloped)
    shapes = [[narrow if group is sloped else wide] * len(group) for group in groups]
    fig, axes, (bar,) = _mosaic(shapes, (len(groups),))
    flat_axes = [ax for row in axes[:-1] for ax in row]
    painted = [None] * count if values is None else values[0]
    for ax, state, found in zip(flat_axes, flat, painted, strict=True):
        _panel(ax, state, brush if found is None else brush.with_values(found), wide, _time(state))
    painted = [None] * count if values is None else values[1]
    for ax, state, found in zip(axes[-1], sloped, painted, strict=True):
        painter = brush if found is None else brush.with_values(found)
        shown = _panel(ax, state, painter, narrow, _time(state))
    _label(axes)
    color_bar(fig, shown, brush, cax=bar)
    return fig


def figure_11(flight: States, impact: States, heap: Any) -> Picture:
    """A loose slug: its flight along a parabola, its densification at the wall, its heap.

    Parameters
    ----------
    flight : sequence of State
        Drawn into one panel, with the parabola of the mass centre from the first one on.
    impact : sequence of State
        One panel each, zoomed to where the material meets the right wall.
    heap : State
        At rest.

    Returns
    -------
    Picture
        Coloured by the nodal density (section 4.3).

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
    fig, axes, (bar,) = _mosaic(
        [[whole, *[zoom] * half], [*[zoom] * (len(impact) - half), last]], (2,)
    )
    (first, *upper), (*lower, end) = axes
    for state in flight:
        draw(first, state, brush, view, whole)
    _parabola(first, flight[0], flight[-1].time)
    _dress(first, "t = " + ", ".join(f"{state.time:.2f}" for state in flight) + " s")
    for ax, state in zip([*upper, *lower], impact, strict=True):
        _panel(ax, state, brush, zoom, _time(state))
    shown = _panel(end, heap, brush, last, _time(heap))
    _label(axes)
    color_bar(fig, shown, brush, cax=bar)
    return fig


def _parabola(ax: Axes, start: Any, until: float) -> None:
    """Path of a point mass under the gravity at the start."""
    mass = start.mass / start.mass.sum()
    x, v = mass @ start.x, mass @ start.v
    t = np.linspace(0.0, until - start.time, 100)[:, None]
    path = x + v * t + 0.5 * start.scene.gravity.at(start.time) * t**2
    ax.plot(*path.T, color="black", linewidth=1.0, linestyle=(0, (4, 2)), zorder=4)


def _near_wall(states: States, extent: Extent) -> Extent:
    """What the material takes up while it meets the wall, but for the last few points."""
    x = np.concatenate([state.x for state in states])
    low, high = np.percentile(x, 0.5, axis=0), np.percentile(x, 99.5, axis=0)
    margin = 0.08 * (high - low)
    right = extent[0][1]
    return (float(low[0] - margin[0]), right), (
        max(float(low[1] - margin[1]), extent[1][0]),
        float(high[1] + margin[1]),
    )
