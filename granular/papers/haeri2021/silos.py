"""Figure 19: a silo that drains through a slot at its wall."""

from __future__ import annotations

import math
from collections.abc import Sequence

from granular import measure, scenes
from granular.materials import grc_1
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.papers.figure import Drawn
from granular.papers.haeri2021.document import chosen_scheme, figure_of_runs, soft_soil
from granular.papers.runs import Runs
from granular.plot.canvas import Picture, View, color_bar
from granular.plot.fields import Brush
from granular.plot.frame import Drawing

TIMES = {"quick": (0.0, 0.5, 1.0, 2.0), "normal": (0.0, 1.0, 5.0, 12.0)}
MU_S = 0.3819
"""Static friction in the silo; the other numbers are those of table 1."""


@figure_of_runs(
    "19",
    "a silo at 0, 1, 5 and 12 s: speed, and shear rate in a thin layer",
    seconds=40.0,
    paper={"slope at the end [deg]": math.degrees(math.atan(MU_S))},
)
def silo(runs: Runs) -> Drawn:
    """Run a slice two cells wide, as nothing depends on y; in full size the document's width.

    The slope is still up to three degrees steeper while the silo drains, until about 6 s.
    """
    scene = silo_scene(runs)
    states = runs.states_at(scene, TIMES["quick" if runs.quick else "normal"])
    last = states[-1]
    left = float(last.mass.sum() / states[0].mass.sum())
    numbers = {
        "slope at the end [deg]": measure.repose_angle(last, along="x", side="left").mean_deg,
        "share of the mass left": left,
        "the same below a plane at the friction angle": wedge(scene),
    }
    return Drawn({"": figure_19(states)}, numbers)


def silo_scene(runs: Runs) -> Scene:
    """Silo of the size of the figure."""
    cell = 0.0125 if runs.quick else 0.00625
    return scenes.silo_3d(
        cell=cell,
        width=0.0625 if runs.full else 2 * cell,
        material=soft_soil(runs, grc_1.replace(mu_s=MU_S)),
        scheme=chosen_scheme(runs, scenes.silo_3d().scheme),
    )


def wedge(scene: Scene) -> float:
    """Share of the mass below a plane from the edge of the slot at the friction angle."""
    size = scene.parameters
    rest = size["length"] - size["slot"]
    return float(rest**2 * MU_S / 2 / (size["length"] * size["height"]))


def figure_19(states: Sequence[State]) -> Picture:
    """Speed above, shear rate below, one column for each time."""
    picture = Picture(figsize=(7.0, 2.4), layout="compressed")
    axes = picture.subplots(2, len(states), sharex=True, sharey=True)
    brushes = (
        Brush.fitted([], "speed", limits=(0.0, 0.2)),
        Brush.fitted([], "shear_rate", limits=(0.0, 10.0), log=False, label="shear rate [1/s]"),
    )
    size = states[0].scene.parameters
    extent = ((0.0, size["length"]), (0.0, size["height"]))
    for row, brush in zip(axes, brushes, strict=True):
        for ax, state in zip(row, states, strict=True):
            Drawing(ax, state, brush, View(3, slab=(0.0, size["width"])), extent)
            ax.set_title(f"t = {state.time:.3g} s")
            ax.label_outer()
        color_bar(picture, brush, ax=list(row))
    return picture
