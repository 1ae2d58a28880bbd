"""A silo in 3D that drains through a slot in a corner of its floor."""

from __future__ import annotations

from typing import Any

from granular.checks import positive
from granular.materials import Material, grc_1
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import (
    HEADROOM,
    block,
    gravity_down,
    reconnected,
    smooth_sides,
    whole_cells,
)
from granular.scenes._registry import scene_function

soft_grains = grc_1.replace(E=0.15e6, mu_s=0.3819)


@scene_function("mpm")
def silo_3d(
    *,
    length: float = 0.25,
    height: float = 0.125,
    width: float = 0.0625,
    slot: float = 0.025,
    cell: float = 0.00625,
    points_per_cell: int = 8,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 12.0,
    material: Material = soft_grains,
    scheme: Scheme = reconnected,
    seed: int = 0,
    **material_numbers: Any,
) -> Scene:
    """Silo with a slot at its left wall, across its whole width (Haeri & Skonieczny 2021, section
    4.3, figure 19).

    From the paper: rough bottom, smooth sides, E = 0.15 MPa, the grains of its table 1 with
    mu_s = 0.3819, 12 s, after which the slope is at the friction angle. From the scripts of the
    paper: 0.25 m long, filled 0.125 m high, a quarter of the length wide, a slot of 0.025 m.

    Chosen here: the slot is open from the start, and the fill is under its own weight. Points leave
    for good as they cross the bottom, z = 0, where the paper lets them fall on a floor. mu_2 is
    that of table 1 (the scripts have 1.5). The paper's cells of 4 mm do not divide these lengths,
    and its 32 000 points, 8 per cell, fill an eighth of the volume; here the cells are 6.25 mm with
    64 000 points. Between smooth sides nothing depends on y, so that a `width` of two cells gives
    the same result at a fifth of the cost.

    Parameters
    ----------
    length, height, width : float
        Extents of the fill along x, z and y [m], whole cells.
    slot : float
        Width of the opening, which begins at the left wall [m], whole cells.
    {common}

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range; also if the slot leaves no bottom.
    """
    cell = positive("cell", cell)
    lengths = (("length", length), ("width", width), ("height", height))
    n_x, n_y, n_z = (whole_cells(name, value, cell) for name, value in lengths)
    n_slot = whole_cells("slot", slot, cell)
    if n_slot >= n_x:
        raise ValueError(f"slot = {slot} must be less than length = {length}")
    x, y = n_x * cell, n_y * cell
    edge, across = n_slot * cell, (0.0, y)
    filled = block(
        cell,
        (n_x, n_y, n_z + HEADROOM),
        (x, y, n_z * cell),
        open_sides={"z-"},
        points_per_cell=points_per_cell,
        jitter=jitter,
        lithostatic=True,
    )
    return Scene(
        name="silo_3d",
        **filled,
        material=material,
        scheme=scheme,
        walls=(
            Wall(2, 0.0, kind="no_slip", span=((edge, x), across)),
            # Open from the start, so that all that is done near outlets is done near it.
            Wall(2, 0.0, kind="no_slip", span=((0.0, edge), across), opens_at=0.0),
            *smooth_sides(filled["grid"]),
        ),
        gravity=gravity_down(3, gravity),
        duration=duration,
        seed=seed,
    )
