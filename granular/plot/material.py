"""The material in a picture: an area without gaps, or discs of true size."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy import ndimage

from granular.model.grid import AXES
from granular.model.state import State
from granular.mpm.body_distances import distance_from_bodies
from granular.plot.canvas import Extent, View
from granular.plot.fields import Brush
from granular.tools.arrays import Array, IndexArray

if TYPE_CHECKING:
    from granular.mpm.scene import Scene


PIXELS = 1200
"""Pixels along the longer side of a picture that is not a movie."""
PER_RADIUS = 10
"""Largest number of pixels to the radius of a point: more would not be visible."""
REACH = (1.0, 1.5)
"""Half the width of the gaps that are closed, in cells and in spacings of points, the greater.

Points of a deposit at rest lie in strings: with 16 to a cell, the empty circles between them have a
radius beyond 0.25 cells at a tenth of positions and beyond 0.7 cells at a fiftieth (column
collapse).
"""


def spacing_of(state: State) -> float:
    """Mean spacing of the points [m], from their volumes now."""
    if not state.n:
        return state.scene.grid.cell
    return float(np.mean(state.section) ** (1.0 / state.dim))


def disc_radius(spacing: float, dim: int) -> float:
    """Radius of the disc (ball) that has the volume of a point [m]."""
    return spacing * (1 / math.sqrt(math.pi) if dim == 2 else (0.75 / math.pi) ** (1 / 3))


def mirror_images(state: State, view: View, reach: float) -> tuple[Array, IndexArray]:
    """Images, shape (k, 2), of points behind the sides of the domain and surfaces of bodies near.

    They close the gaps there, as between points. The second array has the rows of their points in
    `view.places`. Along a periodic axis they are the points of the next period.
    """
    grid, x = state.scene.grid, view.places(state)
    images, rows = [np.zeros((0, 2))], [np.zeros(0, dtype=np.intp)]
    for place, axis in enumerate((view.across, view.up)):
        low, high = grid.lower[axis], grid.upper[axis]
        for end, other, name in ((low, high, "-"), (high, low, "+")):
            if AXES[axis] + name in grid.open_sides:
                continue
            is_periodic = grid.periodic[axis]
            near = np.flatnonzero(abs(x[:, place] - (other if is_periodic else end)) < reach)
            image = x[near].copy()
            along = image[:, place]
            image[:, place] = along + end - other if is_periodic else 2 * end - along
            images.append(image)
            rows.append(near)
    if state.dim == 2 and state.bodies:
        scene = cast("Scene", state.scene)
        away, normal = distance_from_bodies(scene.grid, scene.bodies, state.bodies)(x)
        near = np.flatnonzero((away > 0) & (away < reach))
        images.append(x[near] - 2 * away[near][:, None] * normal[near])
        rows.append(near)
    return np.concatenate(images), np.concatenate(rows)


class Raster:
    """Pixels of a region, each with the index of the point that it shows, or -1.

    Parameters
    ----------
    extent : ((left, right), (bottom, top))
        Region [m].
    pixel : float
        Edge of a pixel [m].
    """

    def __init__(self, extent: Extent, pixel: float) -> None:
        (left, right), (bottom, top) = extent
        self.origin, self.pixel = np.array([left, bottom]), pixel
        self.counts = tuple(
            max(1, math.ceil((high - low) / pixel - 1e-6))
            for low, high in ((bottom, top), (left, right))
        )

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the pixels [m], as matplotlib takes them."""
        (left, bottom), (rows, columns) = self.origin, self.counts
        return left, left + columns * self.pixel, bottom, bottom + rows * self.pixel

    def area(self, x: Array, radius: float, reach: float) -> IndexArray:
        """Show the material as an area: the discs of the points with the gaps closed.

        A pixel shows the nearest point if it is within `reach` of one, and farther than `reach` -
        `radius` from all pixels that are not (a morphological closing). So gaps narrower than twice
        the reach are filled, while a free surface stays at the distance `radius` [m] from its
        points, and a single point is a disc.
        """
        radius = max(radius, 0.8 * self.pixel)  # a point shows at least as one pixel
        indices = self._blank(max(reach, radius))
        column, row = np.floor((x - self.origin) / self.pixel).astype(np.intp).T + indices.pad
        rows, columns = indices.pixels.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        indices.pixels[row[inside], column[inside]] = np.flatnonzero(inside)
        return indices.closed(radius / self.pixel, max(reach, radius) / self.pixel)

    def discs(self, x: Array, radius: float, reach: float = 0.0) -> IndexArray:
        """Show a disc for each point; later ones cover earlier ones.

        Gaps between discs are closed as in `area` if the reach exceeds the radius.
        """
        indices = self._blank(max(reach - radius, 0.0))
        across = max(1, math.ceil(2 * radius / self.pixel - 0.2))
        side = np.arange(across) - (across - 1) / 2
        off = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
        # Small points are squares: a disc of three pixels would be a cross.
        off = off[(off**2).sum(axis=1) <= (across / 2 + 0.3) ** 2]
        at = (x - self.origin)[:, None, ::-1] / self.pixel + off + indices.pad
        at = np.floor(at).astype(np.intp)
        inside = ((at >= 0) & (at < indices.pixels.shape)).all(axis=2)
        flat = indices.pixels.reshape(-1)
        # Of equal indices the last one remains.
        flat[(at @ [indices.pixels.shape[1], 1])[inside]] = np.nonzero(inside)[0]
        return indices.closed(0.0, (reach - radius) / self.pixel)

    def _blank(self, beyond: float) -> _Padded:
        """Empty pixels, with a margin beyond the region [m]."""
        pad = math.ceil(beyond / self.pixel) + 1
        return _Padded(np.full(tuple(n + 2 * pad for n in self.counts), -1, dtype=np.intp), pad)


