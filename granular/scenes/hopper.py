"""Hoppers with inclined walls below a bin, plane in 2D and conical in 3D."""

from __future__ import annotations

import math
from typing import Any

from granular.materials import Material, glass_beads
from granular.mpm import schemes
from granular.mpm.bodies import Body
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import (
    HEADROOM,
    MARGIN,
    Parts,
    block,
    dimension,
    enough_cells,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.shapes import Revolve
from granular.tools.checks import in_range, non_negative, positive

DROP = 4
"""Cells below the opening, through which the material falls before it leaves."""

ROUND = 16
"""Points per cell of a conical hopper in a plane: with 4 it flows 6 to 12 % faster, as the edge of
its wall holds them less well (docs/explanation/axisymmetry.md)."""

softer_beads = glass_beads.replace(E=glass_beads.E / 100)


@scene_function("mpm")
def hopper(
    *,
    dim: int | None = None,
    axisymmetric: bool = False,
    angle_deg: float = 30.0,
    orifice: float = 0.1,
    width: float = 0.5,
    fill_height: float = 0.6,
    friction: float = 0.2,
    cell: float = 0.01,
    points_per_cell: int | None = None,
    jitter: float = 0.0,
    opens_at: float = 0.1,
    gravity: float = 9.8,
    ramp: float = 0.0,
    duration: float = 4.0,
    material: Material = softer_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Hopper that empties through its opening, below a bin with upright walls.

    A plane hopper (2D) is modelled by its right half, a conical one (3D) by a quarter, between
    free-slip symmetry planes; with `axisymmetric` a conical one is a plane of radius and height.
    Its walls are two bodies: ``bodies[0]`` is the inclined wall and ``bodies[1]`` that of the bin,
    so that `measure.body_force` returns the forces on them. The opening is at elevation 0, closed
    by a free-slip lid until `opens_at`. Below it the material falls freely, as the underside of the
    hopper recedes, and leaves the domain. Without a `ramp` the fill begins at the pressure of its
    depth, in equilibrium without any friction of the walls. With a `ramp` it is stress-free at
    first; as gravity grows it settles along the walls, whose friction then bears a part of the
    weight (`theory.janssen_pressure`).

    Jenike (1964, "Storage and flow of solids", Bulletin 123 of the Utah Engineering Experiment
    Station) states which hoppers empty in mass flow, where all the material moves
    (`theory.mass_flow_limit`); `measure.hopper_flow` returns the mode of a run.

    Chosen here: E is a hundredth of that of `glass_beads`, so that the time steps are ten times
    longer. Where the fill is 0.6 m high, p/E is below 0.001.

    Parameters
    ----------
    dim : {2, 3}
        2 for a plane hopper, the default; 3 for a conical one.
    axisymmetric : bool
        Whether to simulate a conical hopper in a plane of radius and height.
    angle_deg : float
        Half angle, between the wall and the vertical [deg], from 5 to 85.
    orifice : float
        Full width of the opening, or its diameter [m], at least 4 cells.
    width : float
        Full width of the bin, or its diameter [m]; greater than `orifice`.
    fill_height : float
        Height of the fill above the opening [m], whole cells.
    friction : float
        Coefficient of Coulomb friction of the walls.
    opens_at : float
        Time at which the lid opens [s].
    points_per_cell, jitter
        See `granular.Fill`. By default 2 points along an edge of a cell, and 16 per cell with
        `axisymmetric`.
    gravity, ramp : float
        Magnitude [m/s2], and the time in which it is reached from zero [s]; 0 for a fill that is
        under its own weight from the start.
    {common}.
    """
    dim, cell = dimension(dim, axisymmetric, 2), positive("cell", cell)
    angle = math.radians(in_range("angle_deg", angle_deg, 5.0, 85.0))
    inner, outer = positive("orifice", orifice) / 2, positive("width", width) / 2
    if inner < 2 * cell:
        raise ValueError(f"orifice = {orifice} must be >= 4 cells of {cell}")
    if outer <= inner:
        raise ValueError(f"width = {width} must exceed orifice = {orifice}")
    n_z = whole_cells("fill_height", fill_height, cell) + DROP
    n_x = enough_cells(outer, cell) + MARGIN
    across, lower = dim - 1, (*(0.0,) * (dim - 1), -DROP * cell)
    usual = ROUND if axisymmetric else 2**dim
    filled = block(
        cell,
        (*(n_x,) * across, n_z + HEADROOM),
        (*(n_x * cell,) * across, (n_z - DROP) * cell),
        lower=lower,
        base=(0.0,) * dim,
        open_sides={"xyz"[across] + "-"},
        points_per_cell=usual if points_per_cell is None else points_per_cell,
        jitter=jitter,
        axisymmetric=axisymmetric,
        lithostatic=non_negative("ramp", ramp) == 0.0,
    )
    return Parts(
        **filled,
        walls=(
            *(Wall(axis, 0.0, kind="free_slip") for axis in range(0 if axisymmetric else across)),
            # As wide as the domain, because an end within it would be a line across the material.
            Wall(across, 0.0, kind="free_slip", opens_at=non_negative("opens_at", opens_at)),
        ),
        bodies=_walls(
            inner,
            outer,
            angle,
            top=(n_z - DROP + 2 * HEADROOM) * cell,
            drop=2 * DROP * cell,
            dim=dim,
            friction=non_negative("friction", friction),
        ),
        parameters={} if axisymmetric else {"half": True} if dim == 2 else {"quarter": True},
    )


def _walls(
    inner: float, outer: float, angle: float, *, top: float, drop: float, dim: int, friction: float
) -> tuple[Body, Body]:
    """The inclined wall and the wall of the bin.

    Both are thick, as the two sides of a thin body would be coupled. The inclined surface continues
    behind the surface of the bin, and the latter down behind the inclined one, so that neither has
    an edge where they meet. Below the opening the solid recedes at 45 degrees.
    """
    far = 2.0 * outer + drop
    rise = (far - inner) / math.tan(angle)
    inclined = ((inner, 0.0), (inner + drop, -drop), (far + drop, -drop), (far, rise))
    upright = ((outer, -drop), (far + drop, -drop), (far + drop, top), (outer, top))
    origin, axis = (0.0,) * dim, (*(0.0,) * (dim - 1), 1.0)
    cone, bin_ = (
        Body(Revolve(profile, center=origin, axis=axis), origin, friction=friction)
        for profile in (inclined, upright)
    )
    return cone, bin_
