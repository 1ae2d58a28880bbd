"""Figures 4b and 5 to 8: the arch, the pressure, the speed and the fluidity in silos."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from granular import measure
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.papers.silo_clogging.arch import arch_outline
from granular.papers.silo_clogging.document import figure_of_runs
from granular.papers.silo_clogging.silos import (
    COLORS,
    W,
    image_of,
    points,
    pressure,
    some,
    speed,
    states_of,
)
from granular.papers.silo_clogging.velocity_slices import (
    HEIGHTS,
    VelocitySlices,
    gaussian_fit,
    velocity_slices,
)
from granular.plot.canvas import Picture

FORMATION = (0, 12, 24, 36, 60, 350)
STEADY = range(120, 181, 2)
LATE = range(350, 361)
FLUIDITY = range(280, 301)
SAME_MASS = {0.1: 70, 1.0: 86}
"""Frames of figure 6, by A: nearly as much mass is left in both."""
SPEEDS = np.arange(0.05, 0.351, 0.05)
CROWN = "height of the arch over W"
LARGEST = "largest pressure on the centre line, W/d = {:g} [Pa]"
LEAST_PRESSURE = "least pressure on the centre line below y = W, W/d = {:g} [Pa]"
AT_WALL = "speed at the wall over that on the axis at 2.5 W, A = {:g}"
LEAST = "least fluidity over the largest at 2.5 W, A = {:g}"
MASS_LEFT = "share of the mass left in the last frame, A = {:g}"


@figure_of_runs(
    "4b",
    "formation of the arch, A = 1, W/d = 1: speed at six times",
    seconds=3.0,
    paper={"mean speed of dense points in the last frame [m/s]": "static"},
)
def arch(runs: Runs) -> Drawn:
    """Run the silo that jams."""
    states = some(states_of(runs, 1.0, 1, FORMATION), FORMATION)
    picture = Picture(figsize=(7.0, 3.3), layout="compressed")
    for ax, state in zip(picture.subplots(2, 3).flat, states, strict=True):
        image = points(ax, state, speed(state), size=5, vmin=0, vmax=0.5)
        ax.set(title=f"t = {state.time:.3f} s", xlim=(-0.2, 0.2), ylim=(-0.04, 0.24))
    picture.colorbar(image, ax=picture.axes, label="speed [m/s]")
    last = states[-1]
    mean = float(speed(last)[last.dense].mean())
    numbers = {"mean speed of dense points in the last frame [m/s]": mean}
    return Drawn({"": picture}, numbers | {CROWN: arch_outline(last).relative_crown})


@figure_of_runs(
    "5",
    "pressure in silos with A = 1 and W/d = 1, 2 and 5, and on their centre lines",
    seconds=8.0,
    paper={
        LEAST_PRESSURE.format(1): "low, not zero",
        LEAST_PRESSURE.format(2): "lower, not zero",
        LEAST_PRESSURE.format(5): "zero",
        LARGEST.format(5): "the smallest of the three",
    },
)
def pressures(runs: Runs) -> Drawn:
    """Run three silos, and average frames 350 to 360."""
    late = {ratio: some(states_of(runs, 1.0, ratio, LATE), LATE) for ratio in (1, 2, 5)}
    picture = Picture(figsize=(7.0, 4.2), layout="compressed")
    axes = picture.subplot_mosaic([list("abc"), list("ddd")], height_ratios=(3, 2))
    fields = {ratio: pressure(states) for ratio, states in late.items()}
    top = max(np.nanmax(field.value) for field in fields.values())
    numbers = {}
    for name, color, (ratio, field) in zip("abc", COLORS, fields.items(), strict=True):
        image = image_of(axes[name], field, vmin=0, vmax=top)
        axes[name].set_title(f"W/d = {ratio:g}")
        centre = measure.centre_line_pressure(late[ratio])
        axes["d"].plot(centre.y, centre.value, "o-", color=color, label=f"W/d = {ratio:g}")
        numbers[LARGEST.format(ratio)] = float(np.nanmax(centre.value))
        low = centre.value[centre.y < W]
        numbers[LEAST_PRESSURE.format(ratio)] = float(np.nanmin(low))
    picture.colorbar(image, ax=[axes[n] for n in "abc"], label="pressure [Pa]")
    axes["d"].set(xlabel="y [m], on the centre line", ylabel="pressure [Pa]")
    axes["d"].legend()
    return Drawn({"": picture}, numbers)


@figure_of_runs(
    "6",
    "speed and contours of it with A = 0.1 and 1, W/d = 5, and vertical velocity at three heights",
    seconds=2.0,
    paper={AT_WALL.format(0.1): "a plug, sharply cut off", AT_WALL.format(1): "spread further"},
)
def widths_of_flow(runs: Runs) -> Drawn:
    """Run two silos, and compare them when nearly the same mass is left.

    The numbers are the vertical velocity 2.5 W above the opening at the wall over that on the axis.
    """
    picture = Picture(figsize=(7.0, 6.2), layout="compressed")
    above, below = picture.subplots(2, 2, height_ratios=(3, 2))
    numbers = {}
    for ax, curve, (A, frame) in zip(above, below, SAME_MASS.items(), strict=True):
        state = states_of(runs, A, 5, [frame])[frame]
        image = points(ax, state, speed(state), size=4, vmin=0, vmax=0.5)
        for contour in measure.speed_contours(state, SPEEDS):
            for x, y in (line.T for line in contour.lines):
                ax.plot(x, y, color="black", linewidth=0.7)
                ax.plot(-x, y, color="black", linewidth=0.7)
        ax.set_title(f"A = {A:g}, t = {state.time:.3f} s")
        slices = velocity_slices(state)
        draw_slices(curve, slices, "o-")
        highest = slices.velocity[-1][np.isfinite(slices.velocity[-1])]
        numbers[AT_WALL.format(A)] = float(highest[-1] / highest[0])
        for height, color in zip(HEIGHTS, COLORS, strict=True):
            ax.axhline(height * W, color=color, linewidth=1)
    picture.colorbar(image, ax=list(above), label="speed [m/s]")
    low = min(ax.get_ylim()[0] for ax in below)
    for ax in below:
        ax.set_ylim(low, 0.01)
    return Drawn({"": picture}, numbers)


def draw_slices(ax: Axes, sections: VelocitySlices, marker: str) -> None:
    """Vertical velocity across the silo at three heights, with its mirror image."""
    for row, height, color in zip(sections.velocity, HEIGHTS, COLORS, strict=True):
        x, v = (np.concatenate([s * a[:0:-1], a]) for s, a in ((-1, sections.x), (1, row)))
        ax.plot(x, v, marker, color=color, markersize=3, linewidth=1, label=f"y = {height:g} W")
    ax.set(xlabel="x [m]", ylabel="vertical velocity [m/s]")
    ax.legend()


@figure_of_runs(
    "7",
    "vertical velocity at three heights, A = 0.5 and W/d = 5, and a diffusing Gaussian",
    seconds=2.0,
    paper={"B/d": 0.6},
)
def diffusing_gaussian(runs: Runs) -> Drawn:
    """Fit the velocities of the kinematic model to the mean of frames 120 to 180."""
    steady = some(states_of(runs, 0.5, 5, STEADY), STEADY)
    picture = Picture(figsize=(6.5, 4.6), layout="compressed")
    ax = picture.add_subplot()
    sections = velocity_slices(steady)
    fit = gaussian_fit(sections)
    draw_slices(ax, sections, "o")
    x = np.linspace(-sections.x.max(), sections.x.max(), 201)
    for y, C, offset, color in zip(
        sections.heights, fit.amplitude, fit.offset, COLORS, strict=True
    ):
        ax.plot(x, C * np.exp(-(x**2) / (4 * fit.B * y)) + offset, color=color)
    ax.set_title(f"A = 0.5, W/d = 5: B = {fit.B_over_d:.2f} d")
    return Drawn({"": picture}, {"B/d": fit.B_over_d or math.nan})


@figure_of_runs(
    "8",
    "fluidity in silos with W/d = 5 and A = 0.1, 0.5 and 1",
    seconds=7.0,
    paper={LEAST.format(0.1): "spreads least", MASS_LEFT.format(0.1): "least of the three"},
)
def fluidities(runs: Runs) -> Drawn:
    """Draw means over dense points; cells without any are white here, and 0 in the document.

    The numbers are the least fluidity across the silo 2.5 W above the opening over the largest, and
    the mass that is left, which is the less the faster the flow is.
    """
    picture = Picture(figsize=(7.0, 2.4), layout="compressed")
    numbers = {}
    for ax, A in zip(picture.subplots(1, 3), (0.1, 0.5, 1.0), strict=True):
        by_frame = states_of(runs, A, 5, (0, *FLUIDITY))
        states = some(by_frame, FLUIDITY)
        field = measure.frame_average(states, "g", points="dense")
        image = image_of(ax, field, norm=LogNorm(0.01, 100), cmap="inferno")
        ax.set_title(f"A = {A:g}")
        row = field.value[:, np.abs(field.axes[1] - 2.5 * W).argmin()]
        numbers[LEAST.format(A)] = float(np.nanmin(row) / np.nanmax(row))
        numbers[MASS_LEFT.format(A)] = float(states[-1].mass.sum() / by_frame[0].mass.sum())
    picture.colorbar(image, ax=picture.axes, label="fluidity [1/s]")
    return Drawn({"": picture}, numbers)
