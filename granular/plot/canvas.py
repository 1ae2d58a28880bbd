"""Figures, views and colour bars, the parts of all pictures. No pyplot, no global state."""

import io
import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from granular.model.boundary import Boundary
from granular.model.grid import AXES, Grid
from granular.model.state import State
from granular.model.symmetric import mirror_axes
from granular.model.typing import AnyScene
from granular.plot.fields import Brush
from granular.tools.arrays import Array
from granular.tools.checks import finite, integer

Extent = tuple[tuple[float, float], tuple[float, float]]
MARKERS = "osD^v<>ph"
"""Markers of curves, in their order."""


class Picture(Figure):
    """A matplotlib figure that needs no backend and shows itself in a notebook."""

    def _repr_png_(self) -> bytes:
        data = io.BytesIO()
        self.savefig(data, format="png", dpi=100)
        return data.getvalue()


def checked_extent(extent: object) -> Extent:
    """Check the region that a picture shows.

    Raises
    ------
    TypeError, ValueError
        If it is not ((left, right), (bottom, top)), finite and ascending.
    """
    ends = np.asarray(extent)
    if ends.shape != (2, 2) or ends.dtype.kind not in "iuf" or not np.isfinite(ends).all():
        raise ValueError(f"extent = {extent!r} must be ((left, right), (bottom, top)), finite")
    (left, right), (bottom, top) = ends.astype(float).tolist()
    if not (left < right and bottom < top):
        raise ValueError(f"extent = {extent!r} must have left < right and bottom < top")
    return (left, right), (bottom, top)


