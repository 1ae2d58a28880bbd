"""Results of measurements as tables: of pandas, as files for spreadsheets, and in short."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from granular.model.grid import AXES
from granular.tools.arrays import Array
from granular.tools.checks import truth
from granular.tools.extras import imported

FORCE = "N; N/m in 2D"
TORQUE = "N m; N in 2D"
IMPULSE = "N s; N s/m in 2D"
ANGULAR_IMPULSE = "N m s; N s in 2D"
MASS = "kg; kg/m in 2D"
ENERGY = "J; J/m in 2D"
RATE = "kg/s; kg/(s m) in 2D"
"""Units of quantities that are per metre of depth in 2D."""

QUATERNION = ("w", "x", "y", "z")


@dataclass(frozen=True)
class Table:
    """Columns of equal length, numbers that hold for all rows, and the units of both by name."""

    columns: Mapping[str, Any]
    constants: Mapping[str, Any]
    units: Mapping[str, str]

    def to_dataframe(self) -> Any:
        """The columns as a `pandas.DataFrame`, with the constants and the units in its `attrs`."""
        pandas = imported("pandas", "tables")
        table = pandas.DataFrame(dict(self.columns))
        table.attrs.update(self.constants, units=dict(self.units))
        return table

    def to_csv(self, path: str | os.PathLike[str], overwrite: bool = False) -> None:
        """Write a line for each constant, after a ``#``, one of the names and units, and the
        rows."""
        new = not truth("overwrite", overwrite)
        with open(Path(path), "x" if new else "w", newline="", encoding="utf-8") as file:
            for name, value in self.constants.items():
                file.write(f"# {name} = {_text(value)} {self.units.get(name, '')}".rstrip() + "\n")
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([_titled(name, self.units.get(name, "")) for name in self.columns])
            writer.writerows(zip(*map(_plain, self.columns.values()), strict=True))


class Result:
    """Base of results of measurements, which are dataclasses: their tables, and a short text.

    A subclass gives the units of its fields as arguments of the class.
    """

    UNITS: ClassVar[Mapping[str, str]] = {}

    def __init_subclass__(cls, **units: str) -> None:
        super().__init_subclass__()
        cls.UNITS = units
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = Result.__repr__  # type: ignore[method-assign]  # not of the dataclass

    def to_dataframe(self) -> Any:
        """Return a `pandas.DataFrame`: arrays are its columns, each component one of its own.

        Numbers that hold for all rows, and the units of the columns (``attrs["units"]``), are in
        its `attrs`. A result without arrays is one row.

        Raises
        ------
        ModuleNotFoundError
            If pandas is not installed: ``pip install 'granular-flow[tables]'``.
        """
        return self._table().to_dataframe()

    def to_csv(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write the table as text with commas, which spreadsheets open; pandas is not needed.

        The first line names the columns with their units. Numbers that hold for all rows come
        before it, each in a line that begins with ``#``; ``pandas.read_csv(path, comment="#")``
        skips them.

        Parameters
        ----------
        path : path
            File to write.
        overwrite : bool
            If True, replace an existing file.

        Raises
        ------
        FileExistsError
            If the file exists and `overwrite` is not set.
        """
        self._table().to_csv(path, overwrite)

    def _table(self) -> Table:
        values = {part.name: getattr(self, part.name) for part in fields(self)}  # type: ignore
        return table_of(values, self.UNITS)

    def __repr__(self) -> str:
        parts = {part.name: getattr(self, part.name) for part in fields(self)}  # type: ignore
        name = type(self).__name__
        texts = [(key, *_abstract(value, self.UNITS.get(key, ""))) for key, value in parts.items()]
        if not any(shape for _, shape, _ in texts):
            return f"{name}({', '.join(f'{key}={text}' for key, _, text in texts)})"
        wide, long = (max(len(text[k]) for text in texts) for k in (0, 1))
        lines = [f"  {key:{wide}}  {shape:{long}}  {text}" for key, shape, text in texts]
        return "\n".join([name, *lines])


