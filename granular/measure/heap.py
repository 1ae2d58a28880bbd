"""Heaps: the free surface, the run-out of a collapse, the angle of repose."""

import warnings
from dataclasses import dataclass

import numpy as np

from granular.measure.averaging_grid import require_points
from granular.measure.result import Result
from granular.model.state import State
from granular.tools.arrays import Array
from granular.tools.checks import finite, integer, one_of, positive

QUANTILE = 0.999
"""Share of the mass within the run-out; the position of the farthest point alone is noise."""

TOE = (0.05, 0.30)
"""Heights, as shares of the largest, between which the toe is extrapolated."""

SLOPE = (0.20, 0.80)
"""Heights, as shares of the largest, between which the slope is fitted."""

WINDOW = 5
"""Default number of columns of the steepest piece of a slope."""


@dataclass(frozen=True)
class Surface(Result, x="m", top="m", top_x="m", height="m", base="m", width="m"):
    """The free surface, column by column; nan (height 0) where a column is empty.

    Attributes
    ----------
    x : ndarray, shape (k,)
        Centres of the columns [m]; in 3D the middle radii of rings about the axis.
    top : ndarray, shape (k,)
        Elevation [m] of the highest point of the column plus half a point spacing.
    top_x : ndarray, shape (k,)
        Position of that point along the abscissa [m].
    height : ndarray, shape (k,)
        Height [m] that the column's mass would have at rho_c.
    base : float
        Elevation from which heights are counted [m].
    width : float
        Width of a column [m].
    """

    x: Array
    top: Array
    top_x: Array
    height: Array
    base: float
    width: float


@dataclass(frozen=True)
class Runout(Result):
    """Run-out ``(final half-width - initial)/initial``, measured in three ways.

    Attributes
    ----------
    quantile : float
        Run-out of the distance within which 99.9 % of the mass lies. A few points thrown ahead
        decide it: between seedings of a column it scatters by 2 to 6 %.
    toe : float
        Run-out of the toe: a line through the column heights (by mass) between 5 and 30 % of the
        largest is extended to zero height; nan if fewer than two columns are in that band, as
        before a collapse. Between seedings it scatters by 1.5 %.
    contiguous : float
        Run-out of the outer edge of the columns that are connected to the highest one and have a
        height (by mass) of at least a quarter of a cell.
    """

    quantile: float
    toe: float
    contiguous: float


@dataclass(frozen=True)
class Repose(Result, mean_deg="deg", largest_deg="deg"):
    """Slope of a heap [deg].

    Attributes
    ----------
    mean_deg : float
        Slope of the line through the surface between 20 and 80 % of its height [deg].
    largest_deg : float
        Slope of the steepest line through `window` successive columns within that band (through
        all of them if there are fewer).
    columns : int
        Number of columns fitted.
    """

    mean_deg: float
    largest_deg: float
    columns: int


def surface(
    state: State,
    *,
    region: tuple[float, float] | None = None,
    above: float | None = None,
    below: float | None = None,
    along: str = "radius",
) -> Surface:
    """Free surface over the columns of cells (2D) or over rings about the axis (3D).

    Parameters
    ----------
    region : (x0, x1), optional
        Use the points with x0 <= x < x1 [m] (radii in 3D).
    above, below : float, optional
        Use the points with elevations from `above` to `below` [m], for example the crater or the
        lower heap of an hourglass. Heights are counted from `above` if given, otherwise from the
        floor of the grid.
    along : {"radius", "x"}
        Coordinate of the columns in 3D: "x" takes columns over the whole depth of the grid, for
        heaps between parallel walls. In 2D columns are always along x.

    Raises
    ------
    ValueError
        If the state is empty or no point is in the region.
    """
    require_points(state)
    grid = state.scene.grid
    straight = one_of("along", along, ("radius", "x")) == "x" or len(grid.shape) == 2
    abscissa = np.asarray(state.x)[:, 0] if straight else _distance(state, 0.0)
    low = grid.lower[0] if straight else 0.0
    keep = _selected(state, abscissa, region, above, below)
    base = float(grid.lower[-1] if above is None else above)
    count = grid.shape[0] if straight else _ring_count(abscissa, grid.cell)
    across = grid.cell * grid.shape[1] if len(grid.shape) == 3 else 1.0
    measure = np.full(count, grid.cell * across) if straight else _ring_measure(state, count, 0.0)
    return _columns(state, abscissa, keep, low=low, base=base, measure=measure)


