"""Walls, blocks and outlets in a picture."""

import math
from collections.abc import Iterator
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from granular.model.boundary import Boundary
from granular.model.typing import AnyScene
from granular.plot.canvas import View, is_symmetry

WALL_STYLES = {
    "sticks": {"color": "black", "linewidth": 2.5},
    "slips": {"color": "#555555", "linewidth": 1.2},
    "rubs": {"color": "black", "linewidth": 2.5, "linestyle": (0, (3, 1))},
}
AXIS_STYLE: dict[str, Any] = {
    "color": "#555555",
    "linewidth": 1.2,
    "linestyle": (0, (8, 2, 1, 2)),
}
SYMMETRY_STYLE = {"color": "#555555", "linewidth": 1.2, "linestyle": (0, (5, 3))}
BLOCK = "#9a9a9a"
"""Colour of blocks and of walls of particles."""
OUTLET_STYLE = {"color": "#1a8f3c", "linewidth": 1.5, "linestyle": (0, (1, 1.5))}


def style_of(scene: AnyScene, wall: Boundary) -> dict[str, Any]:
    """Style of the line of a flat wall."""
    if is_symmetry(scene, wall):
        return SYMMETRY_STYLE
    return WALL_STYLES["slips" if wall.slips else "rubs" if wall.rubs else "sticks"]


def drawn(ax: Axes, scene: AnyScene, wall: Boundary, view: View, style: dict[str, Any]) -> Artist:
    """Draw a flat wall as a line of a style, anything else as a block."""
    lower, upper = wall.corners(scene.grid)
    places = [(lower[axis], upper[axis]) for axis in (view.across, view.up)]
    if wall.is_flat:
        return ax.add_line(Line2D(*places, solid_capstyle="butt", zorder=3, **style))
    (x, right), (y, top) = places
    size = right - x, top - y
    # Faces of abutting blocks must not show as seams.
    return ax.add_patch(Rectangle((x, y), *size, facecolor=BLOCK, edgecolor=BLOCK, zorder=1))


def seen(scene: AnyScene, view: View) -> Iterator[Boundary]:
    """Walls and blocks of a scene that are drawn: no walls in the plane of the picture."""
    for wall in scene.walls:
        if wall.axis in (None, view.across, view.up):
            yield wall


def scenery(ax: Axes, scene: AnyScene, view: View) -> list[tuple[Artist, float, float]]:
    """Draw the walls, blocks and outlets of a scene.

    Walls of kind "no_slip" are thick, those of kind "free_slip" thin, planes of symmetry dashed and
    axes of symmetry dash-dotted; an outlet is dotted once it is open. Walls made of layers of
    particles are drawn as blocks, until they move or vanish.

    Returns
    -------
    list of (artist, begin, end)
        Each artist is visible from `begin` until just before `end` [s].
    """
    parts: list[tuple[Artist, float, float]] = []
    if scene.grid.has_axis:
        axis = Line2D(
            [0.0, 0.0], [scene.grid.lower[1], scene.grid.upper[1]], zorder=3, **AXIS_STYLE
        )
        parts.append((ax.add_line(axis), -math.inf, math.inf))
    for wall in seen(scene, view):
        style = style_of(scene, wall) if wall.is_flat else {}
        parts.append((drawn(ax, scene, wall, view, style), -math.inf, wall.gone_from))
        if wall.is_flat and wall.gone_from < math.inf:
            outlet = drawn(ax, scene, wall, view, OUTLET_STYLE)
            parts.append((outlet, wall.gone_from, math.inf))
    return parts


def show_at(parts: list[tuple[Artist, float, float]], time: float) -> None:
    """Show the artists that are visible at a time, and hide the others."""
    for artist, begin, end in parts:
        artist.set_visible(begin <= time < end)
