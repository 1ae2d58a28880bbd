"""Maps of heights from rasters: units, gaps and windows, by one set of rules for all formats."""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from granular.shapes.coordinate_systems import UnclearUnits, Units
from granular.shapes.raster_files import Raster, missing, open_raster
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import finite, one_of, positive, vector

Part = tuple[slice, slice]

LOWEST, HIGHEST = -11e3, 9e3
"""Heights of the Earth [m]: values beyond them are marks, or have another unit."""
MARKS = (-9999.0, -9998.0, -999.0, -99.0, 999.0)
"""Values from `LOWEST` to `HIGHEST` that writers of rasters put where they have no height."""
CLIFF = 10.0
"""Slope that no terrain has everywhere, an angle of 84 degrees. If all posts of one value are
separated from all others by it, that value is perhaps a mark; if a quarter of all neighbours are,
the units along the ground and of heights differ: 1 degree is 111,000 m, 1 km 1000 m."""
BUILT = 50.0
"""Step [m] that floors of models and buildings do not have below the objects on them: the
largest flume, of 95 m at 31 degrees, begins 49 m above its floor."""
NEAREST = "nearest"
MOST_BLOCKS = 512
"""Blocks along each axis in which the largest rectangle without gaps is sought."""


def read_heights(
    path: str | os.PathLike,
    *,
    band: int | None,
    window: Sequence[float] | None,
    nodata: float | None,
    fill: float | str | None,
    scale: float | Sequence[float] | None,
) -> tuple[NDArray, Array, Array]:
    """Read the heights of a raster; see `granular.shapes.height_map.HeightMap.read`.

    Returns
    -------
    z : ndarray, shape (ny, nx)
        Heights [m]; y ascends with the rows.
    spacing, first : ndarray, shape (2,)
        Distance of the posts along x and y, and position of the first post [m].
    """
    if isinstance(fill, str):
        one_of("fill", fill, (NEAREST,))
    elif fill is not None:
        fill = finite("fill", fill)
    raster = open_raster(path, band)
    along, up = _factors(raster, scale)
    part = _part_of(raster, window)
    raw, gaps = raster.read(*part)
    if nodata is not None:
        gaps = missing(raw, _checked_mark(nodata))
    if gaps.all():
        where = "" if window is None else " in the window"
        raise ValueError(f"{raster.name}: none of its {raw.size} posts has a height{where}")
    z = raw if raster.numbers == (1.0, 0.0) else raw * raster.numbers[0] + raster.numbers[1]
    z = z if up == 1.0 else z * up
    spacing = np.array(raster.spacing)
    first = np.array(raster.first) + spacing * [part[1].start, part[0].start]
    if nodata is None:
        _check_marks(raster.name, raw, z, gaps, float(spacing.min() * along))
    if scale is None:
        _refuse_mixed_units(raster.name, z, gaps, spacing * along)
    if gaps.any():
        z = _filled(raster, z, gaps, fill, first)
    return z, spacing * along, first * along


