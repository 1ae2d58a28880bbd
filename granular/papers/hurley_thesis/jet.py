"""Figure 6.2: a jet of gas digs a crater into a bed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from granular import plot, scenes
from granular.model.state import State
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.sph_measures import highest
from granular.papers.runs import Runs
from granular.plot.canvas import Picture, triangles
from granular.scenes.sph_gas import bed_soil
from granular.sph import Gas, Scene
from granular.tools.arrays import Array

EVERY = 0.0075
"""Time between frames [s]; every third frame is drawn, from the second on."""
STIFF = bed_soil.replace(kappa=8 * bed_soil.kappa)
"""Grains are thrown at up to 11 m/s, which is more than half the speed of waves in `bed_soil`."""
FASTEST, HIGHEST = 3.0, 10.0
"""Ends of the scales: speed [m/s], pressure above the initial one [kPa]."""
AMBIENT = 1e5
"""Initial pressure of the gas [Pa]."""
NEAR = 0.05
"""Half of the width below the jet over which heights and pressures are averaged [m]."""


@PAPER.figure(
    "6.2",
    "a jet of gas on a bed: speed of the sand, and pressure of the gas",
    seconds=105.0,
    paper={
        "largest excess pressure in the bed below the jet [kPa]": "a region of high pressure",
        "excess pressure there at the end [kPa]": "diminished",
        "depth of the crater at the end [m]": "a crater",
        "rise of the highest sand at the end [m]": "outward and upward",
    },
)
def jet(runs: Runs) -> Drawn:
    """Drive gas at 100 m/s at a bed for 75 ms, with grains eight times as stiff as in chapter 5.

    The jet is steady here, so that the pressure below it stays; whether it is in the thesis is not
    said. In 2D; in full size in 3D with the period of the thesis, 0.1 m.
    """
    scene = scenes.jet_on_bed(
        spacing=0.0125 if runs.quick else 0.00625,
        across=0.1 if runs.full else 0.0,
        duration=0.03 if runs.quick else 0.075,
        material=STIFF,
    )
    states = runs.frames(scene, scene.duration, EVERY, lambda state: state)
    first, last = states[0], states[-1]
    pressures = [excess_below(state) for state in states]
    numbers: dict[str, Number] = {
        "largest excess pressure in the bed below the jet [kPa]": max(pressures),
        "excess pressure there at the end [kPa]": pressures[-1],
        "depth of the crater at the end [m]": height_below(first) - height_below(last),
        "rise of the highest sand at the end [m]": float(
            last.x[:, -1].max() - first.x[:, -1].max()
        ),
        "share of the nozzle full of gas at the end": filling(last),
    }
    return Drawn({"": figure_6_2(states[1::3])}, numbers)


# ---- measures ----


def middle_of(state: State) -> float:
    """Position of the jet [m]."""
    return 0.5 * float(state.scene.grid.lower[0] + state.scene.grid.upper[0])


def height_below(state: State) -> float:
    """Mean height of the highest particles below the jet [m]."""
    x, tops = highest(state)
    return float(tops[np.abs(x - middle_of(state)) < NEAR].mean())


def excess_below(state: State) -> float:
    """Mean pressure of the gas in the upper half of the bed below the jet, over AMBIENT [kPa]."""
    gas, depth = state.gas, float(state.scene.parameters["depth"])
    height = gas.x[:, -1]
    inside = (np.abs(gas.x[:, 0] - middle_of(state)) < NEAR) & (height > 0.5 * depth)
    inside &= height < 0.8 * depth
    return 1e-3 * float(gas.pressure[inside].mean() - AMBIENT)


def filling(state: State) -> float:
    """Mass of the gas in the nozzle over its mass at the initial density."""
    scene, gas = cast(Scene, state.scene), state.gas
    source = cast(Gas, scene.gas)
    (jet,), density = source.jets, source.fills[0].density
    low, high = (np.array(end) for end in jet.region.bounds)
    within = ((gas.x > low) & (gas.x < high)).all(axis=1)
    return float(gas.mass[within].sum() / (density * np.prod(high - low)))


# ---- drawing ----


def figure_6_2(states: Sequence[State]) -> Picture:
    """Speed of the material particles, and pressure of the gas above the initial one."""
    picture = Picture(figsize=(1.75 * len(states), 3.6), layout="compressed")
    axes = picture.subplots(2, len(states), sharex=True, sharey=True, squeeze=False)
    grid = states[0].scene.grid
    extent = (grid.lower[0], grid.upper[0]), (grid.lower[-1], grid.upper[-1])
    for (above, below), state in zip(axes.T, states, strict=True):
        title = f"t = {1e3 * state.time:.1f} ms"
        plot.frame(
            state, "speed", ax=above, limits=(0, FASTEST), extent=extent, bar=False, title=title,
            view=None if state.dim == 2 else (0, 2),
        )  # fmt: skip
        draw_gas(below, state)
        below.set_aspect("equal")
    for ax in axes.flat:
        ax.set(xlabel="x [m]", ylabel="y [m]")
        ax.label_outer()
    speeds = ScalarMappable(Normalize(0, FASTEST), "viridis")
    picture.colorbar(speeds, ax=axes[0], label="speed [m/s]")
    pressures = ScalarMappable(Normalize(-HIGHEST, HIGHEST), "coolwarm")
    picture.colorbar(pressures, ax=axes[1], label="excess pressure [kPa]")
    return picture


def draw_gas(ax: Axes, state: State) -> None:
    """Pressure of the gas, and arrows along its velocity, of a length by its square root.

    In 3D the gas of one layer is drawn.
    """
    gas, cell = state.gas, state.scene.grid.cell
    layer = slice(None) if state.dim == 2 else gas.x[:, 1] < cell
    x: Array = gas.x[layer][:, (0, -1)]
    v: Array = gas.v[layer][:, (0, -1)]
    above = 1e-3 * (gas.pressure[layer] - AMBIENT)
    mesh = triangles(x, longest=6)
    ax.tripcolor(mesh, above, shading="gouraud", cmap="coolwarm", vmin=-HIGHEST, vmax=HIGHEST)
    speed = np.linalg.norm(v, axis=1)
    fast = np.flatnonzero(speed > 1.0)
    chosen = np.random.default_rng(0).choice(fast, len(fast) // 8, replace=False)
    arrows = v[chosen] / np.sqrt(speed[chosen])[:, None]
    ax.quiver(*x[chosen].T, *arrows.T, scale=250.0, width=0.004, color="0.15")
