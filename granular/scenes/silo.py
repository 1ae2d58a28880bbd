"""Discharge of a flat-bottomed silo, in 2D."""

from __future__ import annotations

from typing import Any

from granular.checks import non_negative, one_of, positive
from granular.materials import Material, glass_beads
from granular.mpm import schemes
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import HEADROOM, block, gravity_down, smooth_sides, whole_cells
from granular.scenes._registry import scene_function


@scene_function("mpm")
def silo(
    *,
    orifice: float = 0.1,
    width: float = 1.0,
    height: float = 1.0,
    cell: float = 0.01,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    edge: str = "last_free_node",
    opens_at: float = 0.1,
    gravity: float = 9.8,
    ramp: float = 0.1,
    duration: float = 40.0,
    material: Material = glass_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Scene:
    """Right half of a silo that empties (Dunatunga & Kamrin 2015, section 4.2).

    From the paper: 1 m wide, filled 1 m high, half of it modelled, no_slip bottom, free_slip
    sides, cells of 0.01 m with 4 points, the orifice opened at 0.1 s when gravity is full, 40 s.
    Its orifice D extends from the first to the last vertically free node of the bottom. In the
    whole silo these nodes lie from -D/2 to D/2. Hence the nodes with x <= D/2 are free here and
    the bottom begins one cell further, at D/2 + cell: the default `edge`. The exponent fitted to
    Beverloo's law depends on this definition. Splines have a C0 line where the bottom begins and
    their last free node half a cell before it: by that definition their opening is D + cell.

    Chosen here: points leave for good as they cross the bottom, y = 0.

    Parameters
    ----------
    orifice : float
        Full width D of the opening [m], an even number of cells.
    width, height : float
        Full width of the silo and height of the fill [m], whole cells (the half-width too).
    edge : {"last_free_node", "wall"}
        Beginning of the bottom: at D/2 + cell, as in the paper, or at D/2.
    opens_at : float
        Time at which the orifice opens [s].
    {common}

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range; also if the orifice leaves no bottom.
    """
    cell = positive("cell", cell)
    n_x = whole_cells("width/2", positive("width", width) / 2, cell)
    n_y = whole_cells("height", height, cell)
    free = whole_cells("orifice/2", positive("orifice", orifice) / 2, cell)
    opens_at = non_negative("opens_at", opens_at)
    begin = free + (one_of("edge", edge, ("last_free_node", "wall")) == "last_free_node")
    if begin >= n_x:
        raise ValueError(
            f"orifice = {orifice} must be less than width = {width} by more than two cells"
            f" of {cell}"
        )
    filled = block(
        cell,
        (n_x, n_y + HEADROOM),
        (n_x * cell, n_y * cell),
        open_sides={"y-"},
        points_per_cell=points_per_cell,
        jitter=jitter,
    )
    return Scene(
        name="silo",
        **filled,
        material=material,
        scheme=scheme,
        walls=(
            Wall(1, 0.0, kind="no_slip", span=((begin * cell, n_x * cell),)),
            # The lid has the width of the outlet, so that all that is done near outlets is done
            # near it.
            Wall(1, 0.0, kind="no_slip", span=((0.0, begin * cell),), opens_at=opens_at),
            *smooth_sides(filled["grid"]),
        ),
        gravity=gravity_down(2, gravity, ramp),
        duration=duration,
        seed=seed,
        parameters={"half": True},
    )
