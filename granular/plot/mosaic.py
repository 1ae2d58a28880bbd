"""Panels of true aspect ratio, row by row, with colour bars at the right."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from granular.plot.canvas import Extent, Picture

WIDTH, HEIGHT = 7.0, 8.5
"""Largest size of a figure [inches]."""
GAP, HEAD, FOOT = 0.4, 0.24, 0.22
"""Distances between the panels of a row, above a row (titles) and below it (ticks) [inches]."""
LEFT, RIGHT, BOTTOM = 0.5, 0.95, 0.4
"""Margins for the labels and, at the right, for the bars [inches]."""
BAR_GAP, BAR_WIDTH = 0.15, 0.12


@dataclass(frozen=True)
class Panel:
    """Region that an axes shows, and its enlargement.

    Attributes
    ----------
    extent : ((left, right), (bottom, top))
        Region [m].
    zoom : float
        Scale of the panel divided by that of a panel of zoom 1.
    """

    extent: Extent
    zoom: float = 1.0

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [m], multiplied by the zoom."""
        (left, right), (bottom, top) = self.extent
        return self.zoom * (right - left), self.zoom * (top - bottom)


def _scale(rows: Sequence[Sequence[Panel]], rest: float) -> float:
    """Largest scale [inches/m] at which all fits; `rest` is the height without panels [inches]."""
    wide = max(
        sum(panel.size[0] for panel in row) / (WIDTH - LEFT - RIGHT - GAP * (len(row) - 1))
        for row in rows
    )
    tall = sum(max(panel.size[1] for panel in row) for row in rows) / (HEIGHT - rest)
    return 1.0 / max(wide, tall)


def mosaic(
    rows: Sequence[Sequence[Panel]], bars: Sequence[int]
) -> tuple[Picture, list[list[Axes]], list[Axes]]:
    """Make a figure with axes row by row, and one axes for each colour bar at the right.

    Parameters
    ----------
    rows : sequence of sequences of Panel
        Rows from the top; the panels of a row are aligned at the bottom.
    bars : sequence of int
        Number of rows that share each bar, from the top.
    """
    rest = len(rows) * HEAD + (len(rows) - 1) * FOOT + BOTTOM
    scale = _scale(rows, rest)
    tall = [scale * max(panel.size[1] for panel in row) for row in rows]
    height = sum(tall) + rest
    total = LEFT + RIGHT
    total += max(scale * sum(p.size[0] for p in row) + GAP * (len(row) - 1) for row in rows)
    fig = Picture(figsize=(total, height))

    def place(x: float, y: float, width: float, up: float) -> Axes:
        return fig.add_axes((x / total, y / height, width / total, up / height))

    axes, floors, top = [], [], height
    for row, up in zip(rows, tall, strict=True):
        top -= HEAD + up
        x, placed = LEFT, []
        for panel in row:
            width, size = (scale * length for length in panel.size)
            placed.append(place(x, top, width, size))
            x += width + GAP
        axes.append(placed)
        floors.append(top)
        top -= FOOT
    columns = []
    for count, end in zip(bars, np.cumsum(bars), strict=True):
        ceiling = floors[end - count] + tall[end - count]
        x, y = total - RIGHT + BAR_GAP, floors[end - 1]
        columns.append(place(x, y, BAR_WIDTH, ceiling - y))
    return fig, axes, columns
