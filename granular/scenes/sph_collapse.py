"""Collapse of a granular column on a level floor and in an inclined channel, with SPH."""

from __future__ import annotations

import math
from typing import Any

from granular.scenes._build import (
    SETTLE,
    Parts,
    block,
    cells_across,
    down_slope,
    enough_cells,
    settling_gravity,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.sph.material import Viscoplastic, grit
from granular.sph.numerics import Numerics
from granular.sph.walls import ParticleWall
from granular.tools.checks import positive

ABOVE_COLUMN = 10


@scene_function("sph")
def column_collapse_sph(
    *,
    aspect: float = 2.0,
    length: float = 0.09,
    width: float = 0.0,
    spacing: float = 0.01,
    reach: float | None = None,
    settle: float = SETTLE,
    gravity: float = 9.81,
    duration: float | None = None,
    material: Viscoplastic = grit,
    numerics: Numerics | None = None,
    **material_numbers: Any,
) -> Parts:
    """Column between a wall and a gate that is removed at once (Hurley, section 5.4.3).

    From the thesis: columns of grit, 9 cm long with particles 1 cm apart, or of fine glass, 2.5 cm
    long with particles 0.5 cm apart (`granular.sph.grit`, `granular.sph.glass`); periodic across,
    with a period of 10 cm; the particles settle, then the right wall is deleted at once. H is the
    highest and L the farthest particle at rest. For the studies of stiffness, friction and
    resolution the length is 20 cm and the height 13 cm.

    Left open by the thesis: the heights of the columns, how the particles settle (here for 0.5 s),
    when they are at rest (here the duration is 1.5 s plus eight times sqrt(height/gravity)), and
    the length of the floor (here long enough for a run-out (L - L0)/L0 of 4 aspect).

    Parameters
    ----------
    aspect : float
        Height divided by length; the height is rounded to whole spacings.
    length, width : float
        Length and width of the column [m], whole spacings; a width of 0 is for 2D.
    reach : float or None
        Length of the floor [m], rounded up to whole spacings.
    settle : float
        Time with the right wall [s].
    gravity : float
        Its magnitude [m/s2].
    duration : float or None
        Time without the right wall [s]; None for that given above.
    {common}.
    """
    aspect, g = positive("aspect", aspect), positive("gravity", gravity)
    spacing = positive("spacing", spacing)
    n = whole_cells("length", length, spacing)
    n_z = max(round(positive("aspect * length/spacing", aspect * n)), 1)
    height = n_z * spacing
    if reach is None:
        reach = (1.0 + 4.0 * aspect) * length + 10 * spacing
    if positive("reach", reach) < length:
        raise ValueError(f"reach = {reach} must not be less than length = {length}")
    n_x = enough_cells(reach, spacing)
    if duration is None:
        duration = 1.5 + 8.0 * (height / g) ** 0.5
    n_y, settle = cells_across("width", width, spacing), positive("settle", settle)
    still, sides = (0.0,) * len(n_y), tuple((0.0, k * spacing) for k in n_y)
    up = (0.0, (n_z + ABOVE_COLUMN) * spacing)
    return Parts(
        **block(
            spacing,
            (n_x, *n_y, n_z + ABOVE_COLUMN),
            (length, *(k * spacing for k in n_y), height),
            periodic=range(1, 1 + len(n_y)),
        ),
        walls=(
            ParticleWall(1 + len(n_y), 0.0, 1),
            ParticleWall(0, 0.0, 1),
            ParticleWall(0, n * spacing, -1, span=(*sides, up), until=settle),
        ),
        gravity=settling_gravity((0.0, *still, -g), settle),
        duration=settle + positive("duration", duration),
        parameters={
            "half_width": n * spacing,
            "half": True,
            "reach": n_x * spacing,
            "duration": duration,
        },
    )


ABOVE_CHANNEL = 8

channel_sand = Viscoplastic(mu_l=0.435, mu_h=0.435)
"""Material of the inclined collapses of the thesis, without dilation."""


@scene_function("sph")
def inclined_collapse(
    *,
    angle_deg: float = 16.0,
    side_walls: bool = True,
    length: float = 0.2,
    height: float = 0.14,
    width: float = 0.1,
    spacing: float = 0.01,
    lift: float = 2.0,
    reach: float = 1.2,
    settle: float = SETTLE,
    gravity: float = 9.81,
    duration: float = 1.5,
    material: Viscoplastic = channel_sand,
    numerics: Numerics | None = None,
    **material_numbers: Any,
) -> Parts:
    """Block behind a gate that lifts, in a channel with x down the slope (Hurley, section 5.4.4).

    From the thesis: 20 x 14 cm, 10 cm across, periodic or between side walls of the same friction
    as the floor; particles 1 cm apart, rho0 1550 kg/m3, constant friction 0.435 in the material and
    at all walls; the particles settle, then the gate lifts at 2 m/s; slopes of 0, 10, 16, 22 deg.
    With dilation its largest beta is 0.5 (``dilation=0.5``); the default is without.

    Left open by the thesis: the direction of gravity while the particles settle (here tilted from
    the start), the time to settle (here 0.5 s), the times of its profiles (here 1.5 s in all), and
    the end of the floor (here 1.2 m from the upper wall; particles that get there are dropped).
    Walls are as thick as the reach of the kernel, while the thesis has five layers: side walls
    would otherwise need very many particles.

    Parameters
    ----------
    angle_deg : float
        Inclination [deg], 0 <= angle < 90.
    side_walls : bool
        If true, there are walls at the sides; otherwise the channel is periodic across.
    length, height, width : float
        Extents of the block [m], whole spacings; a width of 0 is for 2D, without side walls.
    lift : float
        Speed of the gate [m/s].
    reach : float
        Length of the floor [m], rounded up to whole spacings.
    settle : float
        Time before the gate lifts [s].
    gravity : float
        Its magnitude [m/s2].
    duration : float
        Time from the lifting of the gate on [s].
    {common}.
    """
    spacing = positive("spacing", spacing)
    n, n_z = whole_cells("length", length, spacing), whole_cells("height", height, spacing)
    n_x, n_y = (
        enough_cells(positive("reach", reach), spacing),
        cells_across("width", width, spacing),
    )
    if n_x <= n:
        raise ValueError(f"reach = {reach} must exceed length = {length}")
    if side_walls and not n_y:
        raise ValueError("side_walls = True must have a width > 0")
    settle, lift = positive("settle", settle), positive("lift", lift)
    still, sides = (0.0,) * len(n_y), tuple((0.0, k * spacing) for k in n_y)
    top = (n_z + ABOVE_CHANNEL) * spacing
    numerics = numerics or Numerics()
    thin, ends = math.ceil(2.0 * numerics.smoothing), ((0.0, n_x * spacing), (0.0, top))
    # By this time the gate is out of reach of the kernels of all particles.
    clear = settle + (n_z + 2.0 * numerics.smoothing) * spacing / lift
    gate = ParticleWall(
        0,
        n * spacing,
        -1,
        span=(*sides, (0.0, top)),
        velocity=(0.0, *still, lift),
        moves_from=settle,
        until=clear,
        layers=thin,
    )
    channel: tuple[ParticleWall, ...] = ()
    if side_walls:
        channel = tuple(
            ParticleWall(1, at, side, span=ends, layers=thin)
            for at, side in ((0.0, 1), (sides[0][1], -1))
        )
    return Parts(
        name="inclined_collapse_sph",
        **block(
            spacing,
            (n_x, *n_y, n_z + ABOVE_CHANNEL),
            tuple(k * spacing for k in (n, *n_y, n_z)),
            periodic=() if side_walls else range(1, 1 + len(n_y)),
        ),
        numerics=numerics,
        walls=(
            *(ParticleWall(axis, 0.0, 1, layers=thin) for axis in (1 + len(n_y), 0)),
            *channel,
            gate,
        ),
        gravity=settling_gravity(down_slope(2 + len(n_y), gravity, angle_deg), settle),
        duration=settle + positive("duration", duration),
        parameters={"half_width": n * spacing, "reach": n_x * spacing, "duration": duration},
    )
