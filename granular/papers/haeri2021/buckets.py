"""Figure 1: an industrial excavator, with soil at rest, flowing and falling at the same time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from granular import plot, scenes
from granular.materials import NGF, grc_1
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.papers.figure import Drawn
from granular.papers.haeri2021.document import EVERY, chosen_scheme, figure_of_runs, soft_soil
from granular.papers.runs import Runs
from granular.plot.canvas import Picture

TIMES = (0.5, 2.5, 4.5, 6.0)
"""Times of the panels [s]; the last is that of the document."""
AT_REST, FLOWING = 0.01, 1.0
"""Shear rates below and above which soil counts as at rest and as flowing [1/s]."""
FALLING = 0.2
"""Speed downwards from which stress-free soil falls [m/s]."""


@figure_of_runs(
    "1",
    "industrial excavator: shear rate next to its plane of symmetry, and stress-free points",
    seconds=115.0,
    paper={
        "share at rest at 6 s": "in the bucket and far from it",
        "share flowing at 6 s": "piled up after it returned",
        "share that falls in some frame": "leaks from the bucket",
    },
)
def excavator(runs: Runs) -> Drawn:
    """Run the bucket of the scene in cells of 20 mm.

    The document has 3.3 mm at a quarter of the size, which are 13 mm here; in full size the cells
    are 12.5 mm, at seven times the cost. Shares are by mass.
    """
    scene = excavator_scene(runs)
    with runs.record(scene, "excavator", every=EVERY, precision="single") as record:
        states = [record[int(np.argmin(np.abs(record.times - t)))] for t in TIMES]
        falls = {point for state in record for point in falling(state)}
    last = states[-1]
    numbers = {
        "share at rest at 6 s": _share(last, last.dense & (last.shear_rate < AT_REST)),
        "share flowing at 6 s": _share(last, last.dense & (last.shear_rate > FLOWING)),
        "share stress-free at 6 s": _share(last, ~last.dense),
        "share that falls in some frame": _share(last, np.isin(last.id, list(falls))),
        "share above the bed at 6 s": _share(last, last.x[:, 2] > scene.grid.cell),
    }
    return Drawn({"": figure_1(states)}, numbers)


def excavator_scene(runs: Runs) -> Scene:
    """Excavator of the size of the figure."""
    usual = scenes.excavator()
    soil = cast(NGF, usual.material)
    return scenes.excavator(
        cell=0.05 if runs.quick else 0.0125 if runs.full else 0.02,
        material=soft_soil(runs, grc_1.replace(nu=soil.nu, rho_c=soil.rho_c)),
        scheme=chosen_scheme(runs, usual.scheme),
    )


def falling(state: State) -> list[int]:
    """Numbers of the stress-free points above the bed that fall."""
    chosen = ~state.dense & (state.v[:, 2] < -FALLING) & (state.x[:, 2] > 0.0)
    ids: list[int] = state.id[chosen].tolist()
    return ids


def _share(state: State, chosen: np.ndarray) -> float:
    return float(state.mass[chosen].sum() / state.mass.sum())


def figure_1(states: Sequence[State]) -> Picture:
    """Shear rate of dense soil in a slice next to the plane of symmetry; stress-free points red."""
    picture = Picture(figsize=(7.0, 4.6), layout="compressed")
    for ax, state in zip(picture.subplots(2, 2).ravel(), states, strict=True):
        grid = state.scene.grid
        near = (0.0, 2 * grid.cell)
        rate = np.where(state.dense, state.shear_rate, 0.0)
        plot.frame(
            state, rate, ax=ax, slab=near, limits=(0.0, 5.0), log=False, label="shear rate [1/s]",
            extent=((grid.lower[0], grid.upper[0]), (grid.lower[2], 0.45)),
        )  # fmt: skip
        free = ~state.dense & (state.x[:, 1] < near[1])
        ax.plot(*state.x[free][:, [0, 2]].T, ".", color="red", markersize=3)
    return picture
