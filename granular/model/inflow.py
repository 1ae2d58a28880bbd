"""Inflows: regions where material enters a running simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granular.materials import Material
from granular.model.fill import Fill, check_inside, rest_density
from granular.model.grid import AXES, Grid
from granular.model.regions import Cloud
from granular.model.seeding import Points, SeededPoints, estimated_points, joined
from granular.shapes import Box, Region
from granular.tools.arrays import Array, IntArray
from granular.tools.checks import (
    check_fields,
    kinds_of,
    non_negative,
    positive,
    sequence,
    set_fields,
    truth,
    vector,
)
from granular.tools.description import Description

if TYPE_CHECKING:
    from granular.model.scene import BaseScene


FULL = 1 + 1e-9
"""Largest filling fraction of entering material; the excess over 1 is for rounding."""


def _times(name: str, value: object) -> tuple[float, float]:
    """Two times, of which the later one may be infinite."""
    times = sequence(name, value)
    if len(times) != 2:
        raise ValueError(f"{name} = {times} must be two times")
    begin = non_negative(f"{name}[0]", times[0])
    end = non_negative(f"{name}[1]", times[1], allow_inf=True)
    if not end > begin:
        raise ValueError(f"{name}[1] = {end} must exceed {name}[0] = {begin}")
    return begin, end


@dataclass(frozen=True)
class Inflow(Description):
    """Material that enters during the run, as a seeding lattice that moves with a velocity.

    The inlet is the upstream end of `region`, along the axis along which the velocity is largest; a
    column of points enters at each site of the seeding lattice across the stream. Columns
    enter one after the other, so that the mass that has entered is the rate times the time to
    within a point, and the points of a column enter at the distance of the seeding lattice for any
    time step. The points that enter depend on the time alone, so that a run is the same with any
    output and any number of threads, and after a restart.

    Parameters
    ----------
    region : Region
        Where material enters. Its section across the stream counts, and its upstream end; the whole
        of it for a driven inflow, which must be a `Box` that is not turned. Not a `Cloud`.
    velocity : tuple of float, length dim
        Velocity with which the points enter [m/s], not 0.
    points_per_cell : int
        As of `Fill`; in MPM that of the first fill of the scene, or without fills of its first
        inflow, and 1 in SPH.
    rate : float or None
        Mass that enters per time [kg/s; in 2D per metre of depth], which determines the density,
        rate/(A v), with the area A of the inlet and the velocity v through it. None for the rate
        that follows from `density`, rho A v. Must be None with a `density`, if `lithostatic`, and
        in SPH.
    density : float or None
        Density of the entering material [kg/m3]; None for `rho_c` of the material, or the density
        that follows from `rate`. It must not exceed `rho_c`: such material is stress-free. Must be
        None if `lithostatic`, and in SPH.
    packing : float or None
        As of `Fill`, of material that dilates.
    lithostatic : bool
        If True, the entering material bears its weight from the start: its pressure is that of the
        depth below the top of the region under the gravity across the stream, as of a layer that
        flows down a slope. It is the same in all directions, as in a flow.
    material : Material or None
        Material that enters; None for the material of the scene.
    times : tuple of (begin, end)
        Times [s] between which points enter; the end may be infinite.
    driven : bool
        If False, points are free from the moment in which they enter. If the position of a point is
        occupied by others of its column, it waits until it is free, and points that are due in the
        meantime are missed: the inlet is choked, and feeds as much as the flow below admits.
        `Simulation.inflows` counts the missed points.
        If True, the region is full from the start, and all material in it moves with the velocity,
        whatever is in its way, up to the end of `times`, like a piston that does not yield. The
        nodes of the grid that its points touch have this velocity, to the sides and upstream also
        those beyond it. It must begin at time 0. SPH has driven inflows only: its particles in the
        region have this velocity.
    {raises}.
    """

    region: Region
    velocity: tuple[float, ...]
    points_per_cell: int
    _: KW_ONLY
    rate: float | None = None
    density: float | None = None
    packing: float | None = None
    lithostatic: bool = False
    material: Material | None = None
    times: tuple[float, float] = (0.0, math.inf)
    driven: bool = False

    def __post_init__(self) -> None:
        kinds_of(self, region=Region)
        if isinstance(self.region, Cloud):
            raise TypeError("region must not be a Cloud, whose points have given positions")
        check_fields(self, vector, "velocity", dim=self.region.dim)
        if not any(self.velocity):
            raise ValueError(f"velocity = {self.velocity} must not be 0: no material would enter")
        check_fields(self, positive, "rate", "density", optional=True)
        check_fields(self, _times, "times")
        set_fields(self, points_per_cell=self._fill().points_per_cell)
        if self.rate is not None and self.density is not None:
            raise ValueError(
                f"density = {self.density} must be None with rate = {self.rate}, which gives it"
            )
        if truth("lithostatic", self.lithostatic) and self.rate is not None:
            raise ValueError(f"rate = {self.rate} must be None in a lithostatic inflow")
        if truth("driven", self.driven):
            if not isinstance(self.region, Box) or self.region.is_turned:
                raise TypeError(
                    f"region = {self.region!r} must be a Box that is not turned for a driven inflow"
                )
            if self.times[0]:
                raise ValueError(f"times[0] = {self.times[0]} must be 0 for a driven inflow")

    @property
    def points_per_axis(self) -> int:
        """Points along an edge of a cell."""
        return self._fill().points_per_axis

    @property
    def axis(self) -> int:
        """Axis along which the material enters, with the largest component of the velocity."""
        return int(np.argmax(np.abs(self.velocity)))

    @property
    def speed(self) -> float:
        """Velocity through the inlet, along its axis [m/s], > 0."""
        return abs(self.velocity[self.axis])

    @property
    def plane(self) -> float:
        """Coordinate along its axis of the upstream end of the region, where points enter [m]."""
        lower, upper = self.region.bounds
        return (lower if self.velocity[self.axis] > 0 else upper)[self.axis]

    def _fill(self, density: float | None = None) -> Fill:
        """Fill of the region with the entering material."""
        return Fill(
            self.region,
            self.points_per_cell,
            density=self.density if density is None else density,
            packing=self.packing,
            velocity=self.velocity,
            lithostatic=self.lithostatic,
            material=self.material,
        )

    def check(self, name: str, grid: Grid, rho_c: float) -> None:
        """Refuse an inflow that does not fit the grid, or is denser than its material."""
        check_inside(name, grid, self.region)
        if not estimated_points(grid, replace(self, rate=None)._fill(), even=True):
            raise ValueError(f"{name} = {self} must hold at least one site of the seeding lattice")
        if grid.periodic[self.axis]:
            raise ValueError(
                f"{name}.velocity = {self.velocity} must be largest along another axis than "
                f"{AXES[self.axis]}, along which the grid is periodic"
            )
        if self.rate is None and self.density is None:
            return
        density = self.density_in(grid, rho_c)
        if density <= rho_c * FULL:
            return
        if self.rate is None:
            raise ValueError(f"{name}.density = {density} must be <= {rho_c}, rho_c")
        most = self.rate * rho_c / density
        raise ValueError(
            f"{name}.rate = {self.rate} must be <= {most:.6g}, the rate of a full inlet at "
            f"velocity = {self.velocity}: take a larger region or velocity"
        )

    def area(self, grid: Grid) -> float:
        """Area of the sites of the inlet [m2; in 2D m, unless the grid is axisymmetric]."""
        return float(self._sites(grid).volume.sum()) * self.points_per_axis / grid.cell

    def density_in(self, grid: Grid, rho_c: float) -> float:
        """Density of the entering material [kg/m3], stress-free; `rho_c` is that of its
        material."""
        if self.rate is not None:
            return self.rate / (self.area(grid) * self.speed)
        return rho_c if self.density is None else self.density

    def rate_in(self, grid: Grid, rho_c: float) -> float:
        """Mass that enters per time [kg/s]; `rho_c` is the density of its material [kg/m3]."""
        return self.density_in(grid, rho_c) * self.area(grid) * self.speed

    def _sites(self, grid: Grid, up: Sequence[float] | None = None, density: float = 1.0) -> Points:
        """Points at the upstream end of each column of the region along the stream."""
        fill = self._fill(None if self.lithostatic else density)
        points = joined(SeededPoints(grid, (fill,), 0, (density,), up=up, even=True), grid.dim)
        along = points.x[:, self.axis] * math.copysign(1.0, self.velocity[self.axis])
        place = (points.x - grid.lower) * (self.points_per_axis / grid.cell)
        across = np.floor(np.delete(place, self.axis, axis=1))
        _, column = np.unique(across, axis=0, return_inverse=True)
        order = np.lexsort((along, column.ravel()))
        begins = np.diff(column.ravel()[order], prepend=-1) != 0
        first = np.zeros(len(along), dtype=bool)
        first[order[begins]] = True
        return Points(*(array[first] for array in vars(points).values()))

    def entering(self, grid: Grid, rho_c: float, up: Sequence[float] | None = None) -> Points:
        """Points that enter, one for each site, in their order; `rho_c` as of `rate_in`.

        They enter at the upstream end of the region: a column of points, each of which stands for
        a spacing, then begins there in the mean over the columns.
        """
        points = self._sites(grid, up, rho_c if self.lithostatic else self.density_in(grid, rho_c))
        x = points.x.copy()
        x[:, self.axis] = self.plane
        # The upper end of a grid does not belong to any cell.
        return replace(points, x=np.minimum(x, np.nextafter(grid.upper, grid.lower)))


@dataclass(frozen=True, eq=False, kw_only=True)
class InflowState:
    """Account of an inflow since the start of the run.

    Attributes
    ----------
    points : int
        Number of points that have entered.
    missed : int
        Number of points that were due and did not enter because their positions were occupied.
    mass : float
        Mass that has entered [kg; in 2D per metre of depth].
    momentum : ndarray, shape (dim,)
        Momentum that has entered with it [N s].
    energy : float
        Kinetic and elastic energy that has entered with it [J].
    height_energy : float
        Gravitational energy of it at the inlet, under the last gravity of the scene [J]; it is zero
        at the lower corner of the grid.
    impulse : ndarray, shape (dim,)
        Impulse of the nodes of a driven inflow on the material [N s]; 0 for others.
    work : float
        Work of these nodes on the material [J].
    """

    points: int
    missed: int
    mass: float
    momentum: Array
    energy: float
    height_energy: float
    impulse: Array
    work: float


def inlet_points(scene: BaseScene, i: int) -> Points:
    """Points that enter by an inflow of a scene; see `Inflow.entering`."""
    inflow, grid = scene.inflows[i], scene.grid
    rho_c = rest_density(inflow.material or scene.material, inflow.packing)
    up, share = None, 1.0
    if inflow.lithostatic:
        gravity = across(scene, inflow)
        size = math.hypot(*gravity)
        up = tuple((-gravity / size).tolist())
        share = size / math.hypot(*scene.gravity.at(0.0))
    points = inflow.entering(grid, rho_c, up)
    # The depth that has the same pressure under the whole gravity.
    fill = np.full(len(points.x), len(scene.fills) + i)
    return replace(points, depth=points.depth * share, fill=fill)


def standing_points(scene: BaseScene, i: int) -> Points:
    """Points that fill the region of a driven inflow at the start.

    They are the points that would have entered before if it had begun long ago.
    """
    inflow, grid = scene.inflows[i], scene.grid
    points, h = inlet_points(scene, i), grid.cell / inflow.points_per_axis
    n, axis = len(points.x), inflow.axis
    low, high = (corner[axis] for corner in inflow.region.bounds)
    layers = math.ceil((high - low) / h) + 1
    # In the order in which they entered: site m % n, and (layers n - 1 - m)/n spacings on its way.
    m = np.arange(layers * n)
    site, way = m % n, (layers * n - 1 - m) / n * h
    x = points.x[site] + way[:, None] * (np.array(inflow.velocity) / inflow.speed)
    within = way < high - low - grid.slack * grid.cell
    taken = {name: array[site][within] for name, array in vars(points).items()}
    return Points(**taken | {"x": x[within]})


def points_between(inflow: Inflow, grid: Grid, begin: float, end: float) -> int:
    """Largest number of points that enter by an inflow between two times [s]."""
    first, last = inflow.times
    seconds = max(min(end, last) - max(begin, first), 0.0)
    h = grid.cell / inflow.points_per_axis
    return math.floor(seconds * inflow.speed / h * len(inflow._sites(grid).x) * FULL)


def across(scene: BaseScene, inflow: Inflow) -> Array:
    """Gravity across the stream of an inflow at the start [m/s2]; 0 for one along gravity."""
    gravity = scene.gravity.at(0.0)
    along = np.array(inflow.velocity) / math.hypot(*inflow.velocity)
    rest = gravity - (gravity @ along) * along
    return np.where(np.abs(rest) > 1e-12 * np.abs(gravity).max(), rest, 0.0)


def stored_inflow(arrays: Mapping[str, NDArray], ids: IntArray) -> IntArray:
    """State of the inflows of a checkpoint, with points of these ids."""
    state = arrays.get("inflow")
    if state is None:
        raise ValueError("the checkpoint does not hold the inflow of the scene")
    if len(state) and state[0] <= ids.max(initial=-1):
        raise ValueError(
            f"inflow[0] = {state[0]} of the checkpoint must exceed the ids of all points"
        )
    return state
