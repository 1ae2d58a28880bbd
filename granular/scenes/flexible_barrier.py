"""A flow against an elastic plate that stands in its way, in 2D."""

from __future__ import annotations

from typing import Any

from granular.materials import Elastic, Material
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import Parts, down_slope, enough_cells, soft_beads, whole_cells
from granular.scenes._registry import scene_function
from granular.shapes import Box
from granular.tools.checks import in_range, non_negative, positive


@scene_function("mpm")
def flexible_barrier(
    *,
    angle_deg: float = 25.0,
    height: float = 0.2,
    length: float = 0.4,
    speed: float = 0.0,
    gap: float = 0.2,
    tall: float = 0.2,
    thick: float = 0.05,
    behind: float = 0.25,
    plate_E: float = 1e6,
    plate_nu: float = 0.3,
    plate_density: float = 1100.0,
    cell: float = 0.0125,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    headroom: float = 0.1,
    gravity: float = 9.81,
    duration: float = 1.5,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Column of grains that runs down a slope against an elastic plate clamped to the ground.

    All numbers are chosen here; the plate is of soft rubber. The plate is a second
    material of the scene, number 1 of `scene.materials`: its points are those with
    ``state.material == 1``. Grains stick to the plate where they press against it, and leave it
    where they would pull. Gravity is tilted, not the grid. Points that cross the lower end of the
    domain leave for good.

    With four cells over its thickness the plate bends as the theory of beams says, to 3 %.

    Parameters
    ----------
    angle_deg : float
        Inclination of the ground [deg], 0 <= angle < 90.
    height, length : float
        Height of the column across the slope and its length along it [m], whole cells.
    speed : float
        Initial velocity of the column down the slope [m/s], >= 0.
    gap : float
        Distance between the column and the plate [m], whole cells.
    tall, thick : float
        Height of the plate and its thickness along the slope [m], whole cells.
    behind : float
        Length of ground behind the plate [m].
    plate_E, plate_nu, plate_density : float
        Young's modulus [Pa], Poisson's ratio and density [kg/m3] of the plate.
    points_per_cell, jitter
        See `granular.Fill`; the plate is not jittered.
    headroom : float
        Height of the domain above the column or the plate, whichever is higher [m].
    {common}.
    """
    cell = positive("cell", cell)
    sizes = {"length": length, "height": height, "gap": gap, "tall": tall, "thick": thick}
    n_x, n_z, n_gap, n_tall, n_thick = (
        whole_cells(name, size, cell) for name, size in sizes.items()
    )
    begin, front = -(n_x + n_gap) * cell, -n_gap * cell
    cells = n_x + n_gap + n_thick + enough_cells(positive("behind", behind), cell)
    rows = max(n_z, n_tall) + enough_cells(positive("headroom", headroom), cell)
    plate = Elastic(
        E=positive("plate_E", plate_E),
        nu=in_range("plate_nu", plate_nu, 0.0, 0.5, open_high=True),
        rho_c=positive("plate_density", plate_density),
    )
    return Parts(
        grid=Grid((begin, 0.0), cell, (cells, rows), open_sides=frozenset({"x+"})),
        fills=(
            Fill(
                Box((begin, 0.0), (front, n_z * cell)),
                points_per_cell,
                velocity=(non_negative("speed", speed), 0.0),
                jitter=jitter,
                lithostatic=True,
            ),
            Fill(Box((0.0, 0.0), (n_thick * cell, n_tall * cell)), points_per_cell, material=plate),
        ),
        walls=(Wall(0, begin, kind="free_slip"), Wall(1, 0.0, kind="no_slip")),
        gravity=Gravity((0.0,), (down_slope(2, gravity, angle_deg),)),
    )