def triangles(x: Array, longest: float) -> Triangulation:
    """Triangles between points (n, 2), but those across what is not material.

    These have an edge of more than `longest` times the median.
    """
    mesh = Triangulation(*x.T)
    corners = x[mesh.triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    mesh.set_mask(edges.max(axis=1) > longest * np.median(edges))
    return mesh


def is_symmetry(scene: AnyScene, wall: Boundary) -> bool:
    """True for a wall that is the plane of symmetry of a scene of which a part is simulated."""
    axis, grid = wall.axis, scene.grid
    if axis is None or axis not in mirror_axes(scene) or not wall.slips:
        return False
    return grid.line("at", axis, wall.extent(grid, axis)[0]) == 0


class View:
    """The two axes of a picture, and its points: all of them, or those of a slab in 3D.

    Parameters
    ----------
    dim : int
        Number of dimensions, 2 or 3.
    axes : pair of int, optional
        Axes to the right and up; by default the first and the last. In 3D the line of sight is
        along the third axis.
    slab : (float, float), optional
        Interval of the third coordinate whose points are drawn [m]; in 3D only.
    {raises}.
    """

    def __init__(
        self, dim: int, axes: tuple[int, int] | None = None, slab: tuple[float, float] | None = None
    ) -> None:
        self.across, self.up = (0, dim - 1) if axes is None else axes
        integer("view[0]", self.across, 0, dim - 1)
        integer("view[1]", self.up, 0, dim - 1)
        if self.across == self.up:
            raise ValueError(f"view = {axes} must name two different axes")
        self.depth = 3 - self.across - self.up if dim == 3 else None
        self.slab = None
        if slab is not None:
            if dim != 3:
                raise ValueError(f"slab = {slab} must be None in 2D")
            self.slab = (finite("slab[0]", slab[0]), finite("slab[1]", slab[1]))
            if not self.slab[0] < self.slab[1]:
                raise ValueError(f"slab = {slab} must have its low end first")

    @property
    def projects(self) -> bool:
        """True if points of different depths lie behind one another."""
        return self.depth is not None and self.slab is None

    def in_space(self, scene: AnyScene, x: NDArray, y: NDArray) -> Array:
        """Positions [m], shape (n, dim), of points in the picture.

        In 3D they are in the section halfway through the slab; without one they are in
        the plane of symmetry, or if there is none halfway through the domain.
        """
        grid = scene.grid
        places = np.empty((len(x), grid.dim))
        places[:, self.across], places[:, self.up] = x, y
        if self.depth is not None:
            ends = self.slab or (grid.lower[self.depth], grid.upper[self.depth])
            at = 0.5 * (ends[0] + ends[1])
            if self.slab is None and any(
                wall.axis == self.depth and is_symmetry(scene, wall) for wall in scene.walls
            ):
                at = 1e-6 * grid.cell  # on the side of the material
            places[:, self.depth] = at
        return places

    def order(self, state: State) -> Any:
        """Indices of the points to draw, nearest last.

        The viewer is at the low end of the third axis.
        """
        if self.depth is None:
            return slice(None)
        third = state.x[:, self.depth]
        rows = np.argsort(-third, kind="stable")
        if self.slab is None:
            return rows
        inside = (third >= self.slab[0]) & (third <= self.slab[1])
        return rows[inside[rows]]

    def places(self, state: State) -> np.ndarray:
        """Positions of the points in the picture [m], shape (k, 2), in the order of `order`."""
        return state.x[:, (self.across, self.up)][self.order(state)]

    def extent(self, states: Sequence[State], boxes: Sequence[Extent] = ()) -> Extent:
        """Extent of the material of all states and of boxes, with a margin, within the domain."""
        grid = states[0].scene.grid
        ends = []
        for axis, place in ((self.across, 0), (self.up, 1)):
            # The floor and the plane of symmetry belong in the picture: fills begin there.
            low = min((box[place][0] for box in boxes), default=math.inf)
            high = max((box[place][1] for box in boxes), default=-math.inf)
            for state in states:
                if state.n:
                    low = min(low, float(state.x[:, axis].min()))
                    high = max(high, float(state.x[:, axis].max()))
            if low > high:
                low, high = grid.lower[axis], grid.upper[axis]
            margin = max(grid.cell, 0.04 * (high - low))
            low, high = low - margin, high + margin
            near = 0.15 * (high - low)
            low = grid.lower[axis] if low < grid.lower[axis] + near else low
            high = grid.upper[axis] if high > grid.upper[axis] - near else high
            ends.append((low, high))
        return ends[0], ends[1]

    def set_up(self, ax: Axes, extent: Extent, grid: Grid) -> None:
        """Set equal scales, limits and labels, with a small margin beyond walls at the ends."""
        (left, right), (bottom, top) = extent
        edge, names = 0.35 * grid.cell, "rz" if grid.axisymmetric else AXES
        ax.set_aspect("equal")
        ax.set_xlim(left - edge, right + edge)
        ax.set_ylim(bottom - edge, top + edge)
        ax.set_xlabel(f"{names[self.across]} [m]")
        ax.set_ylabel(f"{names[self.up]} [m]")
        # The frame of the picture must not be taken for a wall.
        ax.spines[:].set_color("0.8")


def figure_of(ax: Axes) -> Figure:
    """The figure of axes that lie in no part of a figure."""
    return cast(Figure, ax.figure)


def color_bar(fig: Figure, brush: Brush, **options: Any) -> None:
    """Add a colour bar with label and unit, or with two names for a field of two values.

    `options` are those of matplotlib: `ax` to take the space from, or `cax` to fill.
    """
    if "ax" in options:
        # A bar along a long side would be thick, as its thickness is proportional to its length.
        options = {"aspect": 30, "pad": 0.02} | options
    bar = fig.colorbar(ScalarMappable(brush.norm, brush.cmap), **options)
    if brush.quantity.two:
        bar.set_ticks([0.25, 0.75], labels=["disconnected", "dense"])
        bar.ax.tick_params(length=0, labelrotation=90 if bar.orientation == "vertical" else 0)
        for text in bar.ax.get_yticklabels():
            text.set_verticalalignment("center")
    bar.set_label(brush.quantity.title)