def runout(
    state: State,
    *,
    half_width: float | None = None,
    centre: float = 0.0,
    above: float | None = None,
) -> Runout:
    """Run-out of a collapsed column, divided by its initial half-width.

    The half-width is the distance from the plane x = `centre` (in 3D from the vertical axis
    through the origin). Halves and quarters cut by symmetry planes at the centre are recognised by
    the grid's lower corner. ``max(x)`` is not offered, because single points fly far.
    The measure is that of Dunatunga & Kamrin 2015, section 4.1. Material that is connected up to a
    side of the grid raises a warning, because its edge is then that of the grid, or of a bed below.

    Parameters
    ----------
    half_width : float, optional
        Half-width of the initial column [m]; by default the scene's parameter ``half_width`` or
        ``radius``.
    centre : float
        Centre of the initial column along x [m]; in 2D only, and on a grid line.
    above : float, optional
        Elevation [m] of the surface of a bed below the column: material below it does not count. By
        default all the material counts, from the floor of the grid on.

    Raises
    ------
    ValueError
        If the state is empty, no point is above, or the half-width is unknown or not positive.
    """
    require_points(state)
    finite("centre", centre)
    half = _half_width(state, half_width)
    grid = state.scene.grid
    distance = _distance(state, centre)
    keep = _selected(state, distance, None, above, None)
    count = _ring_count(distance[keep], grid.cell)
    measure = _ring_measure(state, count, centre)
    base = float(grid.lower[-1] if above is None else above)
    columns = _columns(state, distance, keep, low=0.0, base=base, measure=measure)
    heights = columns.height
    edge = columns.width * _run(heights >= columns.width / 4, int(np.argmax(heights)))
    side = min(min(distances) for _, distances in _sides(state, centre))
    if edge > side - grid.cell / 2:
        warnings.warn(
            f"the material reaches the side of the grid, {side:g} m from the centre, so that its "
            "run-out is not known: of a column on a bed, give above, the elevation of the bed's "
            "surface; otherwise take a wider grid",
            stacklevel=2,
        )
    reach = (_mass_quantile(distance[keep], state.mass[keep]), _toe(columns), edge)
    return Runout(*((r - half) / half for r in reach))


def repose_angle(
    state: State,
    *,
    side: str = "auto",
    region: tuple[float, float] | None = None,
    above: float | None = None,
    below: float | None = None,
    along: str = "radius",
    window: int = WINDOW,
) -> Repose:
    """Slope of a heap or crater, from the highest point of each column of cells.

    From the highest column the surface is followed downhill until it falls below 20 % of its
    height. A line is fitted by least squares to the highest points of the columns between 20 and
    80 %. At rest the slope should not exceed ``atan(mu_s)`` (Dunatunga & Kamrin 2015, section
    4.1). For a heap on a bed give `above`, the elevation of the bed's surface.

    Parameters
    ----------
    side : {"auto", "left", "right", "both"}
        Direction downhill from the top: towards smaller x, towards larger x, the one with more
        columns ("auto"), or the mean of both (with the larger of their steepest pieces).
    region, above, below
        As in `surface`, for a heap or crater that is not the only one.
    along : {"radius", "x"}
        As in `surface`.
    window : int
        Number of columns of the steepest piece, >= 3. The positions of the highest points in their
        columns are random: with n points per cell, the slope of a piece of w columns has an error
        of about 16 deg sqrt(12/(n w (w^2 - 1))), 2.5 deg for 4 points and 5 columns.

    Raises
    ------
    TypeError, ValueError
        If the window is not an integer >= 3, the state is empty, no point is in the region, or
        fewer than 3 columns can be fitted.
    """
    one_of("side", side, ("auto", "left", "right", "both"))
    integer("window", window, 3)
    top = surface(state, region=region, above=above, below=below, along=along)
    slopes = {name: _downhill(top, name) for name in ("left", "right")}
    if side == "auto":
        side = max(("right", "left"), key=lambda name: len(slopes[name]))
    chosen = ("left", "right") if side == "both" else (side,)
    fits = [_fit_slope(top, slopes[name], name, window) for name in chosen]
    return Repose(
        mean_deg=float(np.mean([fit.mean_deg for fit in fits])),
        largest_deg=max(fit.largest_deg for fit in fits),
        columns=sum(fit.columns for fit in fits),
    )


def _half_width(state: State, given: float | None) -> float:
    parameters = state.scene.parameters
    for name in ("half_width", "radius"):
        if given is None:
            given = parameters.get(name)
    if given is None:
        raise ValueError(
            "half_width = None: the scene has no parameter half_width or radius, give it in metres"
        )
    return positive("half_width", given)


def _distance(state: State, centre: float) -> Array:
    x = np.asarray(state.x, dtype=float)
    return np.abs(x[:, 0] - centre) if x.shape[1] == 2 else np.hypot(x[:, 0], x[:, 1])


def _ring_count(distance: Array, width: float) -> int:
    return int(np.floor(distance.max() / width)) + 1


def _ring_measure(state: State, count: int, centre: float) -> Array:
    """Length (2D) or area (3D) of the floor in each ring of one cell's width.

    A symmetry plane at the centre leaves one half of the ring.
    """
    edges = state.scene.grid.cell * np.arange(count + 1)
    sides = _sides(state, centre)
    whole = np.diff(2 * edges if len(sides) == 1 else np.pi * edges**2)
    return whole / 2 ** sum(cut for cut, _ in sides)


