"""Figures 6 and 7: hourglasses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from granular import measure, scenes
from granular.materials import glass_beads
from granular.papers.dunatunga2015.document import SCHEMES, figure_of_runs
from granular.papers.dunatunga2015.panels import (
    States,
    label_axes,
    panel,
    same_count,
    time_title,
)
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.plot.canvas import Picture, View, color_bar
from granular.plot.fields import Brush
from granular.plot.mosaic import Panel, mosaic
from granular.tools.checks import one_of

TOLERANCE = 0.02
"""Relative shortfall of the nodal density that is still shown as dense.

Points at rest never fill the cells evenly.
"""
DIVIDER = 0.5
"""Height of the divider above the floor [m]."""


def hourglasses(runs: Runs) -> list[States]:
    """States of the flat and of the sloped hourglass after 0, 1, 2 and 5 s."""
    widths = {"flat": 0.96, "sloped": 0.48} if runs.quick else {"flat": None, "sloped": None}
    cell, fill = (0.02, 0.24) if runs.quick else (0.01, 0.25)
    grains, scheme = runs.grains(glass_beads), runs.choose(SCHEMES)
    return [
        runs.states_at(
            scenes.hourglass(
                kind=kind, width=width, cell=cell, fill_height=fill, material=grains, scheme=scheme
            ),
            (0.0, 1.0, 2.0, 5.0),
            kind,
        )
        for kind, width in widths.items()
    ]


@figure_of_runs(
    "6",
    "hourglasses with a flat and a sloped divider after 0, 1, 2 and 5 s: shear rate",
    seconds=45.0,
    paper={
        "left above the flat divider at 5 s": "nearly none",
        "left above the sloped one": "nearly none",
    },
)
def by_shear_rate(runs: Runs) -> Drawn:
    """Run both hourglasses, and measure what is left above the dividers."""
    flat, sloped = hourglasses(runs)
    left = [
        float(states[-1].mass[states[-1].x[:, 1] > DIVIDER].sum() / states[0].mass.sum())
        for states in (flat, sloped)
    ]
    names = ("left above the flat divider at 5 s", "left above the sloped one")
    return Drawn({"": figure_6(flat, sloped)}, dict(zip(names, left, strict=True)))


@figure_of_runs(
    "7",
    "the same by phase: dense or disconnected",
    seconds=45.0,
    paper={
        "dense by the nodal density at 5 s, flat": "the heap",
        "under stress at 5 s, flat": "the heap",
    },
)
def by_phase(runs: Runs) -> Drawn:
    """Draw the hourglasses by both criteria for dense points."""
    flat, sloped = hourglasses(runs)
    last = flat[-1]
    numbers = {
        "dense by the nodal density at 5 s, flat": float(
            measure.phase(last, tolerance=TOLERANCE).mean()
        ),
        "under stress at 5 s, flat": float(last.dense.mean()),
    }
    pictures = {"": figure_7(flat, sloped), "by_stress": figure_7(flat, sloped, by="stress")}
    return Drawn(pictures, numbers)


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
    count = same_count("(flat, sloped)", (flat, sloped))
    half = (count + 1) // 2
    groups = [flat[:half], flat[half:], sloped] if count > 1 else [flat, sloped]
    wide, narrow = View(2).extent(flat), View(2).extent(sloped)
    shapes = [[Panel(narrow if group is sloped else wide)] * len(group) for group in groups]
    fig, axes, (bar,) = mosaic(shapes, (len(groups),))
    extents = [wide] * count + [narrow] * count
    brushes = [brush] * 2 * count if values is None else map(brush.with_values, values)
    panels = (ax for row in axes for ax in row)
    for ax, state, painter, extent in zip(panels, (*flat, *sloped), brushes, extents, strict=True):
        panel(ax, state, painter, extent, time_title(state))
    label_axes(axes)
    color_bar(fig, brush, cax=bar)
    return fig
