"""A disconnected slug thrown against a wall, in 2D."""

from __future__ import annotations

from typing import Any

from granular.materials import Material, glass_beads
from granular.model.fill import Fill
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import Parts, enough_cells, smooth_sides
from granular.scenes._registry import scene_function
from granular.shapes import Sphere
from granular.tools.checks import non_negative, positive, vector


@scene_function("mpm")
def slug(
    *,
    radius: float = 0.15,
    center: tuple[float, float] = (0.2, 0.25),
    velocity: tuple[float, float] = (1.2, 3.0),
    density: float = 1200.0,
    wall_at: float = 0.75,
    headroom: float = 0.4,
    cell: float = 0.0083,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    gravity: float = 9.8,
    duration: float = 2.0,
    material: Material = glass_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """A disconnected disc that flies into a wall (Dunatunga & Kamrin 2015, section 4.5).

    From the paper: a disc at 1200 kg/m3 with the velocity (1.2, 3.0) m/s, gravity 9.8 m/s2 in
    full from the start, smooth walls, rough floor, cells of 0.0083 m with 4 points.

    Chosen here: radius 0.15 m, centre (0.2, 0.25) m; right wall at 0.75 m, which the slug meets
    after a third of a second, shortly after the top of its flight; left wall at x = 0; closed top
    0.4 m above the highest point of the free flight; 2 s.

    Parameters
    ----------
    radius, center : float, tuple of 2 floats
        Radius and centre of the disc [m]; it must lie between the walls and above the floor.
    velocity : tuple of 2 floats
        Initial velocity [m/s].
    density : float
        Initial density [kg/m3].
    wall_at : float
        Position of the right wall [m], rounded up to whole cells.
    headroom : float
        Height above the highest point of the free flight [m].
    {common}.
    """
    cell = positive("cell", cell)
    gravity = positive("gravity", gravity)
    v_x, v_y = vector("velocity", velocity, 2)
    velocity = (v_x, v_y)
    disc = Sphere(radius, center=vector("center", center, 2))
    (left, bottom), (right, top) = disc.bounds
    if min(left, bottom) < 0.0 or right > positive("wall_at", wall_at):
        raise ValueError(
            f"center = {center} must keep the disc of radius = {radius} above the floor y = 0"
            f" and between the walls x = 0 and wall_at = {wall_at}"
        )
    n_x = enough_cells(wall_at, cell)
    rise = max(velocity[1], 0.0)
    apex = top + rise * rise / (2.0 * gravity)
    n_y = enough_cells(apex + non_negative("headroom", headroom), cell)
    grid = Grid((0.0, 0.0), cell, (n_x, n_y))
    return Parts(
        grid=grid,
        fills=(Fill(disc, points_per_cell, density=density, velocity=velocity, jitter=jitter),),
        walls=(Wall(1, 0.0, kind="no_slip"), *smooth_sides(grid)),
        parameters={"center": disc.center, "velocity": velocity, "wall_at": n_x * cell},
    )
