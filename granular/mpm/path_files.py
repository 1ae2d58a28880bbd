"""Paths of bodies in files: tables of times, positions and angles."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy

from granular.tools.arrays import Array

NAMES = {
    "time": ("time", "times", "t"),
    "x": ("x", "position_x"),
    "y": ("y", "position_y"),
    "z": ("z", "position_z"),
    "angle": ("angle", "angle_deg", "angle_rad"),
} | {f"quaternion_{part}": (f"quaternion_{part}",) for part in "wxyz"}
"""Names of the columns of a path, in any case, with units in brackets or without."""
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
UNITS = {
    "time": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "angle": {"deg": 1.0, "°": 1.0, "rad": math.degrees(1.0)},
} | dict.fromkeys("xyz", LENGTHS)
"""Units of the columns, and their factors."""
TURNS = tuple(f"quaternion_{part}" for part in "xyzw")
ONE_AXIS = 1e-6
"""Largest part of a turn about another axis than that of most turns, over all turns [1]."""


@dataclass(frozen=True)
class PathFile:
    """A path as its file has it.

    Attributes
    ----------
    times : ndarray, shape (k,)
        Times [s].
    positions : ndarray, shape (k, dim)
        Positions [m].
    angles_deg : ndarray, shape (k,), or None
        Angles [deg], if the file has any.
    axis : (float, float, float) or None
        Axis of the turns in 3D, if the file says it.
    """

    times: Array
    positions: Array
    angles_deg: Array | None
    axis: tuple[float, float, float] | None


def read_path(path: Path) -> PathFile:
    """Read a table of a path; see `Motion.read`.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If a column is missing, its unit is unknown, an entry is no number, or a body turns about
        several axes.
    """
    columns = _table(path)
    for name in ("time", "x", "y"):
        if name not in columns:
            known = ", ".join(NAMES[name])
            raise ValueError(f"{path}: a column {name} is missing, which may be called {known}")
    positions = np.stack([columns[name] for name in "xyz" if name in columns], axis=1)
    angles, axis = columns.get("angle"), None
    if angles is None and all(name in columns for name in TURNS):
        turns = np.stack([columns[name] for name in TURNS], axis=1)
        angles, axis = _about_one_axis(path, turns, positions.shape[1])
    return PathFile(columns["time"], positions, angles, axis)


def _about_one_axis(
    path: Path, turns: Array, dim: int
) -> tuple[Array, tuple[float, float, float] | None]:
    """Angles [deg] and axis of turns from one quaternion (x, y, z, w) to the next."""
    if not np.all(np.linalg.norm(turns, axis=1) > 0):
        raise ValueError(f"{path}: the columns of the quaternion must not be zero")
    rotations = scipy.spatial.transform.Rotation.from_quat(turns)
    steps = (rotations[1:] * rotations[:-1].inv()).as_rotvec(degrees=True)
    if dim == 2:
        return np.concatenate([[0.0], np.cumsum(steps[:, 2])]), None
    largest = steps[np.argmax(np.linalg.norm(steps, axis=1))]
    size = float(np.linalg.norm(largest))
    if size == 0.0:
        return np.zeros(len(turns)), None
    axis = largest / size
    along = steps @ axis
    across = np.abs(steps - along[:, None] * axis).sum()
    if across > ONE_AXIS * np.abs(along).sum():
        raise ValueError(f"{path}: the body turns about several axes, must turn about one")
    return np.concatenate([[0.0], np.cumsum(along)]), (axis[0], axis[1], axis[2])


def _table(path: Path) -> dict[str, Array]:
    """Columns of a table in SI units and degrees, by the names of `NAMES`."""
    with open(path, newline="", encoding="utf-8-sig") as file:
        lines = [line for line in file if line.strip() and not line.startswith("#")]
    if len(lines) < 3:
        raise ValueError(f"{path}: must have a line of names and at least two of numbers")
    # Where a comma is the decimal sign, spreadsheets separate columns by semicolons.
    separator = ";" if ";" in lines[0] and "," not in lines[0] else ","
    titles, *rows = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    names = {alias: name for name, aliases in NAMES.items() for alias in aliases}
    columns: dict[str, Array] = {}
    for k, title in enumerate(titles):
        text, _, unit = title.partition("[")
        name = names.get(text.strip().lower())
        if name is None:
            continue
        if name in columns:
            raise ValueError(f"{path}: the column {title!r} must be the only one of {name}")
        factor = _factor(path, title, name, unit.partition("]")[0].strip())
        try:
            entries = [row[k].replace(",", ".") for row in rows]
            columns[name] = factor * np.array([float(entry) for entry in entries])
        except (ValueError, IndexError):
            raise ValueError(
                f"{path}: the column {title!r} must have a number in each row"
            ) from None
    return columns


def _factor(path: Path, title: str, name: str, unit: str) -> float:
    """Factor from the unit of a column to that of `Motion.through`."""
    if name not in UNITS:
        return 1.0
    if not unit:
        return UNITS["angle"]["rad"] if "rad" in title.lower() else 1.0
    if unit not in UNITS[name]:
        known = ", ".join(UNITS[name])
        raise ValueError(f"{path}: the column {title!r} must have one of the units {known}")
    return UNITS[name][unit]
