"""Indicators of a failing scheme in the bulk: stress-free points, density drift, strings, gaps.

The bulk consists of the points deep below the surface of their column. One `Bulk` serves several of
these measures, so that the sums over cells are computed only once.
"""

from __future__ import annotations

import numpy as np

from granular.measure.averaging_grid import require_points
from granular.measure.cell_neighbours import CellNeighbours
from granular.measure.cell_sums import CellSums, ill_posed_points
from granular.model.state import State
from granular.mpm.blocks import solid_cells
from granular.tools.arrays import Array, BoolArray
from granular.tools.checks import integer, non_negative

FILLED = 0.5
"""Share of the mass it holds at rho_c from which a cell counts as filled."""

DEEP = 0.9
"""Mean filling about a cell from which it is inside the material, for `string_fraction`."""

UNEVEN = 0.45
"""Root mean square, over a cell and its neighbours, of filling less mean filling from which points
are drawn into strings. In a random packing of 4 points per cell it is 0.3."""


class Bulk:
    """Cell sums of a state, and the mask of its points in the bulk.

    The bulk consists of the points more than `depth_cells` cells below the surface of their
    column. The surface is the upper edge of the run of filled cells that leads up from the point's
    own cell without a gap. A cell is filled if its points, at rho_c, fill at least half of it, so
    that neither spray above a heap nor free fall below an orifice counts as bulk.

    Fields of cells are those of `CellNeighbours`.

    Parameters
    ----------
    sums : CellSums
    depth_cells : int
        Number of cells below the surface that are not bulk.
    packed : float
        Least density, as a share of rho_c, averaged over a bulk cell and its occupied neighbours.
        Less dense material in free flight inside a body is rightly free of stress.

    Attributes
    ----------
    cells : ndarray of bool, shape (n,)
        The cells of which all points are the bulk.
    about : CellNeighbours
        The cells with points, and those next to them.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, or there are no points.
    """

    def __init__(self, sums: CellSums, *, depth_cells: int = 2, packed: float = 0.0) -> None:
        integer("depth_cells", depth_cells, 0)
        non_negative("packed", packed)
        if not sums.n:
            raise ValueError(f"state at time = {sums.time} has 0 points, at least 1 is needed")
        grid = sums.scene.grid
        self.scene, self._sums = sums.scene, sums
        self.about = CellNeighbours(grid, sums.cells)
        self.cell_volume = grid.cell**grid.dim
        self.mass = self.sum("mass")
        solid = self.sum("rest_section")
        filled = solid >= FILLED * self.cell_volume
        deep = filled & (self.about.below_top(filled) >= depth_cells)
        if packed:
            deep &= self.around(solid) >= packed * self.cell_volume
        self.cells: BoolArray = deep

    def sum(self, name: str) -> Array:
        """Sums of `CellSums`, a field of cells."""
        return self.about.field(self._sums.of[name])

    @property
    def n(self) -> int:
        """Number of points in the bulk."""
        return int(self.sum("count")[self.cells].sum())

    def around(self, cells: Array) -> Array:
        """Mean of a cell field over each cell and its occupied neighbours, corners included.

        With SPH a cell holds one particle on average, and may be empty in the midst of others.
        """
        occupied = self.mass > 0
        if self.scene.method == "sph":
            occupied = self._closed(occupied)
        return self.about.pooled(cells) / np.maximum(self.about.pooled(occupied.astype(float)), 1.0)

    def _closed(self, cells: BoolArray) -> BoolArray:
        """Cells that are true, and those between them: the closing by a cell and its neighbours."""
        near = (self.about.pooled(cells.astype(float)) > 0).astype(float)
        return np.asarray(cells | (self.about.pooled(near) == self.about.most_neighbours()))

    def disconnected(self, pressed: float = 0.0) -> float:
        """Share, by mass, of the stress-free points of grains in the bulk; nan without a bulk.

        Only points count around which the mean pressure is at least that of `pressed` cells.
        """
        free = self.sum("free")
        if pressed:
            pull = np.linalg.norm(self.scene.gravity.vectors, axis=1).max()
            densities = np.array([material.rho_c for material in self.scene.materials])
            weights = densities * pull * self.scene.grid.cell  # of a cell, per area of its face
            free *= self._pressure_about()[..., None] >= pressed * weights
        return self._share(free.sum(axis=-1))

    def _pressure_about(self) -> Array:
        """Mean pressure over each cell and its neighbours [Pa]."""
        volume = np.maximum(self.about.pooled(self.sum("rest_section")), 1e-300)
        return np.asarray(self.about.pooled(self.sum("load")) / volume)

    def drift(self) -> float:
        """Mass-weighted mean over the bulk of particle volume over cell volume, minus one.

        An ejected point may have any volume; it counts with two cells at most. nan without a bulk.
        """
        return self._share(self.mass * self.around(self.sum("section")) / self.cell_volume) - 1.0

    def strings(self) -> float:
        """Share of the cells inside the material whose fillings alternate; nan without any."""
        filling = self.sum("rest_section") / self.cell_volume
        mean = self.about.smoothed(filling)
        deep = mean >= DEEP
        if not deep.any():
            return np.nan
        square = self.about.pooled((filling - mean) ** 2) / self.about.most_neighbours()
        return float((square[deep] > UNEVEN**2).mean())

    def _share(self, sums: Array) -> float:
        """Sum over the bulk over its mass."""
        mass = self.mass[self.cells].sum()
        return float(sums[self.cells].sum() / mass) if mass > 0 else np.nan


