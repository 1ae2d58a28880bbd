"""The text of dumps of LAMMPS and LIGGGHTS: a table of numbers for each frame, read on demand."""

from __future__ import annotations

import gzip
import io
import math
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import IO

import numpy as np

from granular.tools.arrays import Array
from granular.tools.files import check_file

ROWS = ("ATOMS", "ENTRIES")
"""Items whose rows follow: grains, or pairs of grains and other local values."""
TEXT = ("element", "typelabel")
"""Columns that hold words, which are left out."""


@dataclass(frozen=True)
class Table:
    """One frame of a dump, in the units of the file.

    Attributes
    ----------
    step : int
        Number of the time step; -1 if the file does not say.
    time : float
        Time, nan if the file does not say.
    units : str
        Name of the units, such as "si" or "lj"; empty if the file does not say.
    bounds : ndarray, shape (3, 2) or more columns
        Ends of the box along each axis, and tilts of one that is no cuboid.
    box : tuple of str
        Words behind `ITEM: BOX BOUNDS`: pp for a periodic axis, after those of tilts.
    kind : str
        "ATOMS" for grains, "ENTRIES" for pairs.
    columns : tuple of str
        Names of the columns.
    rows : ndarray, shape (n, number of columns)
    line : int
        Number of the line of the first row.
    """

    step: int
    time: float
    units: str
    bounds: Array
    box: tuple[str, ...]
    kind: str
    columns: tuple[str, ...]
    rows: Array
    line: int


class _Lines:
    """Lines of a file with their numbers, and errors that name them."""

    def __init__(self, path: str | os.PathLike, file: IO[str]) -> None:
        self.name, self.file, self.number = f"path = {os.fspath(path)!r}", file, 0

    def next(self) -> str:
        self.number += 1
        return self.file.readline()

    def value(self, item: str) -> str:
        """Line after an item."""
        line = self.next()
        if not line.strip():
            raise self.error(f"ends after ITEM: {item}")
        return line

    def error(self, text: str, number: int | None = None) -> ValueError:
        return ValueError(f"{self.name}, line {number or self.number}: {text}")


def tables(path: str | os.PathLike, *, only: int | None = None) -> Iterator[Table]:
    """Yield the frames of a dump in their order; only one is in memory.

    Parameters
    ----------
    path : path
        A text, perhaps compressed by gzip.
    only : int, optional
        Number of the one frame whose rows are read, from 0, or -1 for none. Those of the others are
        skipped, and their tables are empty.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it is no text dump, is cut off, or has rows that are no finite numbers; with the line.
    """
    path = check_file(path)
    with open(path, "rb") as file:
        begin = file.read(1024)
    packed = begin.startswith(b"\x1f\x8b")
    if not packed and b"\0" in begin:
        raise ValueError(f"path = {str(path)!r} is binary, must be a dump in text")
    opened = gzip.open if packed else open
    with (
        opened(path, "rb") as reader,
        io.TextIOWrapper(reader, encoding="utf-8", errors="replace") as file,
    ):
        lines = _Lines(path, file)
        try:
            head: dict[str, str] = {}
            frame = 0
            while line := lines.next():
                if not line.strip():
                    continue
                if not line.startswith("ITEM: "):
                    raise lines.error(f"{line.strip()[:40]!r} must begin with ITEM:")
                item = line[6:].strip()
                if item.startswith(ROWS):
                    yield _table(lines, head, item, only in (None, frame))
                    head, frame = {}, frame + 1
                elif item.startswith("BOX BOUNDS"):
                    head["BOX BOUNDS"] = item[10:] + "".join(
                        "\n" + lines.value(item) for _ in range(3)
                    )
                else:
                    head[item] = lines.value(item).strip()
            if head:
                raise lines.error(f"ends after ITEM: {next(reversed(head))}")
        except (EOFError, gzip.BadGzipFile, zlib.error) as error:
            raise lines.error(f"its compressed part is cut off or damaged: {error}") from error
    if lines.number == 1:
        raise ValueError(f"path = {str(path)!r} is empty")


def _table(lines: _Lines, head: dict[str, str], item: str, numbers: bool) -> Table:
    kind, *names = item.split()
    counts = [text for name, text in head.items() if name.startswith("NUMBER OF")]
    if not counts or "BOX BOUNDS" not in head:
        raise lines.error(f"ITEM: {kind} must follow NUMBER OF {kind} and BOX BOUNDS")
    count = _number(lines, "NUMBER OF " + kind, counts[0])
    if not names:
        raise lines.error(f"ITEM: {kind} must name its columns")
    if len(set(names)) < len(names):
        raise lines.error(f"ITEM: {kind} names a column twice")
    if count < 0 or count != int(count):
        raise lines.error(f"NUMBER OF {kind} = {counts[0]} must be a whole number >= 0")
    flags, *ends = head["BOX BOUNDS"].split("\n")
    bounds = [
        [_number(lines, "BOX BOUNDS", word) for word in line.split()] for line in ends if line
    ]
    if len({len(line) for line in bounds}) != 1 or len(bounds[0]) < 2:
        raise lines.error("BOX BOUNDS must hold two ends along each of three axes")
    first = lines.number + 1
    rows = _rows(lines, int(count), names, numbers)
    is_number = [name not in TEXT for name in names]
    return Table(
        step=int(_number(lines, "TIMESTEP", head.get("TIMESTEP", "-1"))),
        time=_number(lines, "TIME", head["TIME"]) if "TIME" in head else math.nan,
        units=head.get("UNITS", ""),
        bounds=np.array(bounds),
        box=tuple(flags.split()),
        kind=kind,
        columns=tuple(name for name, keep in zip(names, is_number, strict=True) if keep),
        rows=rows,
        line=first,
    )


def _number(lines: _Lines, item: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise lines.error(f"ITEM: {item} must be followed by finite numbers, not {text[:40]!r}")
    return value


def _rows(lines: _Lines, count: int, names: list[str], numbers: bool) -> Array:
    """Numbers of the rows, without columns of words."""
    first, width = lines.number + 1, len(names)
    if not numbers:
        skipped = sum(1 for _ in islice(lines.file, count))
        lines.number += skipped
        if skipped < count:
            raise lines.error(f"{skipped} of {count} rows are there")
        return np.zeros((0, width))
    texts = list(islice(lines.file, count))
    lines.number += len(texts)
    words = "".join(texts).split()
    if len(texts) < count or len(words) != count * width:
        lengths = [len(text.split()) for text in texts]
        for k, length in enumerate(lengths):
            if length != width:
                raise lines.error(f"has {length} numbers for {width} columns", first + k)
        raise lines.error(f"{len(texts)} of {count} rows are there")
    table = np.array(words).reshape(count, width) if set(names) & set(TEXT) else None
    if table is not None:
        words = table[:, [name not in TEXT for name in names]].ravel().tolist()
        names = [name for name in names if name not in TEXT]
    try:
        rows = np.array(words, dtype=float).reshape(count, len(names))
    except ValueError:
        rows = np.array([_float(word) for word in words]).reshape(count, len(names))
    if not np.isfinite(rows).all():
        k, c = np.argwhere(~np.isfinite(rows))[0]
        word = words[k * len(names) + c]
        raise lines.error(f"{names[c]} = {word[:40]} must be a finite number", first + int(k))
    return rows


def _float(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return math.nan
