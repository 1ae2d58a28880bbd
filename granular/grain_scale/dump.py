"""Grains of a discrete-element run of other authors, from dumps of LAMMPS and LIGGGHTS, in SI
units."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from granular.grain_scale.dump_tables import Table, tables
from granular.model.regions import Cloud
from granular.tools.arrays import Array, IntArray
from granular.tools.checks import in_range, integer, positive

AXES = "xyz"
UNITS = {"si": (1.0, 1.0, 1.0), "cgs": (0.01, 1e-3, 1.0)}
"""Metres, kilograms and seconds in the units of LAMMPS that are made for grains, by their names."""


@dataclass(frozen=True, eq=False)
class DumpFrame:
    """The grains, or the pairs of grains, at one time, in SI units.

    Attributes
    ----------
    step : int
        Number of the time step.
    time : float
        Time [s]; nan if the dump does not contain it, and no `dt` was given.
    lower, upper : ndarray, shape (3,)
        Ends of the box [m].
    periodic : tuple of 3 bools
    columns : dict of str to ndarray, shape (n,)
        The columns of the dump by their names, in its own units.
    """

    step: int
    time: float
    lower: Array
    upper: Array
    periodic: tuple[bool, bool, bool]
    columns: Mapping[str, Array]
    _source: Dump = field(repr=False)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def column(self, *names: str) -> Array:
        """Columns side by side, shape (n, k), or (n,) for one.

        Raises
        ------
        ValueError
            Naming those that are missing, and those that exist.
        """
        missing = [name for name in names if name not in self.columns]
        if missing:
            raise ValueError(
                f"{self._source.name} must have the columns {', '.join(missing)}, has "
                f"{', '.join(self.columns)}"
            )
        values = np.stack([self.columns[name] for name in names], axis=1)
        return values if len(names) > 1 else values[:, 0]

    def _first_of(self, *choices: str) -> str | None:
        return next((name for name in choices if name in self.columns), None)

    @property
    def id(self) -> IntArray:
        """Ids of the grains, shape (n,)."""
        return self.column("id").astype(np.int64)

    @property
    def x(self) -> Array:
        """Centroids [m], shape (n, 3); along periodic axes in the box."""
        low, size = self.lower, self.upper - self.lower
        parts = []
        for k, axis in enumerate(AXES):
            name = self._first_of(axis, f"{axis}u", f"{axis}s", f"{axis}su") or axis
            along = self.column(name)
            if name[1:].startswith("s"):
                along = low[k] + along * size[k]
            else:
                along = along * self._source.length
            if self.periodic[k]:
                along = low[k] + (along - low[k]) % size[k]
            parts.append(along)
        return np.stack(parts, axis=1)

    @property
    def v(self) -> Array:
        """Velocities [m/s], shape (n, 3)."""
        return self.column("vx", "vy", "vz") * self._source.length / self._source.time

    @property
    def radius(self) -> Array:
        """Radii [m], shape (n,)."""
        if self._source.radius is not None:
            return np.full(len(self), self._source.radius)
        name = self._first_of("radius", "diameter")
        if name is None:
            raise ValueError(
                f"{self._source.name} has no column radius or diameter: give radius= to read_dump"
            )
        radius = self.column(name) * self._source.length * (0.5 if name == "diameter" else 1.0)
        if not (radius > 0).all():
            raise ValueError(f"{self._source.name}: {name} = {radius.min()} must be > 0")
        return radius

    @property
    def volume(self) -> Array:
        """Volumes of the grains, which are spheres [m3], shape (n,)."""
        return 4.0 / 3.0 * np.pi * self.radius**3

    @property
    def mass(self) -> Array:
        """Masses [kg], shape (n,)."""
        source = self._source
        if source.density is not None:
            return source.density * self.volume
        name = self._first_of("mass", "density")
        if name is None:
            raise ValueError(
                f"{source.name} has no column mass or density: give density= to read_dump"
            )
        mass = self.column(name) * source.mass
        if name == "density":
            mass = mass / source.length**3 * self.volume
        if not (mass > 0).all():
            raise ValueError(f"{source.name}: {name} = {mass.min()} must be > 0")
        return mass

    @property
    def force_unit(self) -> float:
        """Newtons in a unit of force of the file."""
        return self._source.mass * self._source.length / self._source.time**2

    def cloud(self, packing_fraction: float, *, axes: str = AXES) -> Cloud:
        """Material points that continue the run as a continuum: one for each grain.

        The volume of a point is that of its grain over the packing fraction, and its density
        the mass of the grain over that volume, so that mass and momentum are conserved. In 2D both
        are those of a metre of depth: the sums over the depth of the box, divided by it. Use it as
        ``gr.Fill(region=frame.cloud(0.6))``; for a lithostatic fill, whose density follows from its
        depth, take ``dataclasses.replace(cloud, density=None)``.

        Parameters
        ----------
        packing_fraction : float
            Volume of the grains in the volume of the material, in (0, 1).
        axes : str
            Axes of the dump that become x, y (and z) of the scene: "xyz", or two for a scene in 2D,
            such as "xz".
        """
        share = in_range(
            "packing_fraction", packing_fraction, 0.0, 1.0, open_low=True, open_high=True
        )
        numbers, depth = depth_along(self, axes)
        if not len(self):
            raise ValueError(f"{self._source.name} holds no grains at step {self.step}")
        volume = self.volume / share
        return Cloud(
            self.x[:, numbers],
            volume / depth,
            velocity=self.v[:, numbers],
            density=self.mass / volume,
        )


def depth_along(frame: DumpFrame, axes: str) -> tuple[list[int], float]:
    """Return the numbers of the selected axes, and the extent of the box along the other [m].

    The extent is 1 where all are selected.
    """
    numbers = [AXES.find(axis) for axis in axes] if isinstance(axes, str) else [-1]
    if not 2 <= len(numbers) <= 3 or -1 in numbers or len(set(numbers)) < len(numbers):
        raise ValueError(f"axes = {axes!r} must be two or three of x, y and z, each once")
    if len(numbers) == 3:
        return numbers, 1.0
    other = 3 - sum(numbers)
    return numbers, float(frame.upper[other] - frame.lower[other])


@dataclass(frozen=True, eq=False)
class Dump:
    """The frames of a dump, which are read one at a time; see `read_dump`.

    It can be iterated over, again and again, and has a length and indices, for which the file is
    read up to the frame.

    Attributes
    ----------
    path : str
    length, mass, time : float
        Metres, kilograms and seconds in a unit of the file.
    dt, radius, density : float or None
        As given to `read_dump`.
    """

    path: str
    length: float
    mass: float
    time: float
    dt: float | None
    radius: float | None
    density: float | None

    @property
    def name(self) -> str:
        """The dump in messages."""
        return f"path = {self.path!r}"

    def __iter__(self) -> Iterator[DumpFrame]:
        return (self._frame(table) for table in tables(self.path))

    def __len__(self) -> int:
        return sum(1 for _ in tables(self.path, only=-1))

    def __getitem__(self, index: int) -> DumpFrame:
        index = integer("index", index)
        place = index if index >= 0 else len(self) + index
        frames = islice(tables(self.path, only=place), max(place, 0), None)
        table = next(frames, None) if place >= 0 else None
        if table is None:
            raise IndexError(f"index = {index} must be that of one of the {len(self)} frames")
        return self._frame(table)

    def _frame(self, table: Table) -> DumpFrame:
        flags = [flag for flag in table.box if set(flag) <= set("pfsm")]
        tilted = table.bounds.shape[1] > 2 and table.bounds[:, 2:].any()
        if tilted or "abc" in table.box or len(flags) != 3:
            raise ValueError(
                f"{self.name}, line {table.line}: BOX BOUNDS {' '.join(table.box)} must be a box "
                "with edges along x, y and z, a triclinic one is not read"
            )
        bounds = table.bounds[:, :2] * self.length
        if not (bounds[:, 1] > bounds[:, 0]).all():
            raise ValueError(f"{self.name}, line {table.line}: the ends of its box must ascend")
        if "id" in table.columns:
            ids = np.sort(table.rows[:, table.columns.index("id")])
            if (ids[1:] == ids[:-1]).any():
                twice = int(ids[1:][ids[1:] == ids[:-1]][0])
                raise ValueError(f"{self.name}, line {table.line}: id = {twice} is there twice")
        time = table.time * self.time
        if math.isnan(time) and self.dt is not None:
            time = table.step * self.dt
        x, y, z = (flag == "pp" for flag in flags)
        return DumpFrame(
            step=table.step,
            time=time,
            lower=bounds[:, 0],
            upper=bounds[:, 1],
            periodic=(x, y, z),
            columns=dict(zip(table.columns, table.rows.T, strict=True)),
            _source=self,
        )


def read_dump(
    path: str | os.PathLike,
    *,
    length: float | None = None,
    mass: float | None = None,
    time: float | None = None,
    dt: float | None = None,
    radius: float | None = None,
    density: float | None = None,
) -> Dump:
    """Open a dump of LAMMPS or LIGGGHTS: text with ``ITEM: TIMESTEP``, perhaps compressed by gzip.

    A dump of grains has the columns ``x y z`` (or those of unwrapped or scaled coordinates, ``xu``,
    ``xs``, ``xsu``), as a rule ``id``, ``vx vy vz``, ``radius`` or ``diameter``, and ``mass`` or
    ``density``. A dump of pairs (``ITEM: ENTRIES``) has columns of any names; see
    `average_grains`. Columns are only required when they are used.

    A dump does not contain its units, unless it is written with ``dump_modify units yes``: units
    ``si`` and ``cgs`` are then known, and others must be given. Otherwise SI units are assumed.

    Parameters
    ----------
    path : path
    length, mass, time : float, optional
        Metres, kilograms and seconds in a unit of the file, > 0.
    dt : float, optional
        Time step [s], > 0, for the times of frames in a dump without them.
    radius : float, optional
        Radius of all grains [m], > 0, for a dump without.
    density : float, optional
        Density of all grains [kg/m3], > 0, for a dump without masses.

    Raises
    ------
    OSError
        If the file cannot be read.
    TypeError, ValueError
        Naming the argument or the file, its line, and the fault. Frames after the first are
        checked when they are read.
    """
    units = next((table.units for table in tables(path, only=-1)), "")
    known = UNITS.get(units or "si")
    given: Sequence[float | None] = (length, mass, time)
    if known is None and None in given:
        raise ValueError(
            f"path = {str(path)!r} has the units {units!r}, must be given length=, mass= and time="
        )
    of_length, of_mass, of_time = (
        positive(name, value) if value is not None else (known or (1.0,) * 3)[k]
        for k, (name, value) in enumerate(zip(("length", "mass", "time"), given, strict=True))
    )
    options = (
        None if value is None else positive(name, value)
        for name, value in (("dt", dt), ("radius", radius), ("density", density))
    )
    return Dump(str(path), of_length, of_mass, of_time, *options)
