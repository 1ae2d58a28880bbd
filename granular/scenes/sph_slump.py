"""Slump of a granular material in a box through an orifice in its corner, with SPH."""

from __future__ import annotations

import math
from typing import Any

from granular.scenes._build import SETTLE, Parts, block, cells_across, settling_gravity, whole_cells
from granular.scenes._registry import scene_function
from granular.sph.material import Viscoplastic
from granular.sph.numerics import Numerics
from granular.sph.walls import ParticleWall
from granular.tools.checks import in_range, positive

LAYERS = 5

sand = Viscoplastic()
"""Material of the thesis; the friction follows from the angle."""


@scene_function("sph")
def slump_sph(
    *,
    phi_deg: float = 30.0,
    dilation: float = 0.0,
    length: float = 0.6,
    height: float = 0.5,
    width: float = 0.0,
    orifice: float = 0.05,
    spacing: float = 0.01,
    settle: float = SETTLE,
    gravity: float = 9.81,
    duration: float = 6.0,
    kappa: float = 1e5,
    material: Viscoplastic = sand,
    numerics: Numerics | None = None,
    **material_numbers: Any,
) -> Parts:
    """Slope that remains after the material has left through an orifice (Hurley, section 5.4.1).

    From the thesis: 60 x 50 cm, periodic across with a period of 6 cm, an orifice of 5 cm at the
    right end of the floor, particles 1 cm apart, rho0 1550 kg/m3, constant friction tan(phi) in the
    material and at the walls, phi 20 to 40 deg, kappa 1e5 Pa. The angle is that of a line through
    the surface over the middle 75 % between the left wall and the orifice.

    Left open by the thesis: how the particles settle (here for 0.5 s over a closed orifice, whose
    floor is then removed), the time for the slope to form (the thesis calls it at rest below
    1e-5 J/m3, which is not reached as long as particles roll on it; here 6 s), and what lies below
    the floor (here nothing: particles are dropped).

    Parameters
    ----------
    phi_deg : float
        Angle of friction [deg], 0 < phi < 90.
    dilation : float
        Largest beta, 0 without dilation; the thesis takes 0.5.
    length, height, width : float
        Extents of the material [m], whole spacings; a width of 0 is for 2D.
    orifice : float
        Length of the opening at the right end of the floor [m], whole spacings, less than `length`.
    settle : float
        Time with a closed orifice [s].
    gravity : float
        Its magnitude [m/s2].
    duration : float
        Time with an open orifice [s].
    kappa : float
        Stiffness [Pa].
    material : Viscoplastic
        Its `mu_l`, `mu_h`, `kappa` and `dilation` are replaced by the values above.
    {common}.
    """
    phi = in_range("phi_deg", phi_deg, 0.0, 90.0, open_low=True, open_high=True)
    spacing, g = positive("spacing", spacing), positive("gravity", gravity)
    n_x, n_z = whole_cells("length", length, spacing), whole_cells("height", height, spacing)
    n_hole = whole_cells("orifice", orifice, spacing)
    if n_hole >= n_x:
        raise ValueError(f"orifice = {orifice} must be less than length = {length}")
    n_y, settle = cells_across("width", width, spacing), positive("settle", settle)
    still, sides = (0.0,) * len(n_y), tuple((0.0, k * spacing) for k in n_y)
    x, hole = n_x * spacing, (n_x - n_hole) * spacing
    below = -LAYERS * spacing
    up = (below, (n_z + LAYERS) * spacing)
    mu = math.tan(math.radians(phi))
    if not isinstance(material, Viscoplastic):
        raise TypeError(f"material = {material!r} must be a Viscoplastic")
    material = material.replace(mu_l=mu, mu_h=mu, kappa=kappa, dilation=dilation)
    return Parts(
        **block(
            spacing,
            (n_x, *n_y, n_z + 2 * LAYERS),
            tuple(k * spacing for k in (n_x, *n_y, n_z)),
            lower=(0.0, *still, below),
            base=(0.0, *still, 0.0),
            periodic=range(1, 1 + len(n_y)),
        ),
        material=material,
        walls=(
            ParticleWall(0, 0.0, 1, span=(*sides, up)),
            ParticleWall(0, x, -1, span=(*sides, up)),
            ParticleWall(1 + len(n_y), 0.0, 1, span=((0.0, hole), *sides)),
            ParticleWall(1 + len(n_y), 0.0, 1, span=((hole, x), *sides), until=settle),
        ),
        gravity=settling_gravity((0.0, *still, -g), settle),
        duration=settle + positive("duration", duration),
        parameters={"duration": duration},
    )
