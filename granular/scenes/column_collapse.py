"""Collapse onto a rough floor: of a column in 2D, of a cylinder in 3D."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

from granular import sph
from granular.materials import Material, MuI, glass_beads
from granular.model.fill import Fill
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import HEADROOM, Parts, enough_cells, smooth_sides
from granular.scenes._registry import scene_function
from granular.shapes import Box, Cylinder, Intersection
from granular.tools.checks import one_of, positive, truth


def _lip(lip: float | None, runout: float, name: str, radius: float) -> float:
    """Distance of the lip [m], by default 2 + 1.5 `runout` radii; refuses less than one radius."""
    if lip is None:
        lip = (2.0 + 1.5 * runout) * radius
    if positive("lip", lip) < radius:
        raise ValueError(f"lip = {lip} must not be less than {name} = {radius}")
    return lip


def _runout_of_column(aspect: float) -> float:
    """Run-out divided by half-width, by the paper's fit (figure 3)."""
    return 2.28 * aspect if aspect < 2.83 else 3.24 * aspect**0.66


@scene_function("mpm", "sph")
def column_collapse(
    *,
    aspect: float = 2.0,
    half_width: float = 0.2,
    cell: float | None = None,
    points_per_cell: int = 16,
    jitter: float = 0.0,
    lip: float | None = None,
    gravity: float = 9.8,
    ramp: float = 0.1,
    duration: float = 2.0,
    material: Material | sph.Viscoplastic = glass_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    method: str = "mpm",
    **material_numbers: Any,
) -> Parts:
    """Right half of a column that collapses (Dunatunga & Kamrin 2015, section 4.1).

    From the paper: half-width 0.2 m, aspect = height over half-width, cells of 0.0125 m (0.00625 m
    for aspect 0.5) with 16 points, rough floor, free_slip symmetry plane at x = 0 and
    free_slip lip at the right, gravity of 9.8 m/s2 ramped in 0.1 s, 2 s.

    Chosen here: the lip, whose position the paper does not give, stands at 2 + 1.5 R half-widths,
    R being the run-out of the paper's fit (2.28 aspect, or 3.24 aspect^0.66 above 2.83), so that
    the foot of the heap does not reach it. Height and half-width are rounded to rows of points.

    With SPH (`method` "sph") there are as many particles as points, and the material is that of
    `granular.sph.Viscoplastic.matching` at half the weight of the column. Walls made of particles
    always have friction: the wall in the symmetry plane and the lip have that of the floor. For
    the columns of grit and glass of Hurley's thesis see `granular.scenes.column_collapse_sph`.

    Parameters
    ----------
    aspect, half_width : float
        Height divided by half-width; half-width [m].
    cell : float or None
        Cell size [m]; None for 0.00625 if aspect <= 0.5, else 0.0125.
    lip : float or None
        Distance of the right wall from the symmetry plane [m], rounded up to whole cells.
    material, scheme, seed
        See `Scene`. With "sph" the material may also be a `granular.sph.Viscoplastic`, and the
        scheme is not used.
    method : {"mpm", "sph"}
        Method of solution.
    **material_numbers
        Numbers of `material` to change, such as `E`; with "sph" before the material of SPH is
        matched to it.
    {common}.
    """
    aspect = positive("aspect", aspect)
    half_width = positive("half_width", half_width)
    if cell is None:
        cell = 0.00625 if aspect <= 0.5 else 0.0125
    cell = positive("cell", cell)
    height = aspect * half_width
    lip = _lip(lip, _runout_of_column(aspect), "half_width", half_width)
    n_x = enough_cells(lip, cell)
    n_y = enough_cells(height, cell) + HEADROOM
    grid = Grid((0.0, 0.0), cell, (n_x, n_y))
    parts = Parts(
        grid=grid,
        fills=(Fill(Box((0.0, 0.0), (half_width, height)), points_per_cell, jitter=jitter),),
        walls=(Wall(1, 0.0, kind="no_slip"), *smooth_sides(grid)),
        parameters={"cell": cell, "lip": n_x * cell, "half": True},
    )
    if one_of("method", method, ("mpm", "sph")) == "mpm":
        return parts
    (fill,) = parts["fills"]
    per = fill.points_per_axis
    if isinstance(material, Material):
        weight = material.rho_c * positive("gravity", gravity) * height
        material = sph.Viscoplastic.matching(cast(MuI, material), 0.5 * weight)
    return parts | {
        "name": "column_collapse_sph",
        "grid": Grid((0.0, 0.0), cell / per, (n_x * per, n_y * per)),
        "fills": (replace(fill, points_per_cell=1),),
        "material": material,
        "walls": (
            sph.ParticleWall(1, 0.0, 1),
            sph.ParticleWall(0, 0.0, 1),
            sph.ParticleWall(0, n_x * cell, -1),
        ),
        "parameters": parts["parameters"] | {"method": method},
    }


