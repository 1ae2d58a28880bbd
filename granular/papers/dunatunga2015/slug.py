"""Figure 11: a slug of loose material flies, meets a wall, and comes to rest."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from granular import scenes
from granular.materials import glass_beads
from granular.model.state import State
from granular.papers.dunatunga2015.document import SCHEMES, figure_of_runs
from granular.papers.dunatunga2015.panels import States, dress, label_axes, panel, time_title
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.plot.canvas import Extent, Picture, View, color_bar
from granular.plot.fields import Brush
from granular.plot.frame import Drawing
from granular.plot.mosaic import Panel, mosaic
from granular.tools.arrays import Array

FLIGHT, IMPACT = (0.0, 0.1, 0.2, 0.3), (0.34, 0.36, 0.38, 0.40, 0.42, 0.48)


@figure_of_runs(
    "11",
    "a slug of initially stress-free material: flight, impact and heap, by the nodal density",
    seconds=15.0,
    paper={
        "distance of the centre of mass from the parabola at 0.3 s [m]": "0 within the line",
        "share of the heap under stress": "the heap",
    },
)
def slug(runs: Runs) -> Drawn:
    """Throw the slug, with cells of the document.

    The document gives no size of the box: here it is 1 m, so that the heap ends before the left
    wall; the distance to the right wall is as in the scene.
    """
    scene = scenes.slug(
        center=(0.45, 0.25),
        wall_at=1.0,
        cell=0.025 if runs.quick else 0.0083,
        material=runs.grains(glass_beads),
        scheme=runs.choose(SCHEMES),
    )
    states = runs.states_at(scene, (*FLIGHT, *IMPACT, scene.duration))
    flight, impact, heap = states[: len(FLIGHT)], states[len(FLIGHT) : -1], states[-1]
    first, last = flight[0], flight[-1]
    path = ballistic(first, np.array([last.time - first.time]))[0]
    centre = last.mass @ last.x / last.mass.sum()
    numbers = {
        "distance of the centre of mass from the parabola at 0.3 s [m]": float(
            np.linalg.norm(centre - path)
        ),
        "share of the heap under stress": float(heap.dense.mean()),
    }
    return Drawn({"": figure_11(flight, impact, heap)}, numbers)


def ballistic(start: State, times: Array) -> Array:
    """Path of the centre of mass [m] under the gravity at the start, times [s] after it."""
    mass = start.mass / start.mass.sum()
    t = times[:, None]
    return mass @ start.x + mass @ start.v * t + 0.5 * start.scene.gravity.at(start.time) * t**2


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
    dress(first, "t = " + ", ".join(f"{state.time:.2f}" for state in flight) + " s")
    for ax, state in zip([*upper, *lower], impact, strict=True):
        panel(ax, state, brush, zoom, time_title(state))
    panel(end, heap, brush, last, time_title(heap))
    label_axes(axes)
    color_bar(fig, brush, cax=bar)
    bar.axhline(rho_c, color="black", linewidth=1.2)
    across = bar.get_yaxis_transform()
    bar.text(0.5, rho_c, r"$\rho_c$", transform=across, ha="center", va="bottom")
    return fig


def _tall(extent: Extent) -> float:
    return extent[1][1] - extent[1][0]


def _parabola(ax: Axes, start: State, until: float) -> None:
    """Draw the path of a point mass under the gravity at the start."""
    path = ballistic(start, np.linspace(0.0, until - start.time, 100))
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
