"""A picture of a scene before it is run, with a legend."""

import math
from collections.abc import Iterable
from typing import Any, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray

from granular.model.fill import Fill, rest_density
from granular.model.grid import AXES
from granular.model.inflow import Inflow
from granular.model.state import State
from granular.model.typing import AnyScene
from granular.plot.bodies import STYLE, Bodies, boxes_of_bodies
from granular.plot.canvas import Extent, Picture, View, checked_extent, figure_of, is_symmetry
from granular.plot.scenery import (
    AXIS_STYLE,
    BLOCK,
    OUTLET_STYLE,
    SYMMETRY_STYLE,
    drawn,
    seen,
    style_of,
)

WIDTH = 7.0
"""Width of a picture [inches]."""
PIXELS = 800
"""Pixels of the fills along the longer side of the domain."""
FILLS = ("#d8b26e", "#c98f5a", "#a7a35c", "#b98f8f", "#8f7f6a", "#e3cf9f")
GAS = "#cfe3f2"
MOVING = {**STYLE, "facecolor": "#b9c8de"}
SPONGE = {"facecolor": "none", "edgecolor": "#7a6fae", "hatch": "....", "linewidth": 0.0}
INLET = {"facecolor": "none", "edgecolor": "#b35900", "hatch": "\\\\", "linewidth": 1.2}
PERIODIC_STYLE = {"color": "#2d5d8f", "linewidth": 1.5, "linestyle": (0, (6, 2, 1, 2))}
OPEN_STYLE = {"color": "#1a8f3c", "linewidth": 1.5, "linestyle": (0, (4, 2))}
SIDE_STYLE = {"color": "0.75", "linewidth": 0.8}
ARROW = {"arrowstyle": "-|>", "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}

Key = tuple[str, Artist]
"""Text and artist of an entry of the legend."""


def scene(
    scene: AnyScene,
    *,
    ax: Axes | None = None,
    extent: Extent | None = None,
    view: tuple[int, int] | None = None,
    slab: tuple[float, float] | None = None,
    title: str | None = None,
) -> Figure:
    """Draw a scene before it is run: fills, bodies, walls by kind, sides of the domain, gravity.

    In 3D fills and bodies are shown in the section halfway through the slab. Without one it is the
    plane of symmetry, if there is one, or it is halfway through the domain.

    Parameters
    ----------
    scene : Scene or sph.Scene
    ax : Axes, optional
        Axes to draw into; by default the axes of a new figure.
    extent : ((left, right), (bottom, top)), optional
        Region that is shown [m]; by default the domain.
    view : (int, int), optional
        In 3D, the axes to the right and up.
    slab : (low, high), optional
        In 3D, ends along the third axis [m] of the slab whose middle is shown.
    title : str, optional
        Title of the axes; by default name and cells of the scene.

    Returns
    -------
    Figure
        The figure of `ax`.
    {raises}.
    """
    if isinstance(scene, State) or not hasattr(scene, "fills"):
        raise TypeError(f"scene = {scene!r} must be a scene; a state is drawn by plot.frame")
    window, grid = View(scene.dim, view, slab), scene.grid
    box = _whole(scene, window) if extent is None else checked_extent(extent)
    is_new = ax is None
    if ax is None:
        (left, right), (bottom, top) = box
        height = (WIDTH - 0.8) * (top - bottom) / (right - left) + 1.6
        figure = Picture(figsize=(WIDTH, min(max(height, 2.4), 9.0)), layout="compressed")
        ax = figure.add_subplot()
    window.set_up(ax, box, grid)
    margins = ax.get_xlim(), ax.get_ylim()
    keys = [
        *_draw_fills(ax, scene, window, box),
        *_draw_inflows(ax, scene, window, box),
        *_draw_bodies(ax, scene, window, box),
        *_draw_sponges(ax, scene, window),
        *_draw_walls(ax, scene, window),
        *_draw_sides(ax, scene, window),
    ]
    ax.set(xlim=margins[0], ylim=margins[1])
    _draw_gravity(ax, scene, window)
    cells = " x ".join(map(str, grid.shape))
    ax.set_title(f"{scene.name}: {cells} cells of {grid.cell:g} m" if title is None else title)
    named = dict(reversed(keys))  # one entry for each text, that of its first artist
    texts = [text for text in dict.fromkeys(text for text, _ in keys)]
    handles = [cast(Any, named[text]) for text in texts]
    if is_new:
        outside = {"loc": "outside lower center", "ncols": 3, "frameon": False}
        figure_of(ax).legend(handles, texts, **cast(Any, outside))
    else:
        ax.legend(handles, texts)
    return figure_of(ax)


def _whole(scene: AnyScene, view: View) -> Extent:
    """Extent of the domain, and of bodies that begin or end beyond it."""
    grid, poses = scene.grid, [body.at_start() for body in scene.bodies]
    boxes = list(boxes_of_bodies(scene, poses, view, beyond=0.5))
    ends = []
    for place, axis in enumerate((view.across, view.up)):
        low = min(grid.lower[axis], *(box[place][0] for box in boxes), math.inf)
        high = max(grid.upper[axis], *(box[place][1] for box in boxes), -math.inf)
        ends.append((low, high))
    return ends[0], ends[1]


def _draw_fills(ax: Axes, scene: AnyScene, view: View, extent: Extent) -> Iterable[Key]:
    gas = getattr(scene, "gas", None)
    for fill in gas.fills if gas else ():
        _draw_fill(ax, scene, fill, view, extent, GAS)
        yield "gas", Patch(facecolor=GAS)
    for i, fill in enumerate(scene.fills):
        colour = FILLS[i % len(FILLS)]
        _draw_fill(ax, scene, fill, view, extent, colour)
        text = "material" if len(scene.fills) == 1 else f"fills[{i}]"
        if fill.velocity is not None and any(fill.velocity):
            text += f", {math.hypot(*fill.velocity):.3g} m/s"
        yield text, Patch(facecolor=colour)


def _draw_inflows(ax: Axes, scene: AnyScene, view: View, extent: Extent) -> Iterable[Key]:
    inflows: tuple[Inflow, ...] = getattr(scene, "inflows", ())
    for i, inflow in enumerate(inflows):
        rho = rest_density(inflow.material or scene.material, inflow.packing)
        lower, upper = (np.array(corner) for corner in inflow.region.bounds)
        x, y = lower[view.across], lower[view.up]
        size = upper[view.across] - x, upper[view.up] - y
        ax.add_patch(Rectangle((x, y), *size, zorder=3.0, **cast(Any, INLET)))
        middle = 0.5 * (lower + upper)
        _arrow(ax, middle, np.array(inflow.velocity), view, extent, str(INLET["edgecolor"]))
        kind = "driven inflow" if inflow.driven else "inflow"
        speed = math.hypot(*inflow.velocity)
        text = f"{kind}, {inflow.rate_in(scene.grid, rho):.3g} kg/s at {speed:.3g} m/s"
        yield text if len(inflows) == 1 else f"{text} [{i}]", Patch(**cast(Any, INLET))


def _draw_fill(
    ax: Axes, scene: AnyScene, fill: Fill, view: View, extent: Extent, colour: str
) -> None:
    pixel = max(high - low for low, high in extent) / PIXELS
    x, y = (
        np.linspace(low, high, max(2, round((high - low) / pixel)), endpoint=False)
        for low, high in extent
    )
    x, y = x + 0.5 * (x[1] - x[0]), y + 0.5 * (y[1] - y[0])
    across, up = (part.ravel() for part in np.meshgrid(x, y))
    inside = fill.region.contains(view.in_space(scene, across, up)).reshape(len(y), len(x))
    if inside.any():
        ax.contourf(x, y, inside.astype(float), levels=[0.5, 2.0], colors=[colour], zorder=0.5)


def _draw_bodies(ax: Axes, scene: AnyScene, view: View, extent: Extent) -> Iterable[Key]:
    bodies = scene.bodies
    poses = [body.at_start() for body in bodies]
    drawn = Bodies(ax, scene, poses, view, extent)
    for body, pose, artist in zip(bodies, poses, drawn.artists, strict=True):
        artist.set_zorder(2.5)
        moves = bool(body.free) or bool(body.motion.rows()[:, 1:].any())
        if moves:
            artist.set_facecolor(str(MOVING["facecolor"]))
        label = "body that moves" if moves else "body at rest"
        yield label, Patch(**cast(Any, MOVING if moves else STYLE))
        velocity = (
            pose.velocity if pose.velocity.any() else body.motion.rows()[-1, 1 : 1 + body.dim]
        )
        _arrow(ax, np.asarray(pose.position), velocity, view, extent, "#2d4f86")


def _arrow(
    ax: Axes, start: NDArray, along: NDArray, view: View, extent: Extent, colour: str
) -> None:
    """Draw an arrow of an eighth of the picture from a point in the picture."""
    size = float(np.hypot(along[view.across], along[view.up]))
    if size == 0:
        return
    at = np.array([start[view.across], start[view.up]])
    if not all(low <= place <= high for place, (low, high) in zip(at, extent, strict=True)):
        return
    length = 0.12 * max(high - low for low, high in extent)
    end = at + length * np.array([along[view.across], along[view.up]]) / size
    ax.annotate("", tuple(end), tuple(at), arrowprops=ARROW | {"color": colour}, zorder=4)


def _draw_sponges(ax: Axes, scene: AnyScene, view: View) -> Iterable[Key]:
    for sponge in getattr(scene, "sponge_layers", ()):
        if sponge.axis in (view.across, view.up):
            lower, upper = np.array(scene.grid.lower), np.array(scene.grid.upper)
            lower[sponge.axis] = sponge.above
            x, y = lower[view.across], lower[view.up]
            size = upper[view.across] - x, upper[view.up] - y
            ax.add_patch(Rectangle((x, y), *size, zorder=0.7, **cast(Any, SPONGE)))
            yield "sponge layer", Patch(**cast(Any, SPONGE))


def _draw_walls(ax: Axes, scene: AnyScene, view: View) -> Iterable[Key]:
    for wall in seen(scene, view):
        if not wall.is_flat:
            drawn(ax, scene, wall, view, {})
            yield wall.in_words(), Patch(facecolor=BLOCK)
        elif is_symmetry(scene, wall):
            yield "plane of symmetry", drawn(ax, scene, wall, view, SYMMETRY_STYLE)
        else:
            style = OUTLET_STYLE if wall.gone_from < math.inf else style_of(scene, wall)
            yield wall.in_words(), drawn(ax, scene, wall, view, style)


def _draw_sides(ax: Axes, scene: AnyScene, view: View) -> Iterable[Key]:
    """Draw the sides of the domain that have no wall all along them: open, periodic, or closed."""
    grid = scene.grid
    for axis in (view.across, view.up):
        other = view.up if axis == view.across else view.across
        for end, at in (("-", grid.lower[axis]), ("+", grid.upper[axis])):
            ends = (grid.lower[other], grid.upper[other])
            places = ((at, at), ends) if axis == view.across else (ends, (at, at))
            text, style = "closed side", SIDE_STYLE
            if AXES[axis] + end in grid.open_sides:
                text, style = "open side", OPEN_STYLE
            elif grid.has_axis and axis == 0 and end == "-":
                text, style = "axis of symmetry", AXIS_STYLE
            elif grid.periodic[axis]:
                text, style = "periodic side", PERIODIC_STYLE
            elif any(wall.axis == axis and at in wall.extent(grid, axis) for wall in scene.walls):
                continue
            line = Line2D(*places, zorder=2.8, **cast(Any, style))
            ax.add_line(line)
            yield text, line


def _draw_gravity(ax: Axes, scene: AnyScene, view: View) -> None:
    """Draw an arrow in the corner, with the size of gravity at the end of its ramp."""
    g = np.array(scene.gravity.vectors[-1])
    size = float(np.linalg.norm(g))
    if size == 0:
        return
    along = np.array([g[view.across], g[view.up]]) / size
    start = np.array([0.93, 0.9]) if along[0] <= 0.5 else np.array([0.85, 0.9])
    box = ax.get_position()
    figure = figure_of(ax).get_size_inches()
    inches = figure * [box.width, box.height]
    end = start + 0.45 * along / np.maximum(inches, 1.0)
    places = {"xycoords": "axes fraction", "textcoords": "axes fraction"}
    style = ARROW | {"color": "#b3261e"}
    ax.annotate("", tuple(end), tuple(start), arrowprops=style, zorder=5, **cast(Any, places))
    text = f"g = {size:.3g} m/s$^2$"
    ax.text(
        start[0] - 0.015, start[1], text, transform=ax.transAxes, ha="right", va="center",
        color="#b3261e", zorder=5,
    )  # fmt: skip
