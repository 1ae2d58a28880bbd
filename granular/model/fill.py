"""Fills of material points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from granular.materials import Material
from granular.model.grid import AXES, Grid, combined
from granular.shapes.height_map import HeightMap
from granular.shapes.mesh import Mesh
from granular.shapes.region import Region
from granular.tools.checks import (
    check_fields,
    in_range,
    integer,
    kinds_of,
    positive,
    set_fields,
    truth,
    vector,
)
from granular.tools.description import Description

Vector = tuple[float, ...]


@dataclass(frozen=True)
class Fill(Description):
    """Material that fills a region at the start, as points on a regular seeding lattice.

    Points are outside of the bodies of a scene: where a body cuts the square (cube) of a site, the
    point is at the centroid of the open part and has the volume of that part, so that the first row
    follows the surface. Parts of less than a tenth go to a neighbour. Where the centroid is within
    a body, outside of the region or in another fill, as in a wedge, the point is in the nearest
    piece of the part instead.

    Parameters
    ----------
    region : Region
        Region to fill: every site of the seeding lattice that lies inside gets a point. The surface
        of a shape, or of a `Layer`, cuts squares as bodies do; a single box that is not turned
        holds whole squares. A `Cloud` holds the points itself. In SPH all squares are whole.
    points_per_cell : int
        Points in a full cell: q^2 in 2D, q^3 in 3D, with an integer q.
    density : float or None
        Initial density [kg/m3]; None for the material's `rho_c`. Grains have the corresponding
        pressure, K ln(rho/rho_c) if that is positive; cohesive ones of a lower density are
        separated, and cohere once they touch. Must be None in a lithostatic fill.
    velocity : tuple of float, length dim, or None
        Initial velocity [m/s]; None for rest.
    jitter : float
        Amplitude of a random displacement, 0 to 1: it is uniform within +- jitter/2 point spacings
        along each axis. A point that would leave the region, or come nearer to a body, is not
        displaced.
    stagger : bool
        If True, each column of points along the last axis is raised or lowered by a different part
        of half a point spacing. Use it for material that a body carries across the grid: the points
        of a row then cross a line of nodes one after the other and not all at once. A `Cloud` is
        not changed.
    lithostatic : bool
        If True, the material bears its weight from the start: each point has the vertical stress of
        the depth below the top of the region above it, against gravity, and the density that
        corresponds to the mean of its stresses. This is an equilibrium where the top is level, and
        below a slope of one angle. The weight of other lithostatic fills above it is added. If
        False, grains have the pressure of their density, and an elastic material is stress-free;
        with Hencky's law it also has the pressure of its density.
    K0 : float or None
        Ratio of the horizontal to the vertical stress of a lithostatic fill, > 0, within yield of
        its material. None for the ratio of material that has settled by its weight alone,
        `Material.K0`: nu/(1 - nu), or more if that yields (at its `packing`). It is 1 - sin(phi) in
        many sands (Jaky 1944); compaction makes it larger, up to the passive limit. Must be None in
        a fill that is not lithostatic.
    material : Material or None
        Material of this fill; None for the material of the scene. Several materials share one
        velocity field, so that they stick to each other where they meet.
    packing : float or None
        Packing fraction at which material that dilates (`granular.DilatantMuI`) is free of stress
        at first, 0.3 to 0.8; its density is then `packing` rho_s in place of rho_c. None for its
        `phi_c`, and for other materials.
    {raises}.
    """

    region: Region
    points_per_cell: int
    density: float | None = None
    velocity: Vector | None = None
    jitter: float = 0.0
    stagger: bool = False
    lithostatic: bool = False
    K0: float | None = None
    material: Material | None = None
    packing: float | None = None

    def __post_init__(self) -> None:
        kinds_of(self, region=Region)
        if self.material is not None:
            kinds_of(self, material=Material)
        count = integer("points_per_cell", self.points_per_cell, 1, 10**6)
        if self.points_per_axis**self.region.dim != count:
            kind = "square" if self.region.dim == 2 else "cube"
            raise ValueError(f"points_per_cell = {count} must be the {kind} of an integer")
        set_fields(self, points_per_cell=count)
        check_fields(self, in_range, "jitter", low=0.0, high=1.0)
        check_fields(self, truth, "stagger")
        check_fields(self, positive, "density", optional=True)
        check_fields(self, in_range, "packing", low=0.3, high=0.8, optional=True)
        if truth("lithostatic", self.lithostatic) and self.density is not None:
            raise ValueError(f"density = {self.density} must be None in a lithostatic fill")
        check_fields(self, positive, "K0", optional=True)
        if self.K0 is not None and not self.lithostatic:
            raise ValueError(f"K0 = {self.K0} must be None in a fill that is not lithostatic")
        check_fields(self, vector, "velocity", dim=self.region.dim, optional=True)

    @property
    def points_per_axis(self) -> int:
        """Points along an edge of a cell."""
        return round(self.points_per_cell ** (1.0 / self.region.dim))


def rest_density(material: Any, packing: float | None) -> float:
    """Density [kg/m3] at which material of a source is free of stress."""
    rho_c: float = material.rho_c
    return rho_c if packing is None else packing * material.rho_s


def rest_friction(material: Any, packing: float | None, pressure: Any) -> Any:
    """Friction tau/p at which material of a source begins to flow at a pressure [Pa].

    A number, of material that dilates as many as there are pressures.
    """
    if not getattr(material, "dilates", False):
        return material.static_friction
    return material.peak_friction(material.phi_c if packing is None else packing, pressure)


def check_packing(name: str, material: Any, packing: float | None) -> None:
    """Refuse the packing fraction of a source whose material does not have one, or not this one."""
    if packing is None:
        return
    if not getattr(material, "dilates", False):
        kind = type(material).__name__
        raise ValueError(
            f"{name}.packing = {packing} must be None for {kind}, which does not dilate"
        )
    if material.peak_friction(packing, 0.0) <= 0:
        least = material.phi_c - material.mu_s / material.dilatancy
        raise ValueError(
            f"{name}.packing = {packing} must exceed {least:.4g}, phi_c - mu_s/dilatancy, below "
            "which the material has no friction"
        )


def _hint(grid: Grid, region: Region) -> str:
    """End of a message on a region that is too large: meshes are often in millimetres."""
    size = float(np.subtract(*region.bounds[::-1]).max())
    in_mm = size > 50 * max(grid.shape) * grid.cell
    has_mesh = any(isinstance(leaf, Mesh) for leaf in region.leaves())
    return "; did you mean Mesh.read(..., scale=1e-3)?" if in_mm and has_mesh else ""


def check_inside(name: str, grid: Grid, region: Region) -> None:
    """Refuse a region whose dimension is not that of the grid, or that extends beyond the grid."""
    if region.dim != grid.dim:
        raise ValueError(f"{name} has dimension {region.dim}, must have {grid.dim} as the grid")
    slack = grid.slack * grid.cell
    for axis, (low, high) in enumerate(zip(*region.bounds, strict=True)):
        if low < grid.lower[axis] - slack or high > grid.upper[axis] + slack:
            raise ValueError(
                f"{name} reaches from {low} to {high} along {AXES[axis]}, must stay in the grid"
                f" from {grid.lower[axis]} to {grid.upper[axis]}{_hint(grid, region)}"
            )
    corners = combined([np.array(ends) for ends in zip(*region.bounds, strict=True)])
    for leaf in region.leaves():
        if isinstance(leaf, HeightMap):
            leaf.check(name, corners, slack)
