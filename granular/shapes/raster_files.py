"""Files of rasters: ESRI ASCII grids, read here, and all others, by GDAL."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from granular.shapes.coordinate_systems import LENGTHS, UnclearUnits, Units, units_of
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import integer
from granular.tools.files import check_file

MOST_HEIGHTS = 2**31 - 1
"""Largest number of heights of a raster."""

Pair = tuple[float, float]
Read = Callable[[slice, slice], tuple[NDArray, BoolArray]]

CENTERS, CORNERS = ("xllcenter", "yllcenter"), ("xllcorner", "yllcorner")
KEYS = ("ncols", "nrows", *CENTERS, *CORNERS, "cellsize", "dx", "dy", "nodata_value")
LINES = 2**22
"""Characters of a text that are read together."""


@dataclass(frozen=True)
class Raster:
    """A raster as it is stored in its file.

    Attributes
    ----------
    path : str
    shape : tuple of int
        Numbers of rows and columns.
    first, spacing : tuple of 2 floats
        Position of the post at the lowest x and y, and distances along x and y, in units of the
        file.
    read : callable
        Values of a part, given by slices of rows and columns, y ascending with the rows, and True
        where a value is missing.
    units : callable
        Units of the coordinates and heights, see `units_of`.
    numbers : tuple of 2 floats
        Factor and offset that make heights of the values.
    """

    path: str
    shape: tuple[int, int]
    first: Pair
    spacing: Pair
    read: Read
    units: Callable[[], Units] = Units
    numbers: Pair = (1.0, 0.0)

    @property
    def name(self) -> str:
        """The raster in messages."""
        return f"path = {self.path!r}"


def open_raster(path: str | os.PathLike, band: int | None) -> Raster:
    """Open a raster.

    Raises
    ------
    OSError
        If it cannot be read.
    ModuleNotFoundError
        If it is no ESRI ASCII grid, and rasterio is not installed.
    ValueError
        If it is none, or its posts do not lie along x and y.
    """
    if band is not None:
        band = integer("band", band, 1)
    if Path(path).is_dir():  # a grid of ARC/INFO is a folder
        return _of_gdal(path, band)
    with open(check_file(path), "rb") as file:
        begin = file.read(4096)
    text = begin.removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    named = Path(path).suffix.lower() == ".asc"
    if not begin:
        raise ValueError(f"path = {str(path)!r} is empty")
    if named and begin[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise ValueError(f"path = {str(path)!r} is text in UTF-16, must be in ASCII or UTF-8")
    if named or text.startswith((b"ncols", b"nrows")):
        if band not in (None, 1):
            raise ValueError(f"band = {band} must be 1 for an ESRI ASCII grid")
        return _of_esri(path)
    return _of_gdal(path, band)


def missing(values: NDArray, mark: float) -> BoolArray:
    """True where a value is not finite or is the mark, nan for none, of a missing one.

    A mark may have lost digits on its way through single precision, as -3.4028235e38 does.
    """
    if not math.isfinite(mark):
        return ~np.isfinite(values)
    near = abs(mark) * np.finfo(np.float32).eps
    with np.errstate(invalid="ignore", over="ignore"):
        marked: BoolArray = np.abs(values - np.float64(mark)) <= near
    return marked | ~np.isfinite(values)


# ---- ESRI ASCII grids ----


def _of_esri(path: str | os.PathLike) -> Raster:
    name = f"path = {str(path)!r}"
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        head, before, row = _head(name, file)
        shape, spacing, first = _frame(name, head)
        z = _values(name, chain([before], file), row, math.prod(shape)).reshape(shape)[::-1]
    mark = head.get("nodata_value", math.nan)

    def read(rows: slice, columns: slice) -> tuple[NDArray, BoolArray]:
        part = np.ascontiguousarray(z[rows, columns])
        return part, missing(part, mark)

    def units() -> Units:
        companion = _companion(Path(path).with_suffix(".prj"))
        if companion is None:
            return Units()
        try:
            return units_of(companion.read_text(encoding="utf-8", errors="replace"))
        except ValueError as error:
            raise type(error)(f"{error}, by {companion.name}") from None

    return Raster(str(path), shape, first, spacing, read, units)


def _companion(path: Path) -> Path | None:
    """Return the file of that name, written as it is or else in other letters, A.PRJ as a.prj."""
    if path.is_file():
        return path
    named = (other for other in path.parent.iterdir() if other.name.lower() == path.name.lower())
    return next((other for other in sorted(named) if other.is_file()), None)


def _head(name: str, file: TextIO) -> tuple[dict[str, float], str, int]:
    """Numbers of the header by their keys, and the line after it with its number."""
    head: dict[str, float] = {}
    for number, line in enumerate(iter(file.readline, ""), 1):
        words = line.split()
        if not words:
            continue
        key = words[0].lower()
        if not key[0].isalpha() or _is_number(key):
            return head, line, number
        at = f"{name}, line {number}: {line.strip()[:60]!r}"
        if key not in KEYS or len(words) != 2:
            raise ValueError(f"{at} must be one of {', '.join(KEYS)} and its value, or heights")
        if key in head:
            raise ValueError(f"{at} must not be given twice")
        if not _is_number(words[1]):
            comma = ", with a point and no comma" if "," in words[1] else ""
            raise ValueError(f"{at} must have a number{comma}")
        head[key] = float(words[1])
    return head, "", 1


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in word


def _frame(name: str, head: dict[str, float]) -> tuple[tuple[int, int], Pair, Pair]:
    """Shape, spacing and position of the first post, from the numbers of a header."""
    corners, centers = (all(key in head for key in keys) for keys in (CORNERS, CENTERS))
    steps = "cellsize" in head, "dx" in head and "dy" in head
    places = sum(key in head for key in CORNERS + CENTERS)
    if not {"ncols", "nrows"} <= set(head) or not any(steps) or not (corners or centers):
        raise ValueError(
            f"{name} must begin with ncols, nrows, cellsize and xllcorner, yllcorner or xllcenter, "
            f"yllcenter; found {head}"
        )
    if all(steps) or places != 2:
        raise ValueError(f"{name} must give its cells and its position once, has {head}")
    for key in ("nrows", "ncols"):
        if not 1 <= head[key] <= MOST_HEIGHTS or head[key] != int(head[key]):
            raise ValueError(f"{name}: {key} = {head[key]:g} must be a whole number >= 1")
    spacing = (head["cellsize"],) * 2 if steps[0] else (head["dx"], head["dy"])
    if not all(0 < h < math.inf for h in spacing):
        raise ValueError(f"{name}: its cells of {spacing} must have finite sizes > 0")
    place = [head[key] for key in (CORNERS if corners else CENTERS)]
    if not all(map(math.isfinite, place)):
        raise ValueError(f"{name}: its position {tuple(place)} must be finite")
    half = 0.5 if corners else 0.0
    first = (place[0] + half * spacing[0], place[1] + half * spacing[1])
    shape = int(head["nrows"]), int(head["ncols"])
    if math.prod(shape) > MOST_HEIGHTS:
        raise ValueError(f"{name}: its {shape} posts must be at most {MOST_HEIGHTS}")
    return shape, spacing, first


def _values(name: str, lines: Any, number: int, count: int) -> Array:
    """Numbers of lines, the first of which has this number; exactly `count`."""
    parts, held = [], 0
    while held <= count:
        block, size = [], 0
        for line in lines:
            block.append(line)
            size += len(line)
            if size > LINES:
                break
        if not block:
            break
        try:
            parts.append(np.array("".join(block).split(), dtype=float))
        except ValueError:
            raise _wrong_word(name, block, number) from None
        if np.isinf(parts[-1]).any():
            _refuse_huge(name, block, number)
        held += parts[-1].size
        number += len(block)
    if held != count:
        more = "more" if held > count else held
        raise ValueError(f"{name} must hold {count} heights by its header, has {more}")
    return np.concatenate(parts)


def _words(block: list[str], number: int) -> Iterator[tuple[int, str]]:
    """Yield the words of lines, the first of which has this number, each with that of its line."""
    return ((number + k, word) for k, line in enumerate(block) for word in line.split())


def _refuse_huge(name: str, block: list[str], number: int) -> None:
    """Refuse numbers beyond those of double precision; inf in letters is a gap."""
    for line, word in _words(block, number):
        if math.isinf(float(word)) and "inf" not in word.lower():
            raise ValueError(
                f"{name}, line {line}: {word[:40]!r} must be from -1.8e308 to 1.8e308, the largest "
                "number; inf, nan and NODATA_value stand for missing heights"
            )


def _wrong_word(name: str, block: list[str], number: int) -> ValueError:
    """Error that names the first word that is no number."""
    places = _words(block, number)
    line, word = next((place for place in places if not _is_number(place[1])), (number, "?"))
    comma = ": write decimals with a point" if _is_number(word.replace(",", ".", 1)) else ""
    return ValueError(f"{name}, line {line}: {word[:40]!r} must be a number{comma}")


# ---- all others ----


def _of_gdal(path: str | os.PathLike, band: int | None) -> Raster:
    rasterio = _rasterio()
    name = f"path = {str(path)!r}"
    try:
        with rasterio.open(path) as raster:
            number = _band(name, raster, band)
            to, shape = raster.transform, raster.shape
            system = raster.crs.to_wkt() if raster.crs else ""
            unit = (raster.units[number - 1] or "").strip()
            numbers = raster.scales[number - 1], raster.offsets[number - 1]
    except rasterio.errors.RasterioIOError as error:
        raise ValueError(f"{name} must be a raster: {error}") from error
    _check_frame(name, to, numbers)
    spacing = abs(to.a), abs(to.e)
    flipped = to.a < 0, to.e < 0
    first = tuple(
        begin + step * (n - 0.5 if step < 0 else 0.5)
        for begin, step, n in ((to.c, to.a, shape[1]), (to.f, to.e, shape[0]))
    )

    def read(rows: slice, columns: slice) -> tuple[NDArray, BoolArray]:
        parts = [
            (n - part.stop, n - part.start) if back else (part.start, part.stop)
            for part, n, back in zip((rows, columns), shape, flipped[::-1], strict=True)
        ]
        window = rasterio.windows.Window.from_slices(*parts)
        try:
            with rasterio.open(path) as raster:
                z = raster.read(number, window=window)
                gaps = raster.read_masks(number, window=window) == 0
        except rasterio.errors.RasterioIOError as error:
            raise ValueError(f"{name} is damaged: {error.__cause__ or error}") from error
        gaps |= ~np.isfinite(z)
        order = tuple(slice(None, None, -1 if back else 1) for back in flipped[::-1])
        return np.ascontiguousarray(z[order]), gaps[order]

    def units() -> Units:
        of_system = units_of(system) if system else Units()
        if not unit:
            return of_system
        if unit.lower() not in LENGTHS:
            raise UnclearUnits(f"the unit {unit!r} of its band {number} is no length")
        return Units(of_system.horizontal, LENGTHS[unit.lower()])

    return Raster(str(path), shape, (first[0], first[1]), spacing, read, units, numbers)


def _band(name: str, raster: Any, band: int | None) -> int:
    """Number of the band that holds the heights."""
    colors = [color.name for color in raster.colorinterp]
    others = [k for k, color in enumerate(colors, 1) if color != "alpha"]
    if not others:
        held = ", ".join(raster.subdatasets[:8]) or "none"
        raise ValueError(
            f"{name} must have a band; of its parts {held} take one, by gdal_translate"
        )
    if band is None and len(others) > 1:
        raise ValueError(f"{name} has {len(others)} bands {others}: name that of heights by band=")
    number = others[0] if band is None else band
    if number not in others:
        raise ValueError(f"band = {number} must be one of {others}")
    kind = raster.dtypes[number - 1]
    if colors[number - 1] in ("red", "green", "blue", "palette") or "complex" in kind:
        raise ValueError(
            f"{name}: band {number} must hold heights, has {colors[number - 1]} {kind}"
        )
    return number


def _check_frame(name: str, to: Any, numbers: Pair) -> None:
    if to.is_identity:
        raise ValueError(
            f"{name} must say where its posts are, by a transform; with ground control points it "
            "must be warped first (gdalwarp)"
        )
    if to.b or to.d or not to.a or not to.e or not all(map(math.isfinite, to)):
        raise ValueError(f"{name}: the raster must not be turned, has {tuple(to)[:6]}")
    if not all(map(math.isfinite, numbers)) or not numbers[0]:
        raise ValueError(f"{name}: its scale and offset {numbers} must be finite, the scale not 0")


def _rasterio() -> Any:
    try:
        import rasterio
        import rasterio.errors
        import rasterio.windows
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error}: GeoTIFF needs rasterio: pip install granular-flow[terrain]"
        ) from error
    return rasterio
