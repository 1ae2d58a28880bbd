"""Collapse of a granular column on a level floor, with SPH."""

from __future__ import annotations

from typing import Any

from granular.checks import positive
from granular.scenes._build import (
    SETTLE,
    block,
    cells_across,
    enough_cells,
    settling_gravity,
    whole_cells,
)
from granular.scenes._registry import scene_function
from granular.sph.material import Viscoplastic, grit
from granular.sph.numerics import Numerics
from granular.sph.scene import Scene
from granular.sph.walls import Wall

HEADROOM = 10


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
) -> Scene:
    """Column between a wall and a gate that vanishes (Hurley, section 5.4.3).

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
    {common}
    """
    aspect, g = positive("aspect", aspect), positive("gravity", gravity)
    spacing = positive("spacing", spacing)
    n = whole_cells("length", length, spacing)
    n_z = max(round(aspect * n), 1)
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
    up = (0.0, (n_z + HEADROOM) * spacing)
    return Scene(
        name="column_collapse_sph",
        **block(
            spacing,
            (n_x, *n_y, n_z + HEADROOM),
            (length, *(k * spacing for k in n_y), height),
            periodic=range(1, 1 + len(n_y)),
        ),
        material=material,
        numerics=numerics or Numerics(),
        walls=(
            Wall(1 + len(n_y), 0.0, 1),
            Wall(0, 0.0, 1),
            Wall(0, n * spacing, -1, span=(*sides, up), until=settle),
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
