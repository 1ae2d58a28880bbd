"""Figures 12 and 13: a blade of finite width in a bin, the soil that it moves and its forces."""

from __future__ import annotations

from typing import Any

import numpy as np

from granular import plot
from granular.papers.figure import Drawn
from granular.papers.haeri2021.blades import (
    BED,
    SOIL,
    THIN,
    WAY,
    BladeForces,
    MovedSoil,
    coulomb,
    forces_on_width,
    recorded_blade,
)
from granular.papers.haeri2021.document import figure_of_runs
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.record import Trajectory

DEPTHS = (0.02, 0.05)
WHOLE: dict[str, Any] = {"half": False, "cell": 2 * BED["cell"], "jitter": 0.5}
"""The whole width, in coarse cells with irregular points, for the lateral force."""


def excavation(runs: Runs, depth: float, name: str, **changes: Any) -> Trajectory:
    """Record of a blade; in full size over the whole way of the document."""
    return recorded_blade(runs, depth, name, **(changes | (WAY if runs.full else {})))


@figure_of_runs(
    "12",
    "soil about a blade 5 cm deep at the end of its way: in its middle plane, and from above",
    seconds=200.0,
    paper={"soil": "a zone before the blade moves, all else is at rest"},
)
def soil(runs: Runs) -> Drawn:
    """Draw the last state of a blade 0.305 m wide in a bin of 0.70 m.

    The blade has moved by 10 cm; in full size by the 64 cm of the document, which takes ten times
    as long.
    """
    with excavation(runs, 0.05, "excavation_5") as record:
        cell = record.scene.grid.cell
        moved = MovedSoil.measured(record, span=(0.0, 2 * cell))
    state = moved.state
    fast = moved.speed >= moved.surface.speed
    numbers = {
        "share of the soil that moves at a tenth of the blade's speed": float(
            np.average(fast, weights=state.mass)
        ),
        "heap before the blade [mm]": 1e3 * moved.heap(),
        "farthest moving soil before the blade [mm]": 1e3 * moved.reach(),
    }
    return Drawn({"": figure_12(moved)}, numbers)


def figure_12(moved: MovedSoil) -> Picture:
    """Speed in the middle plane, and elevation of the surface from above."""
    state, blade = moved.state, moved.blade
    grid, known = state.scene.grid, state.scene.parameters
    picture = Picture(figsize=(7.0, 2.1), layout="compressed")
    axes = picture.subplots(1, 2, width_ratios=(2.2, 1))
    plot.frame(
        state, moved.speed, ax=axes[0], label="speed [m/s]", slab=(0.0, 2 * grid.cell),
        limits=(0.0, known["speed"]),
        extent=((grid.lower[0], grid.upper[0]), (grid.lower[2], 0.1)),
    )  # fmt: skip
    column = np.floor((state.x[:, :2] - grid.lower[:2]) / grid.cell).astype(int)
    height = np.full(grid.shape[:2], np.nan)
    np.fmax.at(height, tuple(column.T), state.x[:, 2])
    x, y = (grid.lower[k] + (np.arange(grid.shape[k]) + 0.5) * grid.cell for k in (0, 1))
    both = 1e3 * np.concatenate([height[:, ::-1], height], axis=1).T
    levels = np.linspace(-50.0, 50.0, 21)
    image = axes[1].contourf(
        x, np.concatenate([-y[::-1], y]), both, levels, cmap="RdBu_r", extend="both"
    )
    half = known["blade"][1] / 2
    axes[1].plot([blade[0]] * 2, [-half, half], color="black")
    axes[1].set(xlabel="x [m]", ylabel="y [m]", title="surface from above", aspect="equal")
    picture.colorbar(image, ax=axes[1], label="z [mm]", ticks=levels[::5])
    return picture


@figure_of_runs(
    "13",
    "forward, vertical and lateral force on blades 2 and 5 cm deep over time",
    seconds=365.0,
    paper={"error of the forward force at 5 cm against the document's experiment [%]": -0.5},
)
def forces(runs: Runs) -> Drawn:
    """Run both depths, with the same between walls; the lateral force of the whole width.

    The experiment is printed as a figure alone, so that its error has no number here. Forces are
    means over the way at depth, with the standard deviation of that forward.
    """
    courses, numbers = {}, {}
    for depth in DEPTHS:
        for words, start, changes in (("", "excavation", {}), (", between walls", "thin", THIN)):
            label = f"{100 * depth:g} cm{words}"
            with excavation(runs, depth, f"{start}_{100 * depth:g}", **changes) as record:
                courses[label] = forces_on_width(record)
            mean = courses[label].means()
            numbers[f"forward force at {label} [N]"] = mean["forward"]
            numbers[f"deviation of the forward force at {label} [N]"] = mean["deviation"]
            numbers[f"vertical force at {label} [N]"] = mean["vertical"]
        numbers[f"Coulomb's force on a level bed at {100 * depth:g} cm [N]"] = coulomb(SOIL, depth)
    with excavation(runs, 0.05, "excavation_5_whole", **WHOLE) as record:
        whole = BladeForces.measured(record)
    mean = whole.means()
    numbers["lateral force at 5 cm [N]"] = mean["lateral"]
    numbers["deviation of the lateral force at 5 cm [N]"] = mean["lateral_deviation"]
    return Drawn({"": figure_13(courses, whole)}, numbers)


def figure_13(courses: dict[str, BladeForces], whole: BladeForces) -> Picture:
    """Forces over time, by label; the lateral one of a blade in its whole width."""
    picture = Picture(figsize=(7.0, 3.2), layout="constrained")
    axes = picture.subplots(1, 3, sharex=True)
    for k, (label, course) in enumerate(courses.items()):
        style = {"color": f"C{k // 2}", "linestyle": "--" if k % 2 else "-", "label": label}
        axes[0].plot(course.times, course.forward, **style)
        axes[1].plot(course.times, course.vertical, **style)
    for depth in DEPTHS:
        force = coulomb(SOIL, depth)
        axes[0].axhline(force, color="0.5", lw=0.8, zorder=0)
        axes[0].text(
            0.98, force, f"Coulomb, {100 * depth:g} cm", va="bottom", ha="right",
            transform=axes[0].get_yaxis_transform(),
        )  # fmt: skip
    axes[2].plot(whole.times, whole.lateral, color="black")
    axes[2].set_title(f"whole width, cells of {1e3 * WHOLE['cell']:g} mm")
    for ax, text in zip(axes, ("forward", "vertical", "lateral"), strict=True):
        ax.set(xlabel="t [s]", ylabel=f"{text} force [N]")
    picture.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    return picture
