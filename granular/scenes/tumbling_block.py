"""A block that tips over the edge of a step and falls on a bed, in 2D."""

from __future__ import annotations

from typing import Any

from granular.materials import Material
from granular.mpm import schemes
from granular.mpm.bodies import Body, mass_properties
from granular.mpm.schemes import Scheme
from granular.scenes._build import Parts, enough_cells, soft_beads
from granular.scenes._registry import scene_function
from granular.scenes._tools import bed_beyond
from granular.shapes import Box
from granular.tools.checks import in_range, non_negative, positive


@scene_function("mpm")
def tumbling_block(
    *,
    long: float = 0.16,
    thick: float = 0.08,
    density: float = 2000.0,
    overhang: float = 0.02,
    step: float = 0.12,
    friction: float = 0.5,
    restitution: float = 0.2,
    length: float = 0.5,
    soil: float = 0.08,
    cell: float = 0.01,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 1.0,
    material: Material = soft_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Block that lies on a rigid step with its middle beyond the edge, tips and falls on a bed.

    The scene is 2D, and all numbers are chosen here. The surface of the bed is at y = 0, the edge
    of the step at x = 0. The block moves and turns freely from rest. The floor is no_slip, the
    sides are free_slip, the upper end is open.

    Parameters
    ----------
    long, thick : float
        Edges of the block [m], along the step and upwards.
    density : float
        Density of the block [kg/m3].
    overhang : float
        Distance of the middle of the block from the edge of the step [m], below long/2.
    step : float
        Height of the step above the bed [m].
    friction : float
        Coefficient of friction of block and step, with each other and with the bed, >= 0.
    restitution : float
        Coefficient of restitution of impacts of the block on the step, 0 to 1.
    length, soil : float
        Length of the bed and its depth [m], whole cells.
    {common}; also if the block is longer than the bed.
    """
    cell, long, thick = positive("cell", cell), positive("long", long), positive("thick", thick)
    if long >= positive("length", length):
        raise ValueError(f"long = {long} must be less than length = {length}")
    overhang = in_range("overhang", overhang, 0.0, 0.5 * long, open_low=True, open_high=True)
    step, friction = positive("step", step), non_negative("friction", friction)
    behind = enough_cells(long, cell) + 2
    above = enough_cells(step + thick + 0.5 * long, cell) + 2
    filling = {"points_per_cell": points_per_cell, "jitter": jitter}
    parts = bed_beyond(length, soil, cell, behind=behind, above=above, **filling)
    lower = parts["grid"].lower
    stone = Box(size=(long, thick))
    whole = mass_properties(stone, positive("density", density))
    rock = Box(size=(2 * behind * cell, 2 * step - 2 * lower[1]))
    return Parts(
        **parts,
        bodies=(
            Body(rock, lower, friction=friction),
            Body(
                stone,
                (overhang, step + 0.5 * thick),
                friction=friction,
                free="xy",
                mass=whole.mass,
                inertia=whole.inertia,
                restitution=restitution,
            ),
        ),
    )
