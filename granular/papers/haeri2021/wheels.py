"""Figures 17 and 18: a smooth wheel on soil, the soil below it, its forces and its sinkage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, cast

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from granular import measure, plot, scenes
from granular.measure.soil_tools import WheelHistory
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.papers.figure import Drawn
from granular.papers.haeri2021.document import EVERY, chosen_scheme, figure_of_runs, soft_soil
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.record import Trajectory
from granular.shapes import Cylinder
from granular.tools.arrays import Array, BoolArray

ROLL = {
    **{"length": 0.49, "width": 0.1925, "headroom": 0.0525, "cell": 0.00875},
    **{"start": 0.1625, "duration": 7.0},
}
"""Cells of a tenth of the soil's depth; the bed has the document's width to half a millimetre."""
COARSE = {"length": 0.4875, "start": 0.1625, "duration": 7.0}
"""Cells of 12.5 mm, which divide the depth of the soil."""
FINE = ROLL | {"cell": ROLL["cell"] / 2}
"""Cells of a third of the sinkage."""
QUICK = {
    **{"cell": 0.025, "soil": 0.1, "width": 0.15, "length": 0.5, "headroom": 0.1, "start": 0.2},
    **{"omega": 0.4, "settle": 0.4, "duration": 1.2},
}
TREAD, LOAD = 0.125, 164.0
"""Width of the wheel [m] and its load [N]."""
SLIPS = (20, 40, 70)
"""Slips of the document [%]."""
LATE = 0.5
"""Time before the end over which the soil below the wheel is averaged [s]."""
FLOWS = 0.1
"""Share of the speed of the rim from which soil flows."""


def wheel_scene(slip: int, **changes: Any) -> Scene:
    """Wheel of this slip [%]."""
    return scenes.wheel(slip=slip / 100, **changes)


def wheel_slice(slip: int, *, cell: float, **changes: Any) -> Scene:
    """Slice two cells wide through a wheel without ends, with its share of the load.

    Nothing depends on y then, as is expected at the window of the experiment.
    """
    width = 2 * cell
    share = {"width": width, "tread": width, "load": LOAD * width / TREAD}
    scene = wheel_scene(slip, cell=cell, **(changes | share))
    (body,) = scene.bodies
    # Wider than the bed: nodes on the ends of a body do not move with it.
    shape = cast(Cylinder, body.shape)
    longer = replace(shape, length=2 * shape.length)
    return scene.replace(bodies=(replace(body, shape=longer),))


@dataclass(frozen=True)
class Rolling:
    """A wheel that rolls: its history, and means over the second half of its way.

    Attributes
    ----------
    history : WheelHistory
    drawbar_pull, load : float
        [N].
    torque : float
        [N m].
    sinkage, deepest : float
        Sinkage at the end, and the largest one while it rolls [m].
    """

    history: WheelHistory
    drawbar_pull: float
    load: float
    torque: float
    sinkage: float
    deepest: float

    @classmethod
    def measured(cls, record: Trajectory) -> Self:
        """Measure a record of the scene `wheel`."""
        history = measure.soil_tools.wheel_history(record)
        settle = record.scene.parameters["settle"]
        late = history.times > (record.times[-1] + settle) / 2
        pull, load, torque = (
            float(part[late].mean())
            for part in (history.drawbar_pull, history.load, history.torque)
        )
        deepest = float(history.sinkage[history.times > settle].max())
        return cls(history, pull, load, torque, float(history.sinkage[-1]), deepest)

    @property
    def pull_over_load(self) -> float:
        """Drawbar pull by load."""
        return self.drawbar_pull / self.load


def parts_of(runs: Runs) -> dict[str, Any]:
    """Material and scheme of a wheel."""
    scheme = chosen_scheme(runs, scenes.wheel().scheme)
    return {"material": soft_soil(runs), "scheme": scheme}


@dataclass(frozen=True)
class SoilBelow:
    """Soil below a wheel at the end.

    Attributes
    ----------
    state : State
        Last state.
    speed : ndarray, shape (n,)
        Mean speed of its points in the plane of rolling over the last `LATE`, over that of the rim.
    sinkage : float
        Depth of the lowest line of the wheel [m].
    """

    state: State
    speed: Array
    sinkage: float

    @classmethod
    def measured(cls, record: Trajectory) -> Self:
        """Soil of a record of which no point leaves."""
        known, late = record.scene.parameters, record.times >= record.times[-1] - LATE - 1e-9
        states = [record[int(i)] for i in np.flatnonzero(late)]
        rim = known["omega"] * known["diameter"] / 2
        speed = np.mean([np.hypot(state.v[:, 0], state.v[:, 2]) for state in states], axis=0) / rim
        return cls(states[-1], speed, float(Rolling.measured(record).sinkage))

    @property
    def near(self) -> BoolArray:
        """Points within two cells of the window."""
        return self.state.x[:, 1] < 2 * self.state.scene.grid.cell

    def depth(self) -> float:
        """Depth of the lowest soil that flows below the surface of the bed [m]."""
        flows = self.near & (self.speed > FLOWS)
        return float(-self.state.x[flows, 2].min(initial=0.0))


@figure_of_runs(
    "17",
    "soil below a wheel at the window with slips of 20 and 70 %: mean speed over that of the rim",
    seconds=530.0,
    paper={"moving soil": "below and behind the wheel"},
)
def below_wheels(runs: Runs) -> Drawn:
    """Draw the mean speed over the last half second of 6 s of rolling.

    In cells of 4.4 mm, a third of the sinkage, and in a slice: as below a wheel without ends. In
    full size the whole wheel in its bin, in the same cells, which takes two hours for each slip.
    """
    results, numbers = {}, dict[str, float]()
    for slip in (20, 70):
        if runs.quick:
            scene = wheel_slice(slip, **QUICK, **parts_of(runs))
        elif runs.full:
            scene = wheel_scene(slip, **FINE, **parts_of(runs))
        else:
            scene = wheel_slice(slip, **FINE, **parts_of(runs))
        kind = "wheel_fine" if runs.full else "wheel_slice"
        with runs.record(scene, f"{kind}_{slip}", every=EVERY, precision="single") as record:
            results[slip] = SoilBelow.measured(record)
        soil = results[slip]
        numbers |= {
            f"sinkage over a cell, {slip} %": soil.sinkage / scene.grid.cell,
            f"sinkage, {slip} % [mm]": 1e3 * soil.sinkage,
            f"largest speed over that of the rim, {slip} %": float(soil.speed[soil.near].max()),
            f"depth of the soil that flows below the bed's surface, {slip} % [mm]": 1e3
            * soil.depth(),
        }
    return Drawn({"": figure_17(results)}, numbers)


def figure_17(results: Mapping[int, SoilBelow]) -> Picture:
    """Speed of the soil at the window, by slip."""
    picture = Picture(figsize=(7.0, 1.75 * len(results)), layout="compressed")
    axes = picture.subplots(len(results), 1, squeeze=False, sharex=True).ravel()
    for ax, (slip, soil) in zip(axes, results.items(), strict=True):
        grid = soil.state.scene.grid
        extent = ((grid.lower[0], grid.upper[0]), (grid.lower[2], 0.06))
        plot.frame(
            soil.state, soil.speed, ax=ax, slab=(0.0, 2 * grid.cell), extent=extent,
            limits=(0.0, 0.5), title=f"slip {slip} %", bar=False,
        )  # fmt: skip
        ax.label_outer()
    scale = ScalarMappable(Normalize(0.0, 0.5), "viridis")
    picture.colorbar(scale, ax=axes.tolist(), label="speed / speed of the rim", aspect=40)
    return picture


@figure_of_runs(
    "18",
    "drawbar pull, load and sinkage over time at 20 % slip; pull over load and sinkage by slip",
    seconds=300.0,
    paper={
        "error of the load against the document's experiment [%]": 5.2,
        "mean load, 20 % [N]": 164.0,
    },
)
def wheels(runs: Runs) -> Drawn:
    """Run a free wheel at three slips in cells of 12.5 mm; in full size in cells of 8.75 mm.

    Curves and points of the experiment are printed as a figure alone and are left out.
    """
    size = QUICK if runs.quick else ROLL if runs.full else COARSE
    results, numbers = {}, dict[str, float]()
    for slip in SLIPS:
        scene = wheel_scene(slip, **size, **parts_of(runs))
        with runs.record(scene, f"wheel_{slip}", every=EVERY, precision="single") as record:
            results[slip] = Rolling.measured(record)
        rolling = results[slip]
        numbers |= {
            f"mean load, {slip} % [N]": rolling.load,
            f"drawbar pull over load, {slip} %": rolling.pull_over_load,
            f"largest sinkage, {slip} % [mm]": 1e3 * rolling.deepest,
            f"sinkage at the end, {slip} % [mm]": 1e3 * rolling.sinkage,
            f"torque, {slip} % [N m]": rolling.torque,
        }
    return Drawn({"": figure_18(results)}, numbers)


def figure_18(results: Mapping[int, Rolling]) -> Picture:
    """History at the least slip, and pull over load and sinkage of all slips."""
    picture = Picture(figsize=(7.0, 4.6), layout="compressed")
    (force, depth), (pull, sinkage) = picture.subplots(2, 2)
    slip, rolling = next(iter(results.items()))
    history = rolling.history
    force.plot(history.times, history.drawbar_pull, label="drawbar pull")
    force.plot(history.times, history.load, label="load")
    force.set(xlabel="t [s]", ylabel="force [N]", title=f"slip {slip} %")
    force.legend()
    depth.plot(history.times, 1e3 * history.sinkage, color="C2")
    depth.set(xlabel="t [s]", ylabel="sinkage [mm]", title=f"slip {slip} %")
    slips = list(results)
    pull.plot(slips, [one.pull_over_load for one in results.values()], "o-")
    pull.set(xlabel="slip [%]", ylabel="drawbar pull/load")
    sinkage.plot(slips, [1e3 * one.deepest for one in results.values()], "o-", label="largest")
    sinkage.plot(slips, [1e3 * one.sinkage for one in results.values()], "s--", label="at the end")
    sinkage.set(xlabel="slip [%]", ylabel="sinkage [mm]")
    sinkage.legend()
    return picture
