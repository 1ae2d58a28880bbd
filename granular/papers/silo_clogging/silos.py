"""Runs of clogging silos, and parts of their pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from granular import measure, scenes
from granular.materials import silo_grains
from granular.measure import GridField
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.papers.runs import Runs
from granular.papers.silo_clogging.document import SCHEMES
from granular.tools.arrays import Array

W = 0.14
"""Opening of the scene [m]."""
FRAME = 1 / 240
"""Time between two frames of the document [s]."""
FINE_STEP = 2.5e-5
"""Time step in cells of half the size (table 2) [s]."""
ByFrame = dict[int, State]
"""States by the number of their frame."""
COLORS = ("#c2377e", "#2a8a4a", "#2d5d8f")
"""Pink, green and blue, as in the document."""


def silo(runs: Runs, A: float, ratio: float, *, refined: bool = False) -> Scene:
    """A half silo; a quick one has cells of twice the size."""
    cell = 0.035 if runs.quick else 0.0175
    size: dict[str, Any] = {"width": 0.56, "height": 0.56} if runs.quick else {}
    scheme = runs.choose(SCHEMES)
    return scenes.clogging_silo(
        opening_over_d=ratio,
        A=A,
        cell=cell / 2 if refined else cell,
        scheme=scheme.replace(dt=FINE_STEP) if refined else scheme,
        material=runs.grains(silo_grains),
        **size,
    )


def states_of(
    runs: Runs, A: float, ratio: float, wanted: Iterable[int], *, refined: bool = False
) -> ByFrame:
    """States by the number of their frame; those of a quick run come in a sixth of the time."""
    frame, numbers = FRAME / 6 if runs.quick else FRAME, set(wanted)
    name = f"A = {A:g}, W/d = {ratio:g}{', refined' * refined}"
    seen = runs.frames(
        silo(runs, A, ratio, refined=refined),
        (max(numbers) + 0.01) * frame,
        frame,
        lambda state: state if round(state.time / frame) in numbers else None,
        name,
    )
    return {round(s.time / frame): s for s in seen if s is not None}


def some(by_frame: ByFrame, wanted: Iterable[int]) -> list[State]:
    """States of these frames."""
    return [by_frame[i] for i in wanted]


def speed(state: State) -> Array:
    """Speeds of the points [m/s]."""
    return np.linalg.norm(state.v, axis=1)


def pressure(states: Sequence[State]) -> GridField:
    """Mean pressure of cells over some frames."""
    return measure.frame_average(states, "pressure", weight="volume")


def image_of(ax: Axes, field: GridField, **style: Any) -> Any:
    """Draw a field of half a silo with its mirror image; empty cells are white."""
    cell = field.axes[1][1] - field.axes[1][0]
    x = np.concatenate([-field.axes[0][::-1], field.axes[0]])
    value = np.concatenate([field.value[::-1], field.value])
    up = field.axes[1] + cell > 0
    image = ax.pcolormesh(x, field.axes[1][up], value[:, up].T, shading="nearest", **style)
    dress(ax)
    return image


def points(ax: Axes, state: State, value: Array, *, size: float, **style: Any) -> Any:
    """Draw the points of half a silo and their mirror images."""
    x = np.concatenate([-state.x[:, 0], state.x[:, 0]])
    y = np.concatenate([state.x[:, 1]] * 2)
    image = ax.scatter(x, y, c=np.concatenate([value] * 2), s=size, linewidths=0, **style)
    dress(ax)
    return image


def dress(ax: Axes) -> None:
    """Labels, limits, and the bottom to both sides of the opening."""
    ax.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", ylim=(-0.05, 0.62))
    for side in (-1, 1):
        ax.plot((side * W / 2, side * 0.2975), (0, 0), color="black", linewidth=2.5)
