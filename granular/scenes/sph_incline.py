"""A layer on a periodic incline, with SPH."""

from __future__ import annotations

from typing import Any

from granular.model.gravity import Gravity
from granular.scenes._build import Parts, block, down_slope, level_cells, whole_cells
from granular.scenes._registry import scene_function
from granular.sph.material import Viscoplastic
from granular.sph.numerics import Numerics
from granular.sph.walls import ParticleWall
from granular.tools.checks import integer, non_negative, positive

SWITCH = 1e-6
"""Fraction of the settling time in which gravity turns. It turns practically at once, but the times
of the gravity table must ascend."""


sand = Viscoplastic()
"""Material of the inclined flows of the thesis (table 5.2), without dilation."""


@scene_function("sph")
def incline_sph(
    *,
    angle_deg: float = 18.0,
    height: float = 0.15,
    spacing: float = 0.01,
    columns: int = 10,
    columns_across: int = 0,
    headroom: int = 10,
    settle: float = 0.5,
    gravity: float = 9.81,
    duration: float = 3.0,
    material: Viscoplastic = sand,
    numerics: Numerics | None = None,
    **material_numbers: Any,
) -> Parts:
    """Layer on an incline, with x down the slope (Hurley, thesis, section 5.4.2).

    From the thesis: 0.1 x 0.15 x 0.05 m with particles 0.01 m apart, periodic along both horizontal
    axes, on five layers of fixed particles; mu_l 0.268, mu_h 0.577, D_star 20 1/s; the particles
    settle, then gravity is tilted at once. The thesis has 5 `columns_across`; the default is 2D.

    Chosen here: the particles settle for 0.5 s, in whose first fifth gravity grows, and the
    duration counts from the tilt. The friction depends on |D| and not on the pressure, so that the
    steady flow without dilation has the same shear rate everywhere,
    D_star (tan angle - mu_l)/(mu_h - tan angle).

    Parameters
    ----------
    angle_deg : float
        Inclination [deg], 0 <= angle < 90.
    height, spacing : float
        Height of the layer, in whole spacings, and spacing of the particles [m].
    columns, columns_across : int
        Number of particles along the slope and across it; 0 across is for 2D.
    headroom : int
        Free spacings above the layer, >= 1; particles that leave the domain are dropped.
    settle : float
        Time before the tilt [s], > 0.
    gravity : float
        Its magnitude [m/s2].
    duration : float
        Time after the tilt [s].
    {common}.
    """
    spacing, level = positive("spacing", spacing), level_cells(columns, columns_across)
    layers = whole_cells("height", height, spacing)
    settle, still = positive("settle", settle), (0.0,) * len(level)
    down = (*still, -positive("gravity", gravity))
    tilted = down_slope(len(level) + 1, gravity, angle_deg)
    return Parts(
        **block(
            spacing,
            (*level, layers + integer("headroom", headroom, 1)),
            tuple(n * spacing for n in (*level, layers)),
            periodic=range(len(level)),
        ),
        walls=(ParticleWall(len(level), 0.0, 1),),
        gravity=Gravity(
            (0.0, 0.2 * settle, settle, settle * (1.0 + SWITCH)),
            ((*still, 0.0), down, down, tilted),
        ),
        duration=settle + non_negative("duration", duration),
        parameters={"duration": duration},
    )
