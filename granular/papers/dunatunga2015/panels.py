"""Parts of the pictures: panels of states side by side, and axes of curves."""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes

from granular.model.state import State
from granular.plot.canvas import Extent, Picture, View
from granular.plot.fields import Brush
from granular.plot.frame import Drawing
from granular.tools.arrays import Array

States = Sequence[State]


def same_count(name: str, columns: Sequence[States]) -> int:
    """Number of states in each column."""
    counts = {len(states) for states in columns}
    if len(counts) != 1 or 0 in counts:
        raise ValueError(
            f"{name} holds {[len(states) for states in columns]} states: "
            "all must hold the same number, at least 1"
        )
    return counts.pop()


def panel(ax: Axes, state: State, brush: Brush, extent: Extent, title: str) -> None:
    Drawing(ax, state, brush, View(state.dim), extent)
    dress(ax, title)


def dress(ax: Axes, title: str) -> None:
    ax.set_title(title, pad=3)
    ax.set(xlabel="", ylabel="")


def label_axes(axes: Sequence[Sequence[Axes]]) -> None:
    """Names of the axes where they are not repeated: left and below."""
    for row in axes:
        row[0].set_ylabel("y [m]")
    for ax in axes[-1]:
        ax.set_xlabel("x [m]")


def time_title(state: State) -> str:
    return f"t = {state.time:.2f} s"


def axes_grid(columns: int, rows: int = 1, height: float = 3.6) -> tuple[Picture, np.ndarray]:
    fig = Picture(figsize=(3.6 * columns if columns > 1 else 5.5, height * rows), layout="tight")
    return fig, fig.subplots(rows, columns, squeeze=False)


def shades(count: int) -> Array:
    return matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, max(count, 1)))
