"""Axes, material points and walls, the parts of all pictures. No pyplot, no global state."""

import io
import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike, NDArray

from granular.checks import finite, integer
from granular.geometry import AXES, Grid
from granular.mpm.walls import Solid, Wall
from granular.plot.fields import Brush
from granular.sph.walls import Wall as LayerWall
from granular.state import State
from granular.typing import AnyScene

Extent = tuple[tuple[float, float], tuple[float, float]]

WALL_STYLES = {
    "no_slip": {"color": "black", "linewidth": 2.5},
    "free_slip": {"color": "#555555", "linewidth": 1.2},
    "coulomb": {"color": "black", "linewidth": 2.5, "linestyle": (0, (3, 1))},
}
SYMMETRY_STYLE = {"color": "#555555", "linewidth": 1.2, "linestyle": (0, (5, 3))}
OUTLET_STYLE = {"color": "#1a8f3c", "linewidth": 1.5, "linestyle": (0, (1, 1.5))}


class Picture(Figure):
    """A matplotlib figure that needs no backend and shows itself in a notebook."""

    def _repr_png_(self) -> bytes:
        data = io.BytesIO()
        self.savefig(data, format="png", dpi=100)
        return data.getvalue()


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
        Interval of the third coordinate whose points are kept [m]; in 3D only.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    def __init__(
        self,
        dim: int,
        axes: tuple[int, int] | None = None,
        slab: tuple[float, float] | None = None,
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
    def labels(self) -> tuple[str, str]:
        """Names of the two axes."""
        return f"{AXES[self.across]} [m]", f"{AXES[self.up]} [m]"

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

    def extent(self, states: Sequence[State]) -> Extent:
        """Extent of the material of all states, with a margin, cut at the ends of the domain."""
        grid = states[0].scene.grid
        ends = []
        for axis in (self.across, self.up):
            # The floor and the plane of symmetry belong in the picture: fills begin there.
            low, high = math.inf, -math.inf
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

    def set_up(self, ax: Axes, extent: Extent, cell: float) -> None:
        """Set equal scales, limits and labels, with a small margin beyond walls at the ends."""
        (left, right), (bottom, top) = extent
        edge = 0.35 * cell
        ax.set_aspect("equal")
        ax.set_xlim(left - edge, right + edge)
        ax.set_ylim(bottom - edge, top + edge)
        ax.set_xlabel(self.labels[0])
        ax.set_ylabel(self.labels[1])
        # The frame of the picture must not be taken for a wall.
        ax.spines[:].set_color("0.8")


def figure_of(ax: Axes) -> Figure:
    """The figure of axes that lie in no part of a figure."""
    return cast(Figure, ax.figure)


def diameter(state: State) -> float:
    """Diameter of a point in a picture [m]: the diagonal of the initial spacing, without gaps."""
    scene = state.scene
    per_cell = max(fill.points_per_cell for fill in scene.fills)
    return math.sqrt(2) * scene.grid.cell / per_cell ** (1 / state.dim)


def discs(ax: Axes, diameters: ArrayLike, places: ArrayLike, **style: Any) -> EllipseCollection:
    """Draw discs of true size: diameters [m], positions of the middles [m], shape (n, 2)."""
    artist = EllipseCollection(
        diameters,
        diameters,
        np.zeros_like(diameters),
        units="x",
        offsets=places,
        offset_transform=ax.transData,
        **style,
    )
    ax.add_collection(artist, autolim=False)
    return artist


class Points:
    """The material points drawn in an axes: discs of true size, which can show another state.

    Parameters
    ----------
    ax : Axes
        Axes to draw into.
    state : State
    brush : Brush
        Colours of the points.
    view : View
    size : float, optional
        Diameter of a point [m]; by default the diagonal of the initial spacing.
    """

    def __init__(
        self, ax: Axes, state: State, brush: Brush, view: View, *, size: float | None = None
    ) -> None:
        self.brush, self.view = brush, view
        size = diameter(state) if size is None else size
        style = {"linewidths": 0, "norm": brush.norm, "cmap": brush.cmap, "zorder": 2}
        self.artist = discs(ax, [size], np.zeros((0, 2)), **style)
        self.update(state)

    def update(self, state: State) -> None:
        """Show another state."""
        self.artist.set_offsets(self.view.places(state))
        self.artist.set_array(self.brush.paint(state)[self.view.order(state)])


def color_bar(fig: Figure, artist: Any, brush: Brush, **options: Any) -> None:
    """Add a colour bar with label and unit, or with two names for a field of two values.

    `options` are those of matplotlib: `ax` to take the place from, or `cax` to fill.
    """
    bar = fig.colorbar(artist, **options)
    if brush.quantity.two:
        bar.set_ticks([0.25, 0.75], labels=["disconnected", "dense"])
        bar.ax.tick_params(length=0, labelrotation=90)
        for text in bar.ax.get_yticklabels():
            text.set_verticalalignment("center")
    bar.set_label(brush.quantity.title, fontsize="small")
    bar.ax.tick_params(labelsize="small")


def _is_symmetry(scene: AnyScene, wall: Wall) -> bool:
    cut = scene.parameters.get("half") or scene.parameters.get("quarter")
    return (
        bool(cut)
        and wall.kind == "free_slip"
        and wall.axis < scene.grid.dim - 1
        and (wall.at == 0.0)
    )


def _line(scene: AnyScene, wall: Wall, view: View, style: dict[str, Any]) -> Line2D:
    other = view.up if wall.axis == view.across else view.across
    ends = wall.extent(scene.grid, other)
    at = (wall.at, wall.at)
    x, y = (at, ends) if wall.axis == view.across else (ends, at)
    return Line2D(x, y, solid_capstyle="butt", zorder=3, **style)


def _block(
    ax: Axes, lower: Sequence[float] | NDArray, upper: Sequence[float] | NDArray, view: View
) -> Artist:
    x, y = lower[view.across], lower[view.up]
    size = upper[view.across] - x, upper[view.up] - y
    # Faces of abutting blocks must not show as seams.
    block = Rectangle((x, y), *size, facecolor="#9a9a9a", edgecolor="#9a9a9a", zorder=1)
    return ax.add_patch(block)


def _layers(ax: Axes, grid: Grid, wall: LayerWall, view: View) -> tuple[Artist, float, float]:
    """Draw a wall of an SPH scene, see `granular.sph.Wall`."""
    lower, upper = np.array(wall.box("wall", grid))
    ends = (
        np.where(np.isinf(lower), grid.lower, lower),
        np.where(np.isinf(upper), grid.upper, upper),
    )
    moves = wall.moves_from if any(wall.velocity or ()) else math.inf
    return _block(ax, *ends, view), -math.inf, min(moves, wall.until)


def scenery(ax: Axes, scene: AnyScene, view: View) -> list[tuple[Artist, float, float]]:
    """Draw the walls, blocks and outlets of a scene.

    Walls of kind "no_slip" are thick, those of kind "free_slip" thin, and planes of symmetry
    dashed; an outlet is dotted once it is open. Walls made of layers of particles are drawn as
    blocks, until they move or vanish.

    Returns
    -------
    list of (artist, begin, end)
        Each artist is visible from `begin` until just before `end` [s].
    """
    parts: list[tuple[Artist, float, float]] = []
    for wall in scene.walls:
        if isinstance(wall, Solid):
            parts.append((_block(ax, wall.lower, wall.upper, view), -math.inf, math.inf))
        elif wall.axis not in (view.across, view.up):
            continue
        elif isinstance(wall, LayerWall):
            parts.append(_layers(ax, scene.grid, wall, view))
        else:
            style = SYMMETRY_STYLE if _is_symmetry(scene, wall) else WALL_STYLES[wall.kind]
            line = ax.add_line(_line(scene, wall, view, style))
            parts.append((line, -math.inf, wall.opens_at))
            if wall.opens_at < math.inf:
                outlet = ax.add_line(_line(scene, wall, view, OUTLET_STYLE))
                parts.append((outlet, wall.opens_at, math.inf))
    return parts


def show_at(parts: list[tuple[Artist, float, float]], time: float) -> None:
    """Show the artists that are visible at a time, and hide the others."""
    for artist, begin, end in parts:
        artist.set_visible(begin <= time < end)