def _sides(state: State, centre: float) -> list[tuple[bool, list[float]]]:
    """For each horizontal axis, whether a symmetry plane at the centre cuts it, and the distances
    from the centre of its other sides."""
    grid = state.scene.grid
    sides = []
    for axis, middle in enumerate((centre,) if len(grid.shape) == 2 else (0.0, 0.0)):
        low, high = grid.lower[axis], grid.lower[axis] + grid.cell * grid.shape[axis]
        cut = bool(low > middle - grid.cell / 2)
        sides.append((cut, [high - middle] if cut else [middle - low, high - middle]))
    return sides


def _selected(
    state: State,
    abscissa: Array,
    region: tuple[float, float] | None,
    above: float | None,
    below: float | None,
) -> np.ndarray:
    up = np.asarray(state.x)[:, -1]
    x0, x1 = (-np.inf, np.inf) if region is None else region
    y0 = -np.inf if above is None else finite("above", above)
    y1 = np.inf if below is None else finite("below", below)
    if not (x0 < x1 and y0 < y1):
        raise ValueError(f"region = {region}, above = {above}, below = {below}: empty range")
    keep = (abscissa >= x0) & (abscissa < x1) & (up >= y0) & (up < y1)
    if not keep.any():
        raise ValueError(f"no point within region = {region}, above = {above}, below = {below}")
    return keep


def _columns(
    state: State, abscissa: Array, keep: np.ndarray, *, low: float, base: float, measure: Array
) -> Surface:
    width = state.scene.grid.cell
    count = len(measure)
    solid = np.asarray(state.rest_section, dtype=float)[keep]
    along, up = abscissa[keep], np.asarray(state.x, dtype=float)[keep, -1]
    column = np.clip(np.floor((along - low) / width).astype(np.int64), 0, count - 1)
    # The spacing at rho_c: the volume of a disconnected point does not tell where its mass is.
    spacing = solid ** (1 / len(state.scene.grid.shape))
    order = np.argsort(up, kind="stable")
    top, top_x = np.full(count, np.nan), np.full(count, np.nan)
    top[column[order]] = (up + spacing / 2)[order]
    top_x[column[order]] = along[order]
    height = np.bincount(column, weights=solid, minlength=count) / measure
    return Surface(
        low + width * (np.arange(count, dtype=float) + 0.5), top, top_x, height, base, width
    )


def _mass_quantile(distance: Array, mass: Array) -> float:
    order = np.argsort(distance, kind="stable")
    held = np.cumsum(np.asarray(mass)[order])
    # The tolerance prevents that rounding of the sum requires one more point.
    enough = np.searchsorted(held, (QUANTILE - 1e-12) * held[-1])
    return float(distance[order[enough]])


def _run(above: np.ndarray, start: int) -> int:
    """Index after the last of the True entries that follow `start` without a gap."""
    gaps = np.flatnonzero(~above[start:])
    return len(above) if len(gaps) == 0 else start + int(gaps[0])


def _toe(columns: Surface) -> float:
    h = columns.height
    crest = int(np.argmax(h))
    end = _run(h >= TOE[0] * h[crest], crest)
    band = np.arange(crest, end)
    band = band[h[band] <= TOE[1] * h[crest]]
    if len(band) < 2:
        return float("nan")
    slope, level = np.polyfit(columns.x[band], h[band], 1)
    return float(-level / slope) if slope < 0 else float("nan")


def _downhill(columns: Surface, side: str) -> np.ndarray:
    """Columns in the band of heights on one side of the highest column, from top to bottom."""
    h = columns.top - columns.base
    crest = int(np.nanargmax(h))
    step = 1 if side == "right" else -1
    walk = np.arange(crest, len(h) if step > 0 else -1, step)
    with np.errstate(invalid="ignore"):
        walk = walk[: _run(h[walk] >= SLOPE[0] * h[crest], 0)]
    return walk[h[walk] <= SLOPE[1] * h[crest]]


def _fit_slope(columns: Surface, band: np.ndarray, side: str, window: int) -> Repose:
    if len(band) < 3:
        raise ValueError(
            f"side = {side!r}: {len(band)} columns lie between {SLOPE[0]:.0%} and {SLOPE[1]:.0%} "
            "of the height, a slope needs at least 3"
        )
    x, y = columns.top_x[band], columns.top[band]
    sign = -1.0 if side == "right" else 1.0
    size = min(window, len(band))
    pieces = [slice(i, i + size) for i in range(len(band) - size + 1)]
    angle = [np.degrees(np.arctan(sign * np.polyfit(x[p], y[p], 1)[0])) for p in pieces]
    mean = np.degrees(np.arctan(sign * np.polyfit(x, y, 1)[0]))
    return Repose(float(mean), float(max(angle)), len(band))
