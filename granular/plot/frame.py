"""A picture of one state."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from granular.checks import positive
from granular.plot.canvas import (
    Extent,
    Picture,
    Points,
    View,
    color_bar,
    figure_of,
    scenery,
    show_at,
)
from granular.plot.fields import Brush
from granular.state import State

WIDTH = 7.0
"""Width of a picture [inches]."""


def frame(
    state: State,
    color: str | ArrayLike = "shear_rate",
    *,
    ax: Axes | None = None,
    limits: tuple[float, float] | None = None,
    log: bool | None = None,
    cmap: str | None = None,
    label: str | None = None,
    smooth: bool = False,
    size: float | None = None,
    extent: Extent | None = None,
    view: tuple[int, int] | None = None,
    slab: tuple[float, float] | None = None,
    bar: bool = True,
    title: str | None = None,
) -> Figure:
    """Draw the material points of a state, with walls, blocks and outlets.

    Parameters
    ----------
    state : State
    color : str or array_like, shape (n,)
        A field: stored ("shear_rate", "log_density", ...), a component ("v_x", "stress_xy"),
        derived ("p", "tau", "mu", "rho", "dense", ...), measured ("speed", "phase",
        "nodal_density", "inertial_number", ...), or one number per point.
    ax : Axes, optional
        Axes to draw into; by default those of a new figure.
    limits : (low, high), optional
        Limits of the colour scale; by default they fit the state.
    log : bool, optional
        True for a logarithmic scale, the default for rates. Zero counts as its low end.
    cmap, label : str, optional
        Colour map and text of the colour bar.
    smooth : bool
        Draw the field after mapping it to the nodes and back, as Dunatunga & Kamrin 2015 do with
        stresses (eqs. 4.1-4.3).
    size : float, optional
        Diameter of a point [m]; by default the diagonal of the initial spacing.
    extent : ((left, right), (bottom, top)), optional
        Region that is shown [m]; by default it contains all the material.
    view : (int, int), optional
        In 3D, the axes to the right and up. The points are projected; nearer points (at the low end
        of the third axis) cover farther ones.
    slab : (low, high), optional
        In 3D, draw only the slice of points between these coordinates along the third axis [m].
    bar : bool
        True to add a colour bar.
    title : str, optional
        Title of the axes; by default the time.

    Returns
    -------
    Figure
        The figure of `ax`; its `savefig` needs no backend.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """
    brush = Brush.fitted(
        [state], color, limits=limits, log=log, cmap=cmap, label=label, smooth=smooth
    )
    seen = View(state.dim, view, slab)
    box = seen.extent([state]) if extent is None else extent
    if ax is None:
        ax = new_axes(box)
    points = draw(ax, state, brush, seen, box, size=size)
    ax.set_title(f"t = {state.time:.3g} s" if title is None else title)
    if bar:
        color_bar(figure_of(ax), points.artist, brush, ax=ax)
    return figure_of(ax)


def new_axes(extent: Extent) -> Axes:
    """Make the axes of a new figure whose shape suits the extent."""
    (left, right), (bottom, top) = extent
    ratio = (top - bottom) / (right - left)
    # Besides the axes there are labels, the colour bar beside and the title above.
    height = min(max((WIDTH - 1.6) * ratio + 0.9, 2.6), 9.0)
    return Picture(figsize=(WIDTH, height), layout="compressed").add_subplot()


def draw(
    ax: Axes, state: State, brush: Brush, view: View, extent: Extent, *, size: float | None = None
) -> Points:
    """Draw the points and walls of a state into an axes."""
    if size is not None:
        positive("size", size)
    view.set_up(ax, extent, state.scene.grid.cell)
    show_at(scenery(ax, state.scene, view), state.time)
    return Points(ax, state, brush, view, size=size)