@dataclass(frozen=True, eq=False)
class _Padded:
    """Pixels with a margin around them, in which there may be material too."""

    pixels: IndexArray
    pad: int

    def closed(self, radius: float, reach: float) -> IndexArray:
        """Close gaps narrower than twice the reach; the visible part grows by a radius [pixels]."""
        indices, pad = self.pixels, self.pad
        core = (slice(pad, -pad), slice(pad, -pad))
        if (indices < 0).all() or reach <= 0.0:
            return indices[core]
        away, (i, j) = ndimage.distance_transform_edt(indices < 0, return_indices=True)
        near = away <= reach
        depth = ndimage.distance_transform_edt(near) if not near.all() else np.inf
        filled = (depth > reach - radius) | (away <= radius)
        return np.where(filled, indices[i, j], -1)[core]


def blended(
    shades: np.ma.MaskedArray, filled: NDArray[np.bool_], spacing: float
) -> np.ma.MaskedArray:
    """Interpolate between points: the mean over a square as wide as their spacing [pixels].

    Over tiles of that size the mean is the linear interpolation between their centres: the points
    keep their values, so that noise from point to point stays visible. Where a point has no value,
    and outside of the material, there is nothing to take the mean of.
    """
    width = 2 * round((spacing - 1) / 2) + 1  # odd, or the mean would be half a pixel aside
    known = filled & ~np.ma.getmaskarray(shades)
    weight = ndimage.uniform_filter(known.astype(float), width, mode="nearest")
    total = ndimage.uniform_filter(np.where(known, shades.data, 0.0), width, mode="nearest")
    # A running sum rounds; the least true weight is that of one pixel.
    mean = np.divide(total, weight, out=np.zeros_like(total), where=weight > 0.5 / width**2)
    return np.ma.array(np.clip(mean, 0.0, 1.0), mask=~known)


class Material:
    """The material drawn in an axes, which can show another state.

    Parameters
    ----------
    ax : Axes
        Axes to draw into.
    state : State
    brush : Brush
        Colours of the points.
    view : View
    extent : ((left, right), (bottom, top))
        Region to draw [m].
    size : float, optional
        Diameter of points that are drawn as discs [m]. By default they are an area, or where 3D
        points lie behind one another discs of which the nearest are visible, with the gaps closed.
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
        self.brush, self.view = brush, view
        spacing = spacing_of(state)
        self._closes = size is None and view.projects
        self._blends = size is None and brush.blends
        self._spacing = spacing
        if self._closes:
            size = math.sqrt(2) * spacing  # the diagonal, without gaps
        self._is_area = size is None
        self._radius = disc_radius(spacing, state.dim) if size is None else 0.5 * size
        self._reach = max(REACH[0] * state.scene.grid.cell, REACH[1] * spacing)
        longer = max(high - low for low, high in extent)
        self.raster = Raster(extent, max(longer / pixels, self._radius / PER_RADIUS))
        options: dict[str, Any] = {
            "origin": "lower",
            "extent": self.raster.extent,
            "zorder": 2,
            "aspect": "equal",
        }
        keep = ax.get_xlim(), ax.get_ylim()
        blank = np.zeros((*self.raster.counts, 4), dtype=np.uint8)
        self.artist = ax.imshow(blank, **options)
        ax.set_xlim(keep[0])
        ax.set_ylim(keep[1])
        self.update(state)

    def rows(self, state: State) -> IndexArray:
        """Index of the point that each pixel shows, or -1, shape (height, width), from below."""
        order, x = np.arange(state.n)[self.view.order(state)], self.view.places(state)
        if self._is_area:
            images, owners = mirror_images(state, self.view, self._reach)
            order, x = np.concatenate([order, order[owners]]), np.concatenate([x, images])
            indices = self.raster.area(x, self._radius, self._reach)
        else:
            indices = self.raster.discs(x, self._radius, self._reach if self._closes else 0.0)
        return np.where(indices < 0, -1, order[indices] if len(order) else -1)

    def update(self, state: State) -> None:
        """Show another state."""
        indices = self.rows(state)
        pixels = np.zeros((*indices.shape, 4), dtype=np.uint8)
        if state.n:
            shades = self.brush.norm(self.brush.paint(state))[indices]
            if self._blends:
                shades = blended(shades, indices >= 0, self._spacing / self.raster.pixel)
            pixels[indices >= 0] = self.brush.cmap(shades, bytes=True)[indices >= 0]
        self.artist.set_data(pixels)
