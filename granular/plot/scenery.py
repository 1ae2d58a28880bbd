"""Walls, blocks and outlets in a picture."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from granular.model.grid import Grid
from granular.model.typing import AnyScene
from granular.mpm.walls import Solid, Wall
from granular.plot.canvas import View, is_symmetry
from granular.sph.walls import Wall as LayerWall

WALL_STYLES = {
    "no_slip": {"color": "black", "linewidth": 2.5},
    "free_slip": {"color": "#555555", "linewidth": 1.2},
    "coulomb": {"color": "black", "linewidth": 2.5, "linestyle": (0, (3, 1))},
}
SYMMETRY_STYLE = {"color": "#555555", "linewidth": 1.2, "linestyle": (0, (5, 3))}
BLOCK = "#9a9a9a"
"""Colour of blocks and of walls of particles."""
OUTLET_STYLE = {"color": "#1a8f3c", "linewidth": 1.5, "linestyle": (0, (1, 1.5))}


def line_of(scene: AnyScene, wall: Wall, view: View, style: dict[str, Any]) -> Line2D:
    """Line of a flat wall in a picture."""
    other = view.up if wall.axis == view.across else view.across
    ends = wall.extent(scene.grid, other)
    at = (wall.at, wall.at)
    x, y = (at, ends) if wall.axis == view.across else (ends, at)
    return Line2D(x, y, solid_capstyle="butt", zorder=3, **style)


def block(
    ax: Axes, lower: Sequence[float] | NDArray, upper: Sequence[float] | NDArray, view: View
) -> Artist:
    """Draw a block between two corners."""
    x, y = lower[view.across], lower[view.up]
    size = upper[view.across] - x, upper[view.up] - y
    # Faces of abutting blocks must not show as seams.
    return ax.add_patch(Rectangle((x, y), *size, facecolor=BLOCK, edgecolor=BLOCK, zorder=1))


def layers(ax: Axes, grid: Grid, wall: LayerWall, view: View) -> tuple[Artist, float, float]:
    """Draw a wall of an SPH scene, see `granular.sph.Wall`."""
    lower, upper = np.array(wall.box("wall", grid))
    ends = (
        np.where(np.isinf(lower), grid.lower, lower),
        np.where(np.isinf(upper), grid.upper, upper),
    )
    moves = wall.moves_from if any(wall.velocity or ()) else math.inf
    return block(ax, *ends, view), -math.inf, min(moves, wall.until)


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
            parts.append((block(ax, wall.lower, wall.upper, view), -math.inf, math.inf))
        elif wall.axis not in (view.across, view.up):
            continue
        elif isinstance(wall, LayerWall):
            parts.append(layers(ax, scene.grid, wall, view))
        else:
            style = SYMMETRY_STYLE if is_symmetry(scene, wall) else WALL_STYLES[wall.kind]
            line = ax.add_line(line_of(scene, wall, view, style))
            parts.append((line, -math.inf, wall.opens_at))
            if wall.opens_at < math.inf:
                outlet = ax.add_line(line_of(scene, wall, view, OUTLET_STYLE))
                parts.append((outlet, wall.opens_at, math.inf))
    return parts


def show_at(parts: list[tuple[Artist, float, float]], time: float) -> None:
    """Show the artists that are visible at a time, and hide the others."""
    for artist, begin, end in parts:
        artist.set_visible(begin <= time < end)
