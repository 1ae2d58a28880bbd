"""Ground given by heights on a grid of posts, as a body."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from granular.shapes.rasters import read_heights
from granular.shapes.shape import TINY, Shape, row_of
from granular.tools.arrays import Array
from granular.tools.checks import (
    check_fields,
    finite,
    positive,
    real_array,
    sequence,
    set_fields,
    truth,
)
from granular.tools.serializable import ComparedByContent

TILE = 8
"""Cells between posts along an edge of a tile; as in `csrc/body/height_map.h`."""


@dataclass(frozen=True, eq=False, repr=False)
class HeightMap(ComparedByContent, Shape):
    """The region below a surface given by heights, in coordinates of its body.

    The last axis is up. In 3D the surface is made of two triangles between each four posts, split
    from the post at the lowest x and y to that at the highest; in 2D of straight lines between
    posts. The distance is the exact one from the nearest of these, found by a search over ranges of
    heights of tiles of the map; no mesh is made. The heights are not copied if they are a
    C-contiguous array of float64 or float32: the array must then not be changed. Ten million posts
    take 0.3 s, a distance some 4 us near the surface (benchmark ``mesh_setup``).

    Parameters
    ----------
    z : array_like, shape (nx,) in 2D, (ny, nx) in 3D
        Heights [m]: ``z[j, i]`` at x = origin[0] + i spacing, y = origin[1] + j spacing. Two posts
        at least along each axis.
    spacing : float, or tuple of float
        Distance of the posts [m], > 0; along x and y if there are two.
    origin : tuple of float, length dim - 1, optional
        Position of the first post [m]; 0 by default.
    extended : bool
        If True the surface goes on beyond the edges of the map with the heights of its edges.
        By default a domain must not reach beyond the map.
    {raises}; for heights that are not finite, the first.
    """

    z: NDArray
    spacing: float | tuple[float, ...]
    _: KW_ONLY
    origin: tuple[float, ...] = None  # type: ignore[assignment]  # a place once made
    extended: bool = False

    def __post_init__(self) -> None:
        z = real_array("z", self.z, float32=True)
        if z.ndim not in (1, 2) or min(z.shape) < 2:
            raise ValueError(f"z of shape {z.shape} must have 1 or 2 axes of two posts at least")
        axes = z.ndim
        origin = (0.0,) * axes if self.origin is None else sequence("origin", self.origin)
        single = isinstance(self.spacing, (int, float, np.number))
        given = (self.spacing,) * axes if single else sequence("spacing", self.spacing)
        for name, value in (("spacing", given), ("origin", origin)):
            if len(value) != axes:
                raise ValueError(
                    f"{name} = {value} must have {axes} numbers, one for each axis of z"
                )
        spacing = tuple(positive(f"spacing[{i}]", h) for i, h in enumerate(given))
        origin = tuple(finite(f"origin[{i}]", x) for i, x in enumerate(origin))
        set_fields(self, z=z, spacing=spacing, origin=origin)
        check_fields(self, truth, "extended")

    @classmethod
    def read(
        cls,
        path: str | os.PathLike,
        *,
        band: int | None = None,
        window: Sequence[float] | None = None,
        nodata: float | None = None,
        fill: float | str | None = None,
        scale: float | Sequence[float] | None = None,
        origin: tuple[float, float] | None = None,
        extended: bool = False,
    ) -> HeightMap:
        """Read a map from an ESRI ASCII grid, or from a GeoTIFF or another raster.

        The metadata of the file are used: units of the coordinate system (also of a ``.prj`` file
        next to an ASCII grid) and of the band are converted to metres, and the scale and offset of
        the band are applied. Coordinates in degrees are refused, as are lengths that depend on the
        latitude, a unit of coordinates other than the metre if that of the heights is not
        specified, rotated rasters, heights that do not occur on Earth, and values that look like an
        undeclared mark for missing heights. The error names the argument to give.

        Parameters
        ----------
        path : path
            A text that begins with ``ncols`` or ``nrows``, or ends in ``.asc``, is read as an ESRI
            ASCII grid; all others by rasterio.
        band : int, optional
            Band of the heights, from 1; needed if there are several.
        window : tuple of 4 floats, optional
            Part to be read, (x0, y0, x1, y1) in coordinates of the file: the posts in it and on its
            edges. It must lie in the raster. The part outside of it may have gaps, and takes no
            memory except in an ASCII grid.
        nodata : float, optional
            Value in the file that stands for a missing height, instead of the value in the file;
            nan if all its values are heights, even those that look like such marks.
        fill : float or "nearest", optional
            Height [m] of posts that have none, or "nearest" for that of the nearest post that has
            one. By default gaps are refused; the error names the largest window without any.
        scale : float or tuple of 2 floats, optional
            Metres in a unit of the file, > 0, instead of the units in the file: one for coordinates
            and heights, or one for each.
        origin : tuple of 2 floats, optional
            Position of the first post, at the lowest x and y [m]. By default that of the file,
            where a post is the middle of a pixel.
        extended : bool
            As in `HeightMap`.

        Raises
        ------
        ModuleNotFoundError
            If rasterio is needed and not installed: ``pip install granular-flow[terrain]``.
        OSError
            If the file cannot be read.
        TypeError, ValueError
            Naming the argument or the file, and the line or post with the fault.
        """
        z, spacing, first = read_heights(
            path, band=band, window=window, nodata=nodata, fill=fill, scale=scale
        )
        place = tuple(first.tolist()) if origin is None else origin
        return cls(z, tuple(spacing.tolist()), origin=place, extended=extended)

    @property
    def dim(self) -> int:
        return self.z.ndim + 1

    @property
    def upper(self) -> tuple[float, ...]:
        """Position of the last post [m]."""
        counts = self.z.shape[::-1]
        return tuple(
            low + h * (n - 1) for low, h, n in zip(self.origin, self._spacings, counts, strict=True)
        )

    @property
    def _spacings(self) -> tuple[float, ...]:
        assert isinstance(self.spacing, tuple)
        return self.spacing

    def rows(self) -> Array:
        # In 2D the third axis of the part, which is up, is y of the body.
        turn = np.eye(3) if self.dim == 3 else np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        center = (0.0,) * 3
        return row_of("height_map", False, center, turn, (np.inf,) * 3)[None]

    def is_endless(self, along: Array) -> bool:
        return bool(abs(along[self.dim - 1]) < TINY)

    def samples(self) -> tuple[tuple[NDArray, ...], ...]:
        h = self._spacings
        grid = np.array([*self.origin, *h])
        if self.dim == 2:  # two equal rows of posts along the third axis
            grid = np.array([self.origin[0], -0.5 * h[0], h[0], h[0]])
        return ((grid, self.z, self._ranges),)

    @cached_property
    def _ranges(self) -> Array:
        """Lowest and highest height of tiles, then of two by two of these, to a single one."""
        levels = [np.stack([_tiled(self.z, np.minimum), _tiled(self.z, np.maximum)], axis=-1)]
        while levels[-1].shape[:2] != (1, 1):
            low, high = levels[-1][..., 0], levels[-1][..., 1]
            for axis in (0, 1):
                pairs = np.arange(0, low.shape[axis], 2)
                low = np.minimum.reduceat(low, pairs, axis=axis)
                high = np.maximum.reduceat(high, pairs, axis=axis)
            levels.append(np.stack([low, high], axis=-1))
        return np.concatenate([level.reshape(-1, 2) for level in levels])

    def check(self, name: str, corners: Array, slack: float) -> None:
        """Refuse a domain, given by its corners in coordinates of the body, beyond the map.

        The `slack` [m] is the rounding of the corners.
        """
        if self.extended:
            return
        for axis, (low, high) in enumerate(zip(self.origin, self.upper, strict=True)):
            least, most = corners[:, axis].min(), corners[:, axis].max()
            if least < low - slack or most > high + slack:
                raise ValueError(
                    f"{name}: the domain reaches from {least:.9g} to {most:.9g} m along "
                    f"{'xy'[axis]} of the body, its height map from {low:.9g} to {high:.9g} m: take"
                    " a larger map or extended=True"
                )


def _tiled(z: NDArray, least: np.ufunc) -> Array:
    """Least (or largest) height of tiles, whose posts at both edges count; shape (y, x)."""
    heights: NDArray = np.atleast_2d(z)
    for axis in (0, 1):
        count = heights.shape[axis]
        first = np.arange(0, max(count - 1, 1), TILE)
        inner = least.reduceat(heights, first, axis=axis)
        last = np.minimum(first + TILE, count - 1)
        heights = least(inner, np.take(heights, last, axis=axis))
    return heights.astype(np.float64)
