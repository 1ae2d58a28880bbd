"""What LAMMPS wrote, read back: grains and contacts of each frame as plain arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from granular.dem.process import DemError
from granular.dem.settings import Units

__all__ = ["ATOM_COLUMNS", "CONTACT_COLUMNS", "Contacts", "Frame", "read_frames"]

Array = NDArray[np.float64]

ATOM_COLUMNS = ("id", "type", "diameter", "mass", *"xyz", "vx", "vy", "vz")
CONTACT_COLUMNS = ("dx", "dy", "dz", "force", "p1", "p2", "p3", "p5", "p6", "p7", "p8", "p9", "p10")
"""Of `compute pair/local`: branch, normal force, tangential force, and the relative velocity of the
surfaces, normal and tangential."""


@dataclass(frozen=True)
class Contacts:
    """All contacts of a frame, each once.

    Attributes
    ----------
    i, j : ndarray of int, shape (k,)
        Rows of the two grains in the arrays of the frame.
    normal : ndarray, shape (k, 3)
        Unit vector from grain i to grain j.
    distance : ndarray, shape (k,)
        Between the two centroids [m].
    normal_force : ndarray, shape (k,)
        [N], repulsion positive, the viscous part included: with it a contact may pull.
    tangential_force : ndarray, shape (k, 3)
        On grain i [N].
    normal_velocity, tangential_velocity : ndarray, shape (k, 3)
        Of the surface of i against that of j [m/s].
    """

    i: NDArray[np.int64]
    j: NDArray[np.int64]
    normal: Array
    distance: Array
    normal_force: Array
    tangential_force: Array
    normal_velocity: Array
    tangential_velocity: Array

    @property
    def force(self) -> Array:
        """On grain i by grain j [N], shape (k, 3)."""
        return self.tangential_force - self.normal_force[:, None] * self.normal

    @property
    def branch(self) -> Array:
        """From the centroid of j to that of i [m], shape (k, 3), over the periodic sides."""
        return -self.distance[:, None] * self.normal


@dataclass(frozen=True)
class Frame:
    """The grains at one time.

    Attributes
    ----------
    time : float
        [s]
    box : ndarray, shape (3,)
        Lengths of the box [m]; with walls, along y from one end of the material to the other.
    id : ndarray of int, shape (n,)
        Ascending.
    wall : ndarray of bool, shape (n,)
        Grains that a rough wall is made of.
    radius, mass : ndarray, shape (n,)
        [m], [kg]
    x, v : ndarray, shape (n, 3)
        Centroids [m], inside the periodic box, and velocities [m/s].
    shear_rate : float
        Of the box [1/s]; nan with walls and in packings.
    contacts : Contacts
    """

    time: float
    box: Array
    id: NDArray[np.int64]
    wall: NDArray[np.bool_]
    radius: Array
    mass: Array
    x: Array
    v: Array
    shear_rate: float
    contacts: Contacts

    @property
    def contact_points(self) -> Array:
        """Middle of each overlap [m], shape (k, 3), beside grain i: perhaps outside of the box."""
        c = self.contacts
        overlap = self.radius[c.i] + self.radius[c.j] - c.distance
        return self.x[c.i] + (self.radius[c.i] - 0.5 * overlap)[:, None] * c.normal


@dataclass(frozen=True)
class _Table:
    """One frame of one dump file."""

    time: float
    bounds: Array
    rows: Array


def read_frames(folder: Path, units: Units, expected: int, rate: float) -> Iterator[Frame]:
    """The frames of a run in the order of time, one at a time, in SI units.

    Parameters
    ----------
    folder : Path
        Where LAMMPS has run.
    units : Units
        What it computed with.
    expected : int
        Frames.
    rate : float
        Shear rate at the height that the script has written down, if it has [1/s].

    Raises
    ------
    DemError
        If a file is missing, cut off or garbled, or there are not as many frames as expected.
    """
    height = folder / "height"
    tilting = rate * float(height.read_text()) if height.exists() else np.nan
    try:
        with open(folder / "atoms") as atoms, open(folder / "contacts") as contacts:
            for number in range(expected):
                one = _table(atoms, len(ATOM_COLUMNS), number)
                other = _table(contacts, 2 + len(CONTACT_COLUMNS), number)
                if one.time != other.time:
                    raise DemError(
                        f"frame {number}: grains at {one.time:g} s, contacts at {other.time:g} s"
                    )
                yield _frame(one, other, units, tilting)
    except FileNotFoundError as error:
        raise DemError(f"LAMMPS has not written its file {Path(error.filename).name!r}") from error


def _table(file: TextIO, columns: int, number: int) -> _Table:
    """The next table: an `ITEM:` line before each of time, step, count, bounds and rows."""
    try:
        head = [file.readline() for _ in range(9 + 2)]
        items = {head[k].split(":")[1].split()[0]: head[k + 1] for k in (0, 2, 4)}
        time, count = float(items["TIME"]), int(items["NUMBER"])
        bounds = np.array([line.split() for line in head[7:10]], dtype=float)
        rows = np.array("".join(islice(file, count)).split(), dtype=float)
        return _Table(time, bounds, rows.reshape(count, columns))
    except (ValueError, IndexError, KeyError) as error:
        raise DemError(f"frame {number} of what LAMMPS wrote is cut off or garbled") from error


def _frame(atoms: _Table, pairs: _Table, units: Units, tilting: float) -> Frame:
    rows = atoms.rows[np.argsort(atoms.rows[:, 0])]
    if not (np.isfinite(rows).all() and np.isfinite(pairs.rows).all()):
        raise DemError(f"the grains are not at finite places at {atoms.time * units.time:g} s")
    ids = rows[:, 0].astype(np.int64)
    i, j = np.searchsorted(ids, pairs.rows[:, :2].astype(np.int64)).T
    branch, rest = pairs.rows[:, 2:5], pairs.rows[:, 5:]
    distance = np.linalg.norm(branch, axis=1)
    contacts = Contacts(
        i=i,
        j=j,
        normal=-branch / distance[:, None],
        distance=distance * units.length,
        normal_force=rest[:, 0] * units.force,
        tangential_force=rest[:, 1:4] * units.force,
        normal_velocity=rest[:, 4:7] * units.speed,
        tangential_velocity=rest[:, 7:10] * units.speed,
    )
    box = _lengths(atoms.bounds)
    return Frame(
        time=atoms.time * units.time,
        box=box * units.length,
        id=ids,
        wall=rows[:, 1] > 2,
        radius=0.5 * rows[:, 2] * units.length,
        mass=rows[:, 3] * units.mass,
        x=rows[:, 4:7] * units.length,
        v=rows[:, 7:10] * units.speed,
        shear_rate=tilting / box[1],
        contacts=contacts,
    )


def _lengths(bounds: Array) -> Array:
    """Lengths of the box: bounds of a tilted one include its tilts xy, xz, yz."""
    lengths = bounds[:, 1] - bounds[:, 0]
    if bounds.shape[1] == 3:
        xy, xz, yz = bounds[:, 2]
        along_x = (0.0, xy, xz, xy + xz)
        lengths = lengths - np.array([max(along_x) - min(along_x), abs(yz), 0.0])
    return lengths
