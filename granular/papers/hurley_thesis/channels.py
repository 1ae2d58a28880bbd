"""Figures 5.8 to 5.10: blocks that collapse down inclined channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from granular import plot, scenes
from granular.model.state import State
from granular.papers.dunatunga2015.panels import axes_grid, shades
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.sph_measures import BETAS, far, highest
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.sph import Scene

FLOORS = {0.0: 0.6, 10.0: 0.7, 16.0: 0.9, 22.0: 1.2}
"""Angle [deg] and length of the floor [m]."""
TIMES = (0.2, 0.4, 0.8)
"""Times after the gate began to lift [s]; those of the thesis are in its pictures alone."""
WALLS = {"periodic": (False, 0.04), "side walls": (True, 0.1)}
"""Side walls, and width [m]: the thesis has 10 cm in both."""
QUICK_WIDTHS = {"periodic": 0.0, "side walls": 0.06}


def channel(runs: Runs, angle: float, walls: str, beta: float) -> Scene:
    """Block in a channel."""
    side_walls, width = WALLS[walls]
    if runs.quick:
        width = QUICK_WIDTHS[walls]
    return scenes.inclined_collapse(
        angle_deg=angle,
        side_walls=side_walls,
        width=0.1 if runs.full else width,
        spacing=0.02 if runs.quick else 0.01,
        dilation=beta,
        reach=FLOORS[angle],
        duration=TIMES[-1] + 0.1,
    )


def states_of(runs: Runs, angle: float, walls: str, beta: float) -> list[State]:
    """States when the gate begins to lift and at the three times after that."""
    scene = channel(runs, angle, walls, beta)
    settle = float(scene.parameters["settle"])
    name = f"{angle:g} deg, {walls}, beta up to {beta:g}"
    return runs.states_at(scene, [settle + time for time in (0.0, *TIMES)], name)


# ---- figure 5.8 ----


@PAPER.figure(
    "5.8",
    "a block in an inclined channel before its gate lifts, and after the collapse",
    seconds=40.0,
)
def before_and_after(runs: Runs) -> Drawn:
    """Side views at 16 degrees, with side walls and dilation; x is along the slope."""
    first, *_, last = states_of(runs, 16.0, "side walls", 0.5)
    picture = Picture(figsize=(8.0, 4.0), layout="compressed")
    extent = ((0.0, FLOORS[16.0]), (0.0, 0.17))
    for ax, state, title in zip(
        picture.subplots(2, 1), (first, last), ("gate closed", f"{TIMES[-1]:g} s"), strict=True
    ):
        plot.frame(state, "speed", ax=ax, view=(0, 2), extent=extent, title=title)
    ends = far(last)
    numbers: dict[str, Number] = {
        "99 % of the mass within [m]": ends["L99"],
        "farthest particle [m]": ends["L"],
    }
    return Drawn({"": picture}, numbers)


# ---- figure 5.9 ----


@PAPER.figure(
    "5.9",
    "profiles of collapses down inclines, with and without side walls and dilation",
    seconds=345.0,
    paper={
        "angles and walls at which dilation shortens the run-out": "all",
        "angles and dilations at which side walls shorten the run-out": "all",
        "angles and walls at which dilation leaves more at the upper wall": "all",
    },
)
def profiles(runs: Runs) -> Drawn:
    """Collapses in 3D, in channels that are periodic across or have side walls.

    Run-outs are distances of 99 % of the mass. The profiles of the experiments are in the pictures
    of the thesis alone.
    """
    angles = tuple(FLOORS)[1:2] if runs.quick else tuple(FLOORS)
    states = {
        (walls, words): {angle: states_of(runs, angle, walls, beta) for angle in angles}
        for walls in WALLS
        for words, beta in BETAS.items()
    }
    numbers: dict[str, Number] = {
        f"99 % of the mass within at {angle:g} deg, {walls}, {words} [m]": far(of[angle][-1])["L99"]
        for (walls, words), of in states.items()
        for angle in angles
    }
    picture, grid = axes_grid(2, 2, 3.0)
    for ax, ((walls, words), of), letter in zip(grid.flat, states.items(), "abcd", strict=True):
        for (angle, at_times), color in zip(of.items(), shades(len(angles)), strict=True):
            for state, marker in zip(at_times[1:], "o^s", strict=True):
                ax.plot(*highest(state), marker, color=color, markersize=2.5, fillstyle="none")
            ax.plot([], [], "o", color=color, label=f"{angle:g} deg")
        for time, marker in zip(TIMES, "o^s", strict=True):
            ax.plot([], [], marker, color="0.4", fillstyle="none", label=f"{time:g} s")
        ax.set(xlabel="x [m]", ylabel="height [m]", title=f"({letter}) {walls}, {words}")
        ax.set(xlim=(0.0, None), ylim=(0.0, 0.16))
        ax.legend(fontsize="x-small")
    return Drawn({"": picture}, numbers | orderings(states))


def orderings(
    states: Mapping[tuple[str, str], Mapping[float, Sequence[State]]],
) -> dict[str, Number]:
    """Numbers of pairs of runs whose order is that of the thesis."""
    reach = {key: {a: far(of[a][-1])["L99"] for a in of} for key, of in states.items()}
    upper = {key: {a: height_at_wall(of[a][-1]) for a in of} for key, of in states.items()}
    dilation = [
        (reach[w, "dilation"][a] < reach[w, "no dilation"][a],
         upper[w, "dilation"][a] > upper[w, "no dilation"][a])
        for w in WALLS for a in reach[w, "dilation"]
    ]  # fmt: skip
    walls = [
        reach["side walls", b][a] < reach["periodic", b][a]
        for b in BETAS for a in reach["periodic", b]
    ]  # fmt: skip
    shorter, higher = (sum(one) for one in zip(*dilation, strict=True))
    count = len(dilation)
    return {
        "angles and walls at which dilation shortens the run-out": f"{shorter} of {count}",
        "angles and dilations at which side walls shorten the run-out": f"{sum(walls)} of {count}",
        "angles and walls at which dilation leaves more at the upper wall": f"{higher} of {count}",
    }


def height_at_wall(state: State) -> float:
    """Height of the highest particle within 5 cm of the upper wall [m]."""
    return float(state.x[state.x[:, 0] < 0.05, -1].max())


# ---- figure 5.10 ----


FASTEST, COLORS = 40.0, "inferno"
"""End of the colour scale [1/s], and its colours."""


@PAPER.figure(
    "5.10",
    "shear rates of collapses between side walls, next to a wall and in the middle",
    seconds=150.0,
    paper={
        f"shear rate at the walls over that in the middle, first time, {angle:g} deg": "above 1"
        for angle in FLOORS
    },
)
def snapshots(runs: Runs) -> Drawn:
    """Side views of the particles next to a side wall, and of the middle at the first time.

    The particles that lie along the upper wall do not move, as in the thesis.
    """
    angles = tuple(FLOORS)[1:2] if runs.quick else tuple(FLOORS)
    picture = Picture(figsize=(13.0, 0.85 * len(angles) + 0.6), layout="compressed")
    grid = picture.subplots(len(angles), 1 + len(TIMES), squeeze=False)
    numbers: dict[str, Number] = {}
    for row, angle in zip(grid, angles, strict=True):
        states = states_of(runs, angle, "side walls", 0.5)[1:]
        name = f"shear rate at the walls over that in the middle, first time, {angle:g} deg"
        numbers[name] = wall_ratio(states[0])
        draw_row(row, states, angle)
    for ax in grid.flat:
        ax.label_outer()
    scale = ScalarMappable(Normalize(0.0, FASTEST), COLORS)
    picture.colorbar(scale, ax=grid, label="shear rate |D| [1/s]", shrink=0.8)
    return Drawn({"": picture}, numbers)


def draw_row(row: np.ndarray, states: Sequence[State], angle: float) -> None:
    """The middle at the first time, and the particles next to a wall at all three."""
    width = states[0].scene.grid.upper[1]
    extent = ((0.0, max(FLOORS.values())), (0.0, 0.17))
    cell = states[0].scene.grid.cell
    middle, near = (0.5 * width - cell, 0.5 * width + cell), (0.0, 1.5 * cell)
    panels = [(states[0], middle, "middle"), *((state, near, "wall") for state in states)]
    for ax, (state, slab, where), time in zip(row, panels, (TIMES[0], *TIMES), strict=True):
        title = f"{angle:g} deg, {time:g} s, {where}"
        plot.frame(
            state, "shear_rate", ax=ax, view=(0, 2), slab=slab, title=title, extent=extent,
            limits=(0.0, FASTEST), log=False, bar=False, cmap=COLORS,
        )  # fmt: skip
        ax.title.set_fontsize("small")


def wall_ratio(state: State) -> float:
    """Mean shear rate of particles next to the side walls over that of those in the middle."""
    width, cell = state.scene.grid.upper[1], state.scene.grid.cell
    off = np.abs(state.x[:, 1] - 0.5 * width)
    near, middle = off > 0.5 * width - cell, off < cell
    return float(state.shear_rate[near].mean() / state.shear_rate[middle].mean())
