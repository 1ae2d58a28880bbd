"""Figures 9 and 10, table 2: silos in cells of half the size."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from granular.measure import GridField
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.papers.silo_clogging.arch import arch_outline
from granular.papers.silo_clogging.document import figure_of_runs
from granular.papers.silo_clogging.silos import (
    ByFrame,
    W,
    image_of,
    points,
    pressure,
    silo,
    some,
    speed,
    states_of,
)
from granular.papers.silo_clogging.velocity_slices import velocity_slices
from granular.plot.canvas import Picture

CENTRED = (349, 350, 351)
"""Frames of figure 10, over which pressures are averaged."""
SHOWN = {1: 350, 5: 105}
"""Frames of figure 9, by W/d."""
PEAK = "largest speed of the slice at 2 W, W/d = 5, refined over coarse"
CROWN = "height of the arch over W, {}"
LEFT = "mass left, W/d = 5, refined over coarse"
MEAN = "mean pressure between W and 2 W, W/d = {:g}, refined over coarse"


def pairs(runs: Runs, wanted: Mapping[int, Iterable[int]]) -> dict[str, dict[int, ByFrame]]:
    """States of coarse and refined silos with A = 1, by their cells and W/d."""
    return {
        name: {
            ratio: states_of(runs, 1.0, ratio, frames, refined=refined)
            for ratio, frames in wanted.items()
        }
        for name, refined in (("coarse", False), ("refined", True))
    }


@figure_of_runs(
    "9",
    "speeds of coarse and refined silos, A = 1 and W/d = 1 and 5",
    seconds=49.0,
    paper={
        PEAK: "slightly above 1",
        CROWN.format("coarse"): "a polygon",
        CROWN.format("refined"): "rounder",
    },
)
def velocities(runs: Runs) -> Drawn:
    """Run both in cells of the document and of half the size. A semicircle is 0.5 W high."""
    states = pairs(runs, {ratio: [frame] for ratio, frame in SHOWN.items()})
    picture = Picture(figsize=(7.0, 6.6), layout="compressed")
    grid, numbers = picture.subplots(2, 2), {}
    for row, (cells, by_ratio) in enumerate(states.items()):
        for column, (ratio, frame) in enumerate(SHOWN.items()):
            state, ax = by_ratio[ratio][frame], grid[row, column]
            image = points(ax, state, speed(state), size=(4, 1)[row], vmin=0, vmax=0.5)
            ax.set_title(f"{cells}, W/d = {ratio}, t = {state.time:.3f} s")
        numbers[CROWN.format(cells)] = arch_outline(by_ratio[1][SHOWN[1]]).relative_crown
    picture.colorbar(image, ax=picture.axes, label="speed [m/s]")
    coarse, refined = (
        np.nanmax(np.abs(velocity_slices(by_ratio[5][SHOWN[5]]).velocity[1]))
        for by_ratio in states.values()
    )
    return Drawn({"": picture}, {PEAK: float(refined / coarse)} | numbers)


@figure_of_runs(
    "10",
    "pressures of coarse and refined silos, A = 1 and W/d = 1 and 5, means over three frames",
    seconds=67.0,
    paper={MEAN.format(ratio): "good agreement" for ratio in SHOWN},
)
def pressures(runs: Runs) -> Drawn:
    """Run the same silos for 350 frames, and compare their pressures.

    With W/d = 5 less is left of the refined silo at the same time, so that its pressure is lower.
    """
    states = pairs(runs, dict.fromkeys(SHOWN, CENTRED))
    fields = {
        cells: {ratio: pressure(some(by_frame, CENTRED)) for ratio, by_frame in by_ratio.items()}
        for cells, by_ratio in states.items()
    }
    picture = Picture(figsize=(7.0, 6.6), layout="compressed")
    grid = picture.subplots(2, 2)
    top = max(np.nanmax(field.value) for part in fields.values() for field in part.values())
    for row, (cells, by_ratio) in enumerate(fields.items()):
        for column, (ratio, field) in enumerate(by_ratio.items()):
            image = image_of(grid[row, column], field, vmin=0, vmax=top)
            grid[row, column].set_title(f"{cells}, W/d = {ratio}")
    picture.colorbar(image, ax=picture.axes, label="pressure [Pa]")
    numbers = {
        MEAN.format(ratio): mean_above(fields["refined"][ratio])
        / mean_above(fields["coarse"][ratio])
        for ratio in SHOWN
    }
    left = [float(by_ratio[5][CENTRED[-1]].mass.sum()) for by_ratio in states.values()]
    return Drawn({"": picture}, numbers | {LEFT: left[1] / left[0]})


def mean_above(field: GridField) -> float:
    """Mean pressure [Pa] of the cells with material between W and 2 W above the bottom."""
    chosen = (field.axes[1] > W) & (field.axes[1] < 2 * W)
    return float(np.nanmean(field.value[:, chosen]))


@figure_of_runs(
    "table_2",
    "cells, time steps and lengths of coarse and refined silos",
    seconds=0.0,
    paper={"cell, coarse [m]": 0.0175, "cell, refined [m]": 0.00875}
    | {"time step, coarse [s]": 1e-4, "time step, refined [s]": 2.5e-5}
    | {"duration [s]": 1.5, "W [m]": 0.14, "L [m]": 0.595, "H [m]": 0.595}
    | {"points in a cell": 16, "substeps of the fluidity": 150},
)
def table_2(runs: Runs) -> Drawn:
    """Numbers of both scenes.

    Points and substeps are from section 7.1, which prints cells and opening as a tenth of those of
    the table, as section 7.3 does with the grains.
    """
    numbers: dict[str, float] = {}
    for name, refined in (("coarse", False), ("refined", True)):
        scene = silo(runs, 1.0, 5, refined=refined)
        numbers[f"cell, {name} [m]"] = scene.grid.cell
        numbers[f"time step, {name} [s]"] = float(scene.scheme.dt or 0.0)
    numbers |= {"duration [s]": scene.duration}
    lengths = {"W [m]": "orifice", "L [m]": "width", "H [m]": "height"}
    numbers |= {name: float(scene.parameters[key]) for name, key in lengths.items()}
    numbers["points in a cell"] = float(scene.parameters["points_per_cell"])
    return Drawn({}, numbers | {"substeps of the fluidity": float(scene.scheme.fluidity.substeps)})
