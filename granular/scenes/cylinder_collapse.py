"""Axisymmetric collapse of a cylinder onto a rough floor, in 3D."""

from __future__ import annotations

from typing import Any

from granular.checks import positive
from granular.geometry import Box, Cylinder, Fill, Grid, Intersection
from granular.materials import Material, glass_beads
from granular.mpm import schemes
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import HEADROOM, enough_cells, gravity_down, smooth_sides
from granular.scenes._registry import scene_function


def _expected_runout(aspect: float) -> float:
    """Run-out divided by radius, of cylinders of sand (Lube et al. 2004)."""
    return 1.24 * aspect if aspect < 1.7 else 1.6 * aspect**0.5


@scene_function("mpm")
def cylinder_collapse(
    *,
    aspect: float = 0.5,
    radius: float = 0.2,
    cell: float = 0.0125,
    points_per_cell: int = 8,
    jitter: float = 0.0,
    lip: float | None = None,
    gravity: float = 9.8,
    ramp: float = 0.1,
    duration: float = 2.0,
    material: Material = glass_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Scene:
    """A quarter of a cylinder that collapses: the column collapse of section 4.1, in 3D.

    Dunatunga & Kamrin 2015 study 2D flows only. This scene is the experiment of Lube et al. 2004
    with the paper's material, gravity ramp and walls: no_slip floor, free_slip symmetry planes
    x = 0 and y = 0, free_slip lips.

    Chosen here: radius 0.2 m, cells of 0.0125 m with 8 points, lips at 2 + 1.5 R radii, R being
    the run-out that Lube et al. found (1.24 aspect, 1.6 aspect^0.5 from 1.7 on), 2 s. The round
    side is cut out of the seeding lattice; the height is rounded to rows of points.

    Parameters
    ----------
    aspect, radius : float
        Height divided by radius; radius [m].
    lip : float or None
        Distance of the outer walls from the axis [m], rounded up to whole cells.
    {common}
    """
    aspect = positive("aspect", aspect)
    radius = positive("radius", radius)
    cell = positive("cell", cell)
    height = aspect * radius
    if lip is None:
        lip = (2.0 + 1.5 * _expected_runout(aspect)) * radius
    if positive("lip", lip) < radius:
        raise ValueError(f"lip = {lip} must not be less than radius = {radius}")
    n = enough_cells(lip, cell)
    grid = Grid((0.0, 0.0, 0.0), cell, (n, n, enough_cells(height, cell) + HEADROOM))
    quarter = Intersection(
        (
            Cylinder((0.0, 0.0, 0.0), radius, height),
            Box((0.0, 0.0, 0.0), (radius, radius, height)),
        )
    )
    return Scene(
        name="cylinder_collapse",
        grid=grid,
        fills=(Fill(quarter, points_per_cell, jitter=jitter),),
        material=material,
        scheme=scheme,
        walls=(Wall(2, 0.0, kind="no_slip"), *smooth_sides(grid)),
        gravity=gravity_down(3, gravity, ramp),
        duration=duration,
        seed=seed,
        parameters={"lip": n * cell, "quarter": True},
    )
