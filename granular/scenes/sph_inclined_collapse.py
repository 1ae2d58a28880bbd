"""Collapse of a granular block down an inclined channel, with SPH."""

from __future__ import annotations

import math
from typing import Any

from granular.checks import positive
from granular.scenes._build import (
    SETTLE,
    block,
    cells_across,
    down_slope,
    enough_cells,
    settling_gravity,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.sph.material import Viscoplastic
from granular.sph.numerics import Numerics
from granular.sph.scene import Scene
from granular.sph.walls import Wall

HEADROOM = 8

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
) -> Scene:
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
    {common}
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
    top = (n_z + HEADROOM) * spacing
    numerics = numerics or Numerics()
    thin, ends = math.ceil(2.0 * numerics.smoothing), ((0.0, n_x * spacing), (0.0, top))
    # By this time the gate is out of reach of the kernels of all particles.
    clear = settle + (n_z + 2.0 * numerics.smoothing) * spacing / lift
    gate = Wall(
        0,
        n * spacing,
        -1,
        span=(*sides, (0.0, top)),
        velocity=(0.0, *still, lift),
        moves_from=settle,
        until=clear,
        layers=thin,
    )
    channel: tuple[Wall, ...] = ()
    if side_walls:
        channel = tuple(
            Wall(1, at, side, span=ends, layers=thin) for at, side in ((0.0, 1), (sides[0][1], -1))
        )
    return Scene(
        name="inclined_collapse_sph",
        **block(
            spacing,
            (n_x, *n_y, n_z + HEADROOM),
            tuple(k * spacing for k in (n, *n_y, n_z)),
            periodic=() if side_walls else range(1, 1 + len(n_y)),
        ),
        material=material,
        numerics=numerics,
        walls=(*(Wall(axis, 0.0, 1, layers=thin) for axis in (1 + len(n_y), 0)), *channel, gate),
        gravity=settling_gravity(down_slope(2 + len(n_y), gravity, angle_deg), settle),
        duration=settle + positive("duration", duration),
        parameters={"half_width": n * spacing, "reach": n_x * spacing, "duration": duration},
    )
