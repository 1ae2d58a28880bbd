"""Readers of the output of LAMMPS: grains and contacts of each frame as plain arrays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from granular.grain_scale.dem.process import DemError
from granular.grain_scale.dem.settings import Packing, Shear
from granular.grain_scale.dump_tables import Table, tables
from granular.tools.arrays import Array, BoolArray, IntArray

ATOM_COLUMNS = (
    *("id", "type", "diameter", "mass", "x", "y", "z"),
    *("vx", "vy", "vz", "fx", "fy", "fz", "tqx", "tqy", "tqz"),
)
CONTACT_COLUMNS = (
    *("dx", "dy", "dz", "force", "p1", "p2", "p3"),
    *("p5", "p6", "p7", "p8", "p9", "p10"),
)
"""Columns of `compute pair/local`: branch vector, normal force, tangential force, and the normal
and tangential relative velocity of the surfaces."""


@dataclass(frozen=True)
class Contacts:
    """All contacts of a frame, each listed once.

    Attributes
    ----------
    i, j : ndarray of int, shape (k,)
        Rows of the two grains in the arrays of the frame.
    normal : ndarray, shape (k, 3)
        Unit vector from grain i to grain j.
    distance : ndarray, shape (k,)
        Distance between the two centroids [m].
    normal_force : ndarray, shape (k,)
        Normal force [N], repulsion positive. It includes the viscous part, due to which it may be
        attractive.
    tangential_force : ndarray, shape (k, 3)
        Tangential force on grain i [N].
    normal_velocity, tangential_velocity : ndarray, shape (k, 3)
        Velocity of the surface of i relative to that of j [m/s].
    damped_velocity : ndarray, shape (k, 3)
        Normal velocity from which the viscous force was computed [m/s]: that of half a time step
        before, without the part due to a growing box.
    """

    i: IntArray
    j: IntArray
    normal: Array
    distance: Array
    normal_force: Array
    tangential_force: Array
    normal_velocity: Array
    tangential_velocity: Array
    damped_velocity: Array

    @property
    def force(self) -> Array:
        """Force on grain i by grain j [N], shape (k, 3)."""
        return self.tangential_force - self.normal_force[:, None] * self.normal

    @property
    def branch(self) -> Array:
        """Vector from the centroid of j to that of i [m], shape (k, 3), across periodic sides."""
        return -self.distance[:, None] * self.normal


@dataclass(frozen=True)
class Frame:
    """The grains at one time.

    Attributes
    ----------
    time : float
        Time [s].
    box : ndarray, shape (3,)
        Lengths of the box [m]; with walls, along y from one end of the material to the other.
    id : ndarray of int, shape (n,)
        Ids of the grains, ascending.
    wall : ndarray of bool, shape (n,)
        True for the grains that form a rough wall.
    radius, mass : ndarray, shape (n,)
        Radii [m] and masses [kg] of the grains.
    x, v : ndarray, shape (n, 3)
        Centroids [m], inside the periodic box, and velocities [m/s].
    force : ndarray, shape (n, 3)
        Resultant force on each grain [N], as written by LAMMPS: the sum over its contacts.
    shear_rate : float
        Shear rate of the box [1/s]; nan with walls and in packings.
    contacts : Contacts
    """

    time: float
    box: Array
    id: IntArray
    wall: BoolArray
    radius: Array
    mass: Array
    x: Array
    v: Array
    force: Array
    shear_rate: float
    contacts: Contacts

    @property
    def contact_points(self) -> Array:
        """Middle of each overlap [m], shape (k, 3), next to grain i, perhaps outside the box."""
        c = self.contacts
        overlap = self.radius[c.i] + self.radius[c.j] - c.distance
        return self.x[c.i] + (self.radius[c.i] - 0.5 * overlap)[:, None] * c.normal


def read_frames(folder: Path, settings: Shear | Packing, expected: int) -> Iterator[Frame]:
    """Yield the frames of a run in the order of time, in SI units.

    Parameters
    ----------
    folder : Path
        Folder in which LAMMPS has run.
    settings : Shear or Packing
        Settings of the run.
    expected : int
        Number of frames.

    Raises
    ------
    DemError
        If a file is missing, truncated or garbled, or has another number of frames than expected.
    """
    height, tilting, growth = folder / "height", np.nan, np.zeros(expected)
    if isinstance(settings, Shear) and height.exists():
        tilting = settings.shear_rate * float(height.read_text())
        growth = _growth(folder / "growth", expected)
    try:
        atoms, contacts = tables(folder / "atoms"), tables(folder / "contacts")
        for number in range(expected):
            one = _table(atoms, len(ATOM_COLUMNS), number)
            other = _table(contacts, 2 + len(CONTACT_COLUMNS), number)
            if one.time != other.time:
                raise DemError(
                    f"frame {number}: grains at {one.time:g} s, contacts at {other.time:g} s"
                )
            yield _frame(one, other, settings, tilting, growth[number])
    except FileNotFoundError as error:
        raise DemError(f"LAMMPS has not written its file {Path(error.filename).name!r}") from error


def _growth(path: Path, expected: int) -> Array:
    """Growth rate of the height at each frame, as written by `fix ave/time`."""
    try:
        rows = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise DemError(f"the file {path.name!r} that LAMMPS wrote is garbled") from error
    if rows.shape != (expected, 2) or not np.isfinite(rows).all():
        raise DemError(
            f"the file {path.name!r} that LAMMPS wrote holds {len(rows)} frames, not {expected}"
        )
    return rows[:, 1]


def _table(frames: Iterator[Table], columns: int, number: int) -> Table:
    """Read the next table, which must have so many columns."""
    try:
        table = next(frames)
        if len(table.columns) != columns:
            raise ValueError(f"{len(table.columns)} columns, not {columns}")
        return table
    except (ValueError, StopIteration) as error:
        raise DemError(
            f"frame {number} of the output of LAMMPS is cut off or garbled: {error}"
        ) from error


def _frame(
    atoms: Table, pairs: Table, settings: Shear | Packing, tilting: float, growth: float
) -> Frame:
    rows = atoms.rows[np.argsort(atoms.rows[:, 0])]
    units, ids, box = settings.units, rows[:, 0].astype(np.int64), _lengths(atoms.bounds)
    if len(rows) == 0:
        raise DemError(f"no grains are left at {atoms.time * units.time:g} s")
    return Frame(
        time=atoms.time * units.time,
        box=box * units.length,
        id=ids,
        wall=rows[:, 1] > 2,
        radius=0.5 * rows[:, 2] * units.length,
        mass=rows[:, 3] * units.mass,
        x=rows[:, 4:7] * units.length,
        v=rows[:, 7:10] * units.speed,
        force=rows[:, 10:13] * units.force,
        shear_rate=tilting / box[1],
        contacts=_contacts(rows, pairs.rows, settings, growth),
    )


def _contacts(atoms: Array, pairs: Array, settings: Shear | Packing, growth: float) -> Contacts:
    """Contacts with the forces that LAMMPS applied, and all velocities at the same time.

    LAMMPS computes the forces from the velocities of half a step before. For the dump it computes
    them again at the end of the step, but with the periodic images of grains as they were at half
    the step; where grains collide hard this changes forces by some per cent. Moreover its
    velocities are relative to the growth of the box, which moves the grains as well. Both are
    corrected here.
    """
    units, grains = settings.units, settings.grains
    i, j = np.searchsorted(atoms[:, 0], pairs[:, :2]).T
    radius, mass = 0.5 * atoms[:, 2], atoms[:, 3]
    distance = np.linalg.norm(pairs[:, 2:5], axis=1)
    normal = -pairs[:, 2:5] / distance[:, None]
    free = 0.5 * settings.dt / units.time * (atoms[:, 1:2] <= 2)  # walls move as a whole
    gain = free * atoms[:, 10:13] / mass[:, None]  # of velocity, in the last half step
    spin = free * atoms[:, 13:16] / (0.4 * mass * radius**2)[:, None]
    image = np.abs(atoms[i, 4:7] - atoms[j, 4:7] - pairs[:, 2:5]).max(axis=1) > radius.min()
    late = image[:, None] * (gain[j] - radius[j, None] * np.cross(spin[j], normal))
    normal_late = _along(late, normal)
    normal_velocity = pairs[:, 9:12] - normal_late
    damped = normal_velocity - _along(gain[i] - gain[j], normal)
    curvature = np.sqrt(radius[i] * radius[j] / (radius[i] + radius[j]))
    overlap = np.maximum(radius[i] + radius[j] - distance, 0.0)
    damping = grains.gamma_n * units.length * units.time * curvature * np.sqrt(overlap)
    damping *= mass[i] * mass[j] / (mass[i] + mass[j])
    written, tangential = pairs[:, 5], pairs[:, 6:9]
    missing = damping * np.einsum("ka,ka->k", damped - pairs[:, 9:12], normal)
    applied = written + missing
    grown = np.zeros_like(normal)
    grown[:, 1] = growth * pairs[:, 3]
    normal_grown = _along(grown, normal)
    limit = (1.0 - 1e-6) * grains.mu_p * np.abs(written)
    limited = np.linalg.norm(tangential, axis=1) >= limit
    factor = np.divide(np.abs(applied), np.abs(written), where=written != 0, out=np.ones(len(i)))
    return Contacts(
        i=i,
        j=j,
        normal=normal,
        distance=distance * units.length,
        normal_force=applied * units.force,
        tangential_force=np.where(limited, factor, 1.0)[:, None] * tangential * units.force,
        normal_velocity=(normal_velocity + normal_grown) * units.speed,
        tangential_velocity=(pairs[:, 12:15] - late + normal_late + grown - normal_grown)
        * units.speed,
        damped_velocity=damped * units.speed,
    )


def _along(vectors: Array, normal: Array) -> Array:
    """Components of vectors along the normals, as vectors."""
    return np.einsum("ka,ka->k", vectors, normal)[:, None] * normal


def _lengths(bounds: Array) -> Array:
    """Lengths of the box; the bounds of a tilted one also contain its tilts xy, xz, yz."""
    lengths = bounds[:, 1] - bounds[:, 0]
    if bounds.shape[1] == 3:
        xy, xz, yz = bounds[:, 2]
        along_x = (0.0, xy, xz, xy + xz)
        lengths = lengths - np.array([max(along_x) - min(along_x), abs(yz), 0.0])
    return lengths