def disconnected_fraction(
    state: State, *, depth_cells: int = 2, packed: float = 0.0, pressed: float = 0.0
) -> float:
    """Share, by mass, of the stress-free points (p = 0) in the bulk.

    Parameters
    ----------
    depth_cells, packed
        Definition of the bulk, see `Bulk`. With `packed` = 0 it includes material in free flight
        inside a body.
    pressed : float
        Count only points around which the mean pressure, over their cell and its neighbours, is at
        least the weight of so many cells. With 1, material in free flight or under hardly any
        pressure, as above an outlet, does not count as disconnected.

    Returns
    -------
    float
        0 in a dense flow that the scheme resolves properly.

    Raises
    ------
    ValueError
        If the state is empty, a point is off the grid, or no point lies in the bulk.
    """
    non_negative("pressed", pressed)
    return _bulk(state, depth_cells, packed).disconnected(pressed)


def density_drift(state: State, *, depth_cells: int = 2, packed: float = 0.9) -> float:
    """Drift of the particle density from the volume that the points really occupy.

    In each cell and its occupied neighbours the sum of the particle volumes m/rho is divided by
    the volume of these cells; the ratio minus one is averaged, by mass, over the bulk. It is
    positive where points have come closer together than their densities imply, as with the scheme
    of Dunatunga & Kamrin 2015 in 2D shear flow.

    Parameters
    ----------
    depth_cells, packed
        Definition of the bulk, see `Bulk`.

    Returns
    -------
    float
        0 for an undisturbed packing.

    Raises
    ------
    ValueError
        As `disconnected_fraction`.
    """
    return _bulk(state, depth_cells, packed).drift()


def string_fraction(state: State) -> float:
    """Share of the cells inside the material among which full and empty ones alternate.

    Stretching draws the points of a seeding lattice into strings: cells empty and fill in turn,
    while the nodes, whose sums are over the cells around them, keep their mass. With the filling f
    of a cell at rho_c and its mean g over the neighbours, with the weights 1, 2, 1 along each axis,
    a cell is inside the material where g is 0.9 or more. It counts where the root mean square of
    f - g over it and its neighbours exceeds 0.45.

    Returns
    -------
    float
        0 in an even packing; nan if no cell is inside the material.

    Raises
    ------
    ValueError
        If the state is empty or a point is off the grid.
    """
    return Bulk(CellSums.from_state(state)).strings()


def _bulk(state: State, depth_cells: int, packed: float) -> Bulk:
    bulk = Bulk(CellSums.from_state(state), depth_cells=depth_cells, packed=packed)
    if not bulk.cells.any():
        raise ValueError(
            f"no point lies more than depth_cells = {depth_cells} below the surface, "
            f"in a volume with packed = {packed} of rho_c"
        )
    return bulk


def ill_posed_fraction(state: State) -> float:
    """Share, by mass, of the flowing points at which the mu(I) law is ill posed.

    Ill-posedness is decided by `granular.theory.ill_posedness` (Barker et al. 2015). Where the law
    is ill posed, the shortest waves grow fastest and refinement need not converge. A point flows if
    it is under pressure and I/I0 > 1e-3.

    Returns
    -------
    float
        nan if no point flows, those of material that dilates apart.

    Raises
    ------
    ValueError
        If the state is empty, or the material has no xi because it has no mu(I) law.
    """
    require_points(state)
    flowing, ill = ill_posed_points(state)
    mass = np.asarray(state.mass)
    return float(mass[ill].sum() / mass[flowing].sum()) if flowing.any() else float("nan")


def gap_fraction(state: State) -> float:
    """Number of empty cells between cells with stressed points, over the number of the latter.

    This concerns bodies under tension; grains around such bodies do not count. Once their points
    are a cell apart, cells between them are empty and the grid no longer connects them: the body is
    torn by the discretisation, not by its constitutive law.

    Returns
    -------
    float
        0 for a whole body; nan if no point is under stress.

    Raises
    ------
    ValueError
        If the state is empty or a point is off the grid.
    """
    return gaps(Bulk(CellSums.from_state(state)))


def gaps(bulk: Bulk) -> float:
    """`gap_fraction` of the state of a `Bulk`."""
    stressed = bulk.sum("held") > 0
    empty = bulk.mass == 0
    cells = np.unravel_index(bulk.about.flat[empty], bulk.about.shape)
    empty[empty] = ~solid_cells(bulk.scene.grid, bulk.scene.walls).at(cells)
    between = np.zeros(len(empty), dtype=bool)
    for axis in range(bulk.scene.grid.dim):
        before, after = (bulk.about.side(stressed, axis, side) for side in (0, 1))
        between |= empty & before & after
    count = np.count_nonzero(stressed)
    return float(np.count_nonzero(between) / count) if count else float("nan")
