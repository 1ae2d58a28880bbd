"""A layer on a periodic rough incline, in 2D or 3D."""

from __future__ import annotations

import math
from typing import Any

from granular.checks import in_range, integer, non_negative, positive
from granular.geometry import Box, Fill, Grid
from granular.gravity import Gravity
from granular.materials import Material, glass_beads
from granular.mpm import schemes
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import whole_cells
from granular.scenes._registry import scene_function


@scene_function("mpm")
def incline(
    *,
    angle_deg: float = 25.0,
    height: float = 0.2,
    cell: float = 0.005,
    columns: int = 1,
    columns_across: int = 0,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    headroom: int = 8,
    gravity: float = 9.8,
    ramp: float = 0.1,
    duration: float = 20.0,
    material: Material = glass_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Scene:
    """Layer on an incline, with x down the slope (Dunatunga & Kamrin 2015, section 4.4).

    From the paper: 0.2 m high, cells of 0.005 m with 4 points, one column of cells, periodic in x,
    no_slip base, angles of 19 to 34 deg, gravity ramped in 0.1 s. Gravity is tilted, not the grid.

    Chosen here: 20 s (near 25 deg the flow is steady after 24 s, near 32 deg after more than
    1000 s, so compare with the transient solution), and 8 free cells above the surface. One column
    cannot show the instabilities of a two-dimensional flow: use 4 or more, and a jitter, for those.

    Parameters
    ----------
    angle_deg : float
        Inclination [deg], 0 <= angle < 90.
    height : float
        Height of the layer across the slope [m], whole cells.
    cell : float
        Cell size [m].
    columns : int
        Number of cells along the slope.
    columns_across : int
        Number of cells along the horizontal axis across the slope, also periodic; 0 for 2D.
    points_per_cell, jitter
        See `granular.geometry.Fill`.
    headroom : int
        Number of free cells above the surface, >= 1.
    gravity, ramp : float
        Magnitude [m/s2] and the time in which it grows from zero to it [s].
    duration : float
        Duration [s].
    material, scheme, seed
        See `Scene`.
    **material_numbers
        Numbers of the material to change, such as `E`.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """
    angle = math.radians(in_range("angle_deg", angle_deg, 0.0, 90.0, open_high=True))
    cell = positive("cell", cell)
    columns = integer("columns", columns, 1)
    n_y = whole_cells("height", height, cell)
    gravity = positive("gravity", gravity)
    level: tuple[int, ...] = (columns,)
    if integer("columns_across", columns_across, 0):
        level += (columns_across,)
    still = (0.0,) * len(level)
    full = (gravity * math.sin(angle), *still[1:], -gravity * math.cos(angle))
    if non_negative("ramp", ramp) == 0.0:
        pull = Gravity((0.0,), (full,))
    else:
        pull = Gravity((0.0, ramp), ((*still, 0.0), full))
    return Scene(
        name="incline",
        grid=Grid(
            (*still, 0.0),
            cell,
            (*level, n_y + integer("headroom", headroom, 1)),
            periodic=(*(True for _ in level), False),
        ),
        fills=(
            Fill(
                Box((*still, 0.0), (*(n * cell for n in level), n_y * cell)),
                points_per_cell,
                jitter=jitter,
            ),
        ),
        material=material,
        scheme=scheme,
        walls=(Wall(len(level), 0.0, kind="no_slip"),),
        gravity=pull,
        duration=duration,
        seed=seed,
    )
