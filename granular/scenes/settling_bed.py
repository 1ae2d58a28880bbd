"""A bed of grains that falls on a floor and comes to rest, in 2D."""

from __future__ import annotations

import math
from typing import Any

from granular.materials import Material
from granular.model.fill import Fill
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import HEADROOM, Parts, soft_beads, whole_cells
from granular.scenes._registry import scene_function
from granular.shapes import Box
from granular.theory import bar_restitution, wave_decay
from granular.tools.checks import integer, non_negative, positive

QUIET = 1e-3
"""Fraction of its initial amplitude to which the slowest oscillation has decayed at the end."""

damped_beads = soft_beads.replace(restitution=0.1, contact_diameter=0.02)
"""Beads with the elastic damping of contacts as large as a cell of the scene."""


@scene_function("mpm")
def settling_bed(
    *,
    height: float = 0.2,
    drop: float = 0.0,
    columns: int = 4,
    cell: float = 0.02,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    gravity: float = 9.8,
    duration: float | None = None,
    material: Material = damped_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Bed that falls on a rough floor and comes to rest by elastic damping.

    All numbers are chosen here. The bed is stress-free at first, and its full weight acts at once.
    Its slowest oscillation has the wave number ``k = pi/(2 height)``; with the wave speed c of the
    material its surface begins with the velocity ``8 gravity height/(pi^2 c)``, and it decays at
    the rate of `granular.theory.wave_decay`. At the end it has decayed to a thousandth. With a
    `drop` the bed bounces before; the duration includes these bounces, with the restitution of a
    bar of this height, `granular.theory.bar_restitution`; bounces of grains are lower.

    The contacts of the default material are as large as a cell, larger than grains. This is a
    choice of the method, so that the bed comes to rest soon. With the diameter of grains and a real
    stiffness a bed rings for a long time.

    Parameters
    ----------
    height : float
        Height of the bed [m], whole cells.
    drop : float
        Height of fall of the bed before the start [m], >= 0: it begins on the floor with the
        velocity ``sqrt(2 gravity drop)``.
    columns : int
        Number of cells along the bed, which is periodic.
    gravity : float
        Its magnitude [m/s2], constant from the start.
    duration : float or None
        Duration [s]; None for the time to rest.
    {common}. If `duration` is None and `restitution` of the material is 1: such a bed does not come
    to rest.
    """
    cell, g = positive("cell", cell), positive("gravity", gravity)
    rows, columns = whole_cells("height", height, cell), integer("columns", columns, 1)
    fall = math.sqrt(2.0 * g * non_negative("drop", drop))
    if duration is None:
        duration = _time_to_rest(material, height, fall, g)
    rise = math.ceil(fall**2 / (2.0 * g) / cell)
    return Parts(
        grid=Grid((0.0, 0.0), cell, (columns, rows + HEADROOM + rise), periodic=(True, False)),
        fills=(
            Fill(
                Box((0.0, 0.0), (columns * cell, rows * cell)),
                points_per_cell,
                velocity=(0.0, -fall),
                jitter=jitter,
            ),
        ),
        walls=(Wall(1, 0.0),),
        duration=duration,
        parameters={"duration": duration},
    )


def _time_to_rest(material: Material, height: float, fall: float, g: float) -> float:
    """Time of the bounces after a fall, and of the decay of the slowest oscillation [s]."""
    if not isinstance(material, Material):
        raise TypeError(f"material = {material!r} must be a Material")
    if not material.damping_time:
        raise ValueError(
            "duration = None must be a time with restitution = 1: the bed does not come to rest"
        )
    waves = {"wave_speed": material.wave_speed, "damping_time": material.damping_time}
    rebound = bar_restitution(length=height, **waves) if fall else 0.0
    rate = wave_decay(wavenumber=math.pi / (2.0 * height), **waves)
    return 2.0 * fall * rebound / (g * (1.0 - rebound)) + math.log(1.0 / QUIET) / rate