def _checked_mark(value: Any) -> float:
    """Return a mark of gaps: any number that a file may hold, nan among them."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"nodata = {value!r} must be a number, not {type(value).__name__}")
    return float(value)


# ---- units ----


def _factors(raster: Raster, scale: float | Sequence[float] | None) -> tuple[float, float]:
    """Metres in a unit of the coordinates and of the heights of a raster."""
    try:
        units = raster.units()
    except UnclearUnits as error:
        if scale is None:
            raise ValueError(
                f"{raster.name}: {error}: reproject it (gdalwarp -t_srs EPSG:...), or give scale = "
                "(metres in a unit along the ground, metres in a unit of height)"
            ) from None
        units = Units()
    except ValueError as error:
        raise ValueError(f"{raster.name}: {error}{_advice(raster)}") from None
    if scale is not None:
        if isinstance(scale, (Sequence, np.ndarray)) and not isinstance(scale, str):
            along, up = vector("scale", scale, 2, positive)
            return along, up
        return (positive("scale", scale),) * 2
    along = 1.0 if units.horizontal is None else units.horizontal
    if units.vertical is None and along != 1.0:
        raise ValueError(
            f"{raster.name}: its coordinates have a unit of {along:.10g} m, and does not "
            f"specify that of its heights: give scale = {along:.10g} if it is the same, or scale = "
            f"({along:.10g}, 1.0) if heights are in metres"
        )
    return along, 1.0 if units.vertical is None else units.vertical


def _advice(raster: Raster) -> str:
    """Reprojection of a raster in degrees to the zone of UTM of its middle."""
    middle = [
        first + 0.5 * h * (n - 1)
        for first, h, n in zip(raster.first, raster.spacing, raster.shape[::-1], strict=True)
    ]
    if not (abs(middle[0]) <= 360 and abs(middle[1]) <= 90):
        return ""
    zone = int((middle[0] + 180) // 6) % 60 + 1
    code = (32600 if middle[1] >= 0 else 32700) + zone
    return (
        f": reproject it to metres, for example gdalwarp -t_srs EPSG:{code} -r bilinear "
        f"{raster.path} out.tif"
    )


def _refuse_mixed_units(name: str, z: NDArray, gaps: BoolArray, spacing: Array) -> None:
    """Refuse heights that are too steep for their spacing nearly everywhere."""
    high = np.where(gaps, np.nan, z)
    with np.errstate(all="ignore"):
        slopes = [
            (np.abs(np.diff(high, axis=1 - k)) / spacing[k]).ravel()[:: max(z.size // 10**6, 1)]
            for k in (0, 1)
        ]
    known = np.concatenate(slopes)
    known = known[~np.isnan(known)]
    if known.size and (steep := float(np.quantile(known, 0.75))) > CLIFF:
        raise ValueError(
            f"{name}: a quarter of its posts differ from their neighbours by more than {steep:.3g} "
            f"times their distance of {spacing.min():.6g}: its coordinates are perhaps degrees or "
            "kilometres, or its heights millimetres; reproject it, or give scale = (metres in a "
            "unit along the ground, metres in a unit of height)"
        )


# ---- windows ----


def _part_of(raster: Raster, window: Sequence[float] | None) -> Part:
    """Rows and columns of the posts in a window, in the coordinates of the file."""
    if window is None:
        return slice(0, raster.shape[0]), slice(0, raster.shape[1])
    ends = vector("window", window, 4)
    part = []
    for k, axis in enumerate("xy"):
        low, high = ends[k], ends[k + 2]
        first, h, n = raster.first[k], raster.spacing[k], raster.shape[1 - k]
        lower, upper = first - 0.5 * h, first + (n - 0.5) * h
        near = 1e-6 * h + 4 * np.spacing(max(abs(lower), abs(upper)))
        stand = f"{raster.name}, whose posts stand for {axis} = {lower:.12g} to {upper:.12g}"
        if not low < high:
            raise ValueError(
                f"window = {tuple(window)} must reach along {axis} from a lower to a higher "
                f"position of {stand}"
            )
        if low < lower - near or high > upper + near:
            raise ValueError(
                f"window = {tuple(window)} must lie along {axis}, from {low:.12g} to {high:.12g}, "
                f"within {stand}"
            )
        begin, end = math.ceil((low - near - first) / h), math.floor((high + near - first) / h)
        begin, end = max(begin, 0), min(end, n - 1)
        if end - begin < 1:
            raise ValueError(
                f"window = {tuple(window)} must hold two posts at least along {axis}, at distances "
                f"of {h:.9g}"
            )
        part.append(slice(begin, end + 1))
    return part[1], part[0]


# ---- gaps ----


def _check_marks(name: str, raw: NDArray, z: NDArray, gaps: BoolArray, spacing: float) -> None:
    """Refuse heights that do not occur on Earth, and values that stand for a missing height."""
    known, heights = raw[~gaps], z[~gaps].astype(float)  # differences of integers wrap around
    for value in (heights.min(), heights.max()):
        if LOWEST <= value <= HIGHEST:
            continue
        at = heights == value
        raise ValueError(
            f"{name}: {int(at.sum())} posts have the height {value:.9g} m, must be from "
            f"{LOWEST:g} to {HIGHEST:g}: if the value in the file, {known[at][0]!s}, stands for "
            f"missing heights, give nodata={known[at][0]!s}; if its unit is no metre, scale=; if "
            "it is a height, nodata=float('nan')"
        )
    for extreme in (known.min(), known.max()):
        at = known == extreme
        rest = heights[~at]
        if not rest.size:
            return  # level
        height = heights[at][0]
        step = float(np.abs(rest - height).min())
        mark = float(extreme) in MARKS
        reach = min(float(np.ptp(rest)), CLIFF * spacing) if mark else CLIFF * spacing
        many = f"{name}: {int(at.sum())} posts have the value {extreme!s}, which is {step:.6g} m "
        many += "from the height of any other: "
        if mark and step > reach:
            raise ValueError(
                f"{many}if it stands for missing heights, give nodata={extreme!s}; if it is a "
                "height, nodata=float('nan')"
            )
        # A step to a roof, a crest or a floor is one; several posts of just one value far from all
        # others are none if writers of rasters start with it. A single one may be a pole or a pit.
        perhaps = extreme in _blank(raw.dtype) and step > max(reach, BUILT)
        if perhaps and min(at.sum(), rest.size) > 1:
            warnings.warn(
                f"{many}does it stand for missing heights? Then give nodata={extreme!s}, else "
                "nodata=float('nan')",
                stacklevel=4,
            )


def _blank(kind: np.dtype) -> tuple[int, ...]:
    """Values of posts that were never written: 0, and the ends of bytes."""
    ends = np.iinfo(kind) if kind.itemsize == 1 else None
    return (0,) if ends is None else (0, int(ends.min), int(ends.max))


def _filled(
    raster: Raster, z: NDArray, gaps: BoolArray, fill: float | str | None, first: Array
) -> NDArray:
    """Heights without gaps."""
    if fill is None:
        _refuse_gaps(raster, gaps, first)
    z = np.array(z, dtype=z.dtype if z.dtype.kind == "f" else float)
    if fill == NEAREST:
        near = scipy.ndimage.distance_transform_edt(
            gaps, sampling=raster.spacing[::-1], return_distances=False, return_indices=True
        )
        z[gaps] = z[tuple(axis[gaps] for axis in near)]
    else:
        z[gaps] = fill
    return z


def _refuse_gaps(raster: Raster, gaps: BoolArray, first: Array) -> None:
    h = raster.spacing
    rows, columns = (np.flatnonzero(gaps.any(axis=axis)) for axis in (1, 0))
    where = [
        f"{axis} = {first[k] + h[k] * at[0]:.12g} to {first[k] + h[k] * at[-1]:.12g}"
        for k, (axis, at) in enumerate((("x", columns), ("y", rows)))
    ]
    parts, _ = scipy.ndimage.label(gaps)
    at_rim = np.unique([*parts[[0, -1]].ravel(), *parts[:, [0, -1]].ravel()])
    inner = int((gaps & ~np.isin(parts, at_rim)).sum())
    rim = f"{inner} of them in holes" if inner else "all of them joined to its rim"
    message = (
        f"{raster.name}: {int(gaps.sum())} of {gaps.size} posts have no height, at "
        f"{', '.join(where)}, {rim}: give fill='nearest' or a height in metres"
    )
    part = largest_rectangle(~gaps)
    if min(p.stop - p.start for p in part) >= 2:
        places = [(p.start, p.stop - 1) for p in part[::-1]]
        ends = tuple(float(first[k] + h[k] * places[k][end]) for end in (0, 1) for k in (0, 1))
        size = " x ".join(str(p.stop - p.start) for p in part[::-1])
        message += f"; or window={ends}, {size} posts without gaps"
    raise ValueError(message)


@dataclass
class _Best:
    area: int = 0
    part: Part = (slice(0, 0), slice(0, 0))


def largest_rectangle(there: BoolArray) -> Part:
    """Rows and columns of the largest rectangle that is true all over.

    Beyond `MOST_BLOCKS` entries along an axis it is the largest of whole blocks.
    """
    block = [max(-(-n // MOST_BLOCKS), 1) for n in there.shape]
    whole = there
    for axis, size in enumerate(block):
        whole = np.logical_and.reduceat(whole, np.arange(0, whole.shape[axis], size), axis=axis)
    best = _Best()
    heights = np.zeros(whole.shape[1], dtype=np.int64)
    for row, line in enumerate(whole):
        heights = np.where(line, heights + 1, 0)
        _widest_under(heights.tolist(), row, best)
    rows, columns = (
        slice(part.start * size, min(part.stop * size, n))
        for part, size, n in zip(best.part, block, there.shape, strict=True)
    )
    return rows, columns


def _widest_under(heights: list[int], row: int, best: _Best) -> None:
    """Rectangles that end in a row, by the stack of columns whose heights ascend."""
    stack: list[tuple[int, int]] = []  # first column, height
    for column, height in enumerate([*heights, 0]):
        begin = column
        while stack and stack[-1][1] >= height:
            begin, high = stack.pop()
            area = high * (column - begin)
            if area > best.area:
                best.area = area
                best.part = slice(row - high + 1, row + 1), slice(begin, column)
        stack.append((begin, height))