def table_of(values: Mapping[str, Any], units: Mapping[str, str]) -> Table:
    """Return the table of named values: its columns are the arrays, or without any the numbers."""
    parts = [part for name in values for part in _parts(name, values[name], units.get(name, ""))]
    known = {name: unit for name, _, unit in parts if unit}
    columns = {name: value for name, value, _ in parts if isinstance(value, np.ndarray)}
    numbers = {name: value for name, value, _ in parts if name not in columns}
    if not columns:
        return Table({name: [value] for name, value in numbers.items()}, {}, known)
    constants = {name: value for name, value in numbers.items() if value is not None}
    return Table(columns, constants, known)


def _parts(name: str, value: Any, unit: str) -> list[tuple[str, Any, str]]:
    """Components of a value, with their names and units."""
    if isinstance(value, Result):
        inner = vars(value).items()
        return [
            part
            for key, one in inner
            for part in _parts(f"{name}_{key}", one, value.UNITS.get(key, ""))
        ]
    if isinstance(value, np.ndarray) and value.ndim > 1:
        flat = value.reshape(len(value), -1)
        names = component_names(name, flat.shape[1])
        return [(key, column, unit) for key, column in zip(names, flat.T, strict=True)]
    if isinstance(value, tuple):
        return [(f"{name}_{k}", part, unit) for k, part in enumerate(value)]
    return [(name, value, unit)]


def component_names(name: str, count: int) -> list[str]:
    """Names of the components of a vector, a quaternion or of others: v_x, or stress_0."""
    letters = (
        QUATERNION if name == "quaternion" else AXES[:count] if count in (2, 3) else range(count)
    )
    return [f"{name}_{letter}" for letter in letters]


def mesh_columns(axes: tuple[Array, ...], **values: Array) -> dict[str, Array]:
    """Columns of values on a mesh: the coordinates of each of its places, and the values there."""
    places = np.meshgrid(*axes, indexing="ij")
    size = places[0].size
    columns = {AXES[k]: place.ravel() for k, place in enumerate(places)}
    for name, value in values.items():
        flat = value.reshape(size, -1)
        names = component_names(name, flat.shape[1]) if flat.shape[1] > 1 else [name]
        columns |= dict(zip(names, flat.T, strict=True))
    return columns


def mesh_units(axes: tuple[Array, ...]) -> dict[str, str]:
    """Units of the coordinates of `mesh_columns`."""
    return dict.fromkeys(AXES[: len(axes)], "m")


def _titled(name: str, unit: str) -> str:
    return f"{name} [{unit}]" if unit else name


def _plain(column: Any) -> list[Any]:
    return column.tolist() if isinstance(column, np.ndarray) else list(column)


def _text(value: Any) -> str:
    return repr(float(value)) if isinstance(value, float) else str(value)


def _abstract(value: Any, unit: str) -> tuple[str, str]:
    """Shape and text of a value for the short text of a result; the shape of a scalar is empty."""
    tail = f" {unit}" if unit else ""
    if isinstance(value, np.ndarray) and value.ndim:
        shape = str(value.shape).replace(",)", ")")
        finite = value[np.isfinite(value)] if value.dtype.kind == "f" else value
        if not finite.size:
            return shape, "nan" if value.size else ""
        return shape, f"{finite.min():.4g} to {finite.max():.4g}{tail}"
    if isinstance(value, bool | np.bool_ | int | np.integer) or value is None:
        return "", f"{value}{tail if value is not None else ''}"
    if isinstance(value, float):
        return "", f"{value:.5g}{tail}"
    if isinstance(value, tuple) and all(isinstance(part, float | int) for part in value):
        return "", f"({', '.join(f'{part:.5g}' for part in value)}){tail}"
    if isinstance(value, tuple) and all(isinstance(part, np.ndarray) for part in value):
        return f"({len(value)})", " x ".join(str(len(part)) for part in value)
    return "", repr(value)
