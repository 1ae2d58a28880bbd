"""A picture of one state."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from granular.model.state import State
from granular.plot.bodies import Bodies, boxes_of_bodies
from granular.plot.canvas import Extent, Picture, View, checked_extent, color_bar, figure_of
from granular.plot.fields import Brush, Color
from granular.plot.material import PIXELS, Material
from granular.plot.scenery import scenery, show_at
from granular.tools.checks import positive

WIDTH = 7.0
"""Width of a picture [inches]."""
LOW = 0.4
"""Height by width below which a picture has its colour bar below it."""


def frame(
    state: State,
    color: Color = "shear_rate",
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
    """Draw the material of a state, with its bodies, walls, blocks and outlets.

    The material is an area without gaps, coloured by interpolation between neighbouring points, or
    by the nearest point for a number that has no values between (the material, the phase). The
    distance of its free surface from the points follows from their volumes, and a single point is a
    disc of its volume. Bodies are drawn in their poses at the time of the state.

    Parameters
    ----------
    color : str, array_like, shape (n,), or callable
        A field: stored ("shear_rate", "log_density", ...), a component ("v_x", "stress_xy"),
        or derived ("pressure", "speed", "density", "shear_stress", "mu", "inertial_number",
        "dense", ..., see `granular.measure.derived`), one number per point, or a function of the
        state that returns them.
    ax : Axes, optional
        Axes to draw into; by default the axes of a new figure.
    limits : (low, high), optional
        Limits of the colour scale; by default they fit the state.
    log : bool, optional
        True for a logarithmic scale, the default for rates and inertial numbers. Zero counts as its
        low end.
    cmap, label : str, optional
        Colour map and text of the colour bar.
    smooth : bool
        Draw the field after mapping it to the nodes and back, as Dunatunga & Kamrin 2015 do with
        stresses (eqs. 4.1-4.3).
    size : float, optional
        Diameter of a point [m], > 0, to draw the points as discs.
    extent : ((left, right), (bottom, top)), optional
        Region that is shown [m]; by default it contains all the material, and all surfaces of
        bodies that close within the domain.
    view : (int, int), optional
        In 3D, the axes to the right and up. The points are projected as discs, with the gaps
        closed; nearer points (at the low end of the third axis) cover farther ones. Bodies are
        drawn behind them, in the section of the plane of symmetry, or if there is none halfway
        through the domain.
    slab : (low, high), optional
        In 3D, draw only the slice of material between these coordinates along the third axis [m],
        and the section of the bodies halfway through it.
    bar : bool
        True to add a colour bar.
    title : str, optional
        Title of the axes; by default the time.

    Returns
    -------
    Figure
        The figure of `ax`; its `savefig` needs no backend.
    {raises}.
    """
    if not isinstance(state, State):
        raise TypeError(f"state = {state!r} must be a State, such as `simulation.state`")
    brush = Brush.fitted(
        [state], color, limits=limits, log=log, cmap=cmap, label=label, smooth=smooth
    )
    window = View(state.dim, view, slab)
    box = fitted_extent([state], window) if extent is None else checked_extent(extent)
    side = "right"
    if ax is None:
        ax, side = new_axes(box), bar_side(box)
    Drawing(ax, state, brush, window, box, size=size)
    ax.set_title(f"t = {state.time:.3g} s" if title is None else title)
    if bar:
        color_bar(figure_of(ax), brush, ax=ax, location=side)
    return figure_of(ax)


def fitted_extent(states: Sequence[State], view: View) -> Extent:
    """Extent of the material and of the bodies of all states."""
    boxes = [boxes_of_bodies(state.scene, state.bodies, view) for state in states]
    return view.extent(states, [box for of_state in boxes for box in of_state])


def bar_side(extent: Extent) -> str:
    """Side of a picture for the colour bar: below one that is long and low."""
    (left, right), (bottom, top) = extent
    return "right" if top - bottom > LOW * (right - left) else "bottom"


def new_axes(extent: Extent) -> Axes:
    """Make the axes of a new figure whose shape suits the extent."""
    (left, right), (bottom, top) = extent
    ratio = (top - bottom) / (right - left)
    # Besides the axes there are labels and the title above, and the colour bar next to it or below.
    wide, high = (1.6, 0.9) if bar_side(extent) == "right" else (0.7, 1.5)
    height = min(max((WIDTH - wide) * ratio + high, 1.9), 9.0)
    return Picture(figsize=(WIDTH, height), layout="compressed").add_subplot()


class Drawing:
    """A state drawn in an axes: material, bodies and walls. It can show another state.

    Parameters
    ----------
    ax : Axes
        Axes to draw into.
    state : State
    brush : Brush
        Colours of the material.
    view : View
    extent : ((left, right), (bottom, top))
        Region to draw [m].
    size : float, optional
        Diameter of the points [m], if they are to be discs.
    pixels : int
        Pixels along the longer side of the region.
    """

    def __init__(
        self,
        ax: Axes,
        state: State,
        brush: Brush,
        view: View,
        extent: Extent,
        *,
        size: float | None = None,
        pixels: int = PIXELS,
    ) -> None:
        if size is not None:
            positive("size", size)
        view.set_up(ax, extent, state.scene.grid)
        self._parts = scenery(ax, state.scene, view)
        self._bodies = Bodies(ax, state.scene, state.bodies, view, extent, pixels)
        self._material = Material(ax, state, brush, view, extent, size=size, pixels=pixels)
        show_at(self._parts, state.time)

    @property
    def artists(self) -> list[Artist]:
        """All artists, in the order in which they cover each other."""
        walls = (artist for artist, _, _ in self._parts)
        bodies = [*self._bodies.artists, *self._bodies.marks]
        return sorted([*walls, self._material.artist, *bodies], key=Artist.get_zorder)

    def update(self, state: State) -> None:
        """Show another state."""
        self._material.update(state)
        self._bodies.update(state.bodies)
        show_at(self._parts, state.time)