def _runout_of_cylinder(aspect: float) -> float:
    """Run-out divided by radius, of cylinders of sand (Lube et al. 2004)."""
    return 1.24 * aspect if aspect < 1.7 else 1.6 * aspect**0.5


@scene_function("mpm")
def cylinder_collapse(
    *,
    aspect: float = 0.5,
    radius: float = 0.2,
    axisymmetric: bool = False,
    cell: float = 0.0125,
    points_per_cell: int | None = None,
    jitter: float = 0.0,
    lip: float | None = None,
    gravity: float = 9.8,
    ramp: float = 0.1,
    duration: float = 2.0,
    material: Material = glass_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """A cylinder that collapses: the column collapse of section 4.1, round.

    It is a quarter of the cylinder in 3D, or with `axisymmetric` a plane of radius and height,
    which takes a hundredth of the time.

    Dunatunga & Kamrin 2015 study 2D flows only. This scene is the experiment of Lube et al. 2004
    with the paper's material, gravity ramp and walls: no_slip floor, free_slip symmetry planes
    x = 0 and y = 0, free_slip lips.

    Chosen here: radius 0.2 m, cells of 0.0125 m with 8 points (4 in a plane), lips at 2 + 1.5 R
    radii, R being the
    run-out measured by Lube et al. (1.24 aspect, 1.6 aspect^0.5 from 1.7 on), 2 s. The round side
    is cut out of the seeding lattice; the height is rounded to rows of points.

    Parameters
    ----------
    aspect, radius : float
        Height divided by radius; radius [m].
    axisymmetric : bool
        Whether to simulate a plane of radius and height instead of a quarter in 3D.
    lip : float or None
        Distance of the outer walls from the axis [m], rounded up to whole cells.
    {common}.
    """
    aspect = positive("aspect", aspect)
    radius = positive("radius", radius)
    cell = positive("cell", cell)
    height = aspect * radius
    lip = _lip(lip, _runout_of_cylinder(aspect), "radius", radius)
    n = enough_cells(lip, cell)
    if truth("axisymmetric", axisymmetric):
        plane = Grid(
            (0.0, 0.0), cell, (n, enough_cells(height, cell) + HEADROOM), axisymmetric=True
        )
        count = 4 if points_per_cell is None else points_per_cell
        return Parts(
            grid=plane,
            fills=(Fill(Box((0.0, 0.0), (radius, height)), count, jitter=jitter),),
            walls=(Wall(1, 0.0, kind="no_slip"), *smooth_sides(plane)),
            parameters={"lip": n * cell},
        )
    grid = Grid((0.0, 0.0, 0.0), cell, (n, n, enough_cells(height, cell) + HEADROOM))
    quarter = Intersection(
        (
            Cylinder(radius, center=(0.0, 0.0, 0.5 * height), axis=(0.0, 0.0, 1.0), length=height),
            Box((0.0, 0.0, 0.0), (radius, radius, height)),
        )
    )
    return Parts(
        grid=grid,
        fills=(Fill(quarter, 8 if points_per_cell is None else points_per_cell, jitter=jitter),),
        walls=(Wall(2, 0.0, kind="no_slip"), *smooth_sides(grid)),
        parameters={"lip": n * cell, "quarter": True},
    )
