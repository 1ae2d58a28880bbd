"""Figures 9 and 10, table 2: silos in cells of half the size."""

from __future__ import annotations

import numpy as np

from granular.measure import GridField
from granular.model.state import State
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.papers.silo_clogging.document import PAPER, SCHEMES, E
from granular.papers.silo_clogging.silos import (
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
FLOWING = 105
"""Frame of the flowing silo in both figures."""
SHOWN = ((1, 350), (5, FLOWING))
"""W/d and the frame that is drawn."""


def pairs(runs: Runs) -> dict[str, dict[int, dict[int, State]]]:
    """States of coarse and refined silos with A = 1, by their cells and W/d."""
    wanted = {1: CENTRED, 5: (FLOWING - 1, FLOWING, FLOWING + 1)}
    return {
        name: {
            ratio: states_of(runs, 1.0, ratio, frames, refined=refined)
            for ratio, frames in wanted.items()
        }
        for name, refined in (("coarse", False), ("refined", True))
    }


@PAPER.figure(
    "9",
    "speeds of coarse and refined silos, A = 1 and W/d = 1 and 5",
    seconds=12.0,
    paper={"largest speed of the slice at 2 W, refined over coarse, W/d = 5": "good agreement"},
    E=E,
    schemes=SCHEMES,
)
def velocities(runs: Runs) -> Drawn:
    """Run both in cells of the document and of half the size."""
    states = runs.once("pairs", lambda: pairs(runs))
    picture = Picture(figsize=(7.0, 7.0), layout="compressed")
    grid = picture.subplots(2, 2)
    for row, (cells, by_ratio) in enumerate(states.items()):
        for column, (ratio, frame) in enumerate(SHOWN):
            state, ax = by_ratio[ratio][frame], grid[row, column]
            image = points(ax, state, speed(state), size=(4, 1)[row], vmin=0, vmax=0.5)
            ax.set_title(f"{cells}, W/d = {ratio}, t = {state.time:.3f} s")
    picture.colorbar(image, ax=picture.axes, label="speed [m/s]")
    coarse, refined = (
        np.nanmax(np.abs(velocity_slices(by_ratio[5][FLOWING]).velocity[1]))
        for by_ratio in states.values()
    )
    name = "largest speed of the slice at 2 W, refined over coarse, W/d = 5"
    return Drawn({"": picture}, {name: float(refined / coarse)})


@PAPER.figure(
    "10",
    "pressures of coarse and refined silos, A = 1 and W/d = 1 and 5, means over three frames",
    seconds=12.0,
    paper={f"mean pressure above W, refined over coarse, W/d = {r}": "good agreement"
           for r in (1, 5)},
    E=E,
    schemes=SCHEMES,
)  # fmt: skip
def pressures(runs: Runs) -> Drawn:
    """Compare the pressures in the same runs."""
    states = runs.once("pairs", lambda: pairs(runs))
    fields = {
        cells: {ratio: pressure(some(by_frame, by_frame)) for ratio, by_frame in by_ratio.items()}
        for cells, by_ratio in states.items()
    }
    picture = Picture(figsize=(7.0, 7.0), layout="compressed")
    grid = picture.subplots(2, 2)
    top = max(np.nanmax(field.value) for part in fields.values() for field in part.values())
    for row, (cells, by_ratio) in enumerate(fields.items()):
        for column, (ratio, field) in enumerate(by_ratio.items()):
            image = image_of(grid[row, column], field, vmin=0, vmax=top)
            grid[row, column].set_title(f"{cells}, W/d = {ratio}")
    picture.colorbar(image, ax=picture.axes, label="pressure [Pa]")
    numbers = {
        f"mean pressure above W, refined over coarse, W/d = {ratio}": (
            mean_above(fields["refined"][ratio]) / mean_above(fields["coarse"][ratio])
        )
        for ratio in (1, 5)
    }
    return Drawn({"": picture}, numbers)


def mean_above(field: GridField) -> float:
    """Mean pressure [Pa] of the cells between W and 3 W above the opening."""
    chosen = (field.axes[1] > W) & (field.axes[1] < 3 * W)
    return float(np.nanmean(field.value[:, chosen]))


@PAPER.figure(
    "table_2",
    "cells, points and time steps of coarse and refined silos",
    seconds=0.0,
    paper={"cell, coarse [mm]": 17.5, "cell, refined [mm]": 8.75}
    | {"time step, coarse [s]": 1e-4, "time step, refined [s]": 2.5e-5},
    E=E,
    schemes=SCHEMES,
)
def table_2(runs: Runs) -> Drawn:
    """Numbers of both scenes."""
    numbers = {}
    for name, refined in (("coarse", False), ("refined", True)):
        scene = silo(runs, 1.0, 5, refined=refined)
        numbers[f"cell, {name} [mm]"] = 1e3 * scene.grid.cell
        numbers[f"time step, {name} [s]"] = float(scene.scheme.dt or 0.0)
    return Drawn({}, numbers)
