"""Digging in a bed: a blade that dives into it and moves forward, and an excavator's bucket."""

from __future__ import annotations

import math
from typing import Any

from granular.materials import Material, grc_1
from granular.mpm.bodies import Body
from granular.mpm.schemes import Scheme
from granular.scenes._build import PROMPT, Parts, gravity_down, reconnected, sided
from granular.scenes._registry import scene_function
from granular.scenes._tools import bed, legs, thickness_of
from granular.shapes import Box, Union
from granular.tools.checks import finite, in_range, non_negative, positive, truth, vector

soft_grc_1 = grc_1.replace(E=0.15e6, t0=PROMPT)


@scene_function("mpm")
def excavation(
    *,
    depth: float = 0.05,
    travel: float = 0.64,
    speed: float = 0.04,
    dive_speed: float = 0.025,
    rake_deg: float = 3.8,
    blade: tuple[float, float, float] = (0.006, 0.305, 0.457),
    friction: float = math.tan(math.radians(30.0)),
    length: float = 1.6,
    width: float = 0.7,
    soil: float = 0.15,
    headroom: float = 0.15,
    start: float = 0.3,
    half: bool = True,
    settle: float = 0.2,
    ramp: float = 0.1,
    cell: float = 0.0125,
    points_per_cell: int = 8,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float | None = None,
    material: Material = soft_grc_1,
    scheme: Scheme = sided,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Excavation by a blade (Haeri & Skonieczny 2021, section 4.2, figures 11 to 15).

    From the paper: GRC-1 with E = 15 MPa, or a hundredth of it, which is faster and changes the
    force by 16 %; 2 and 5 cm deep; friction of tan 30 deg on the blade; 20 s. From the scripts of
    the paper: a bed of 1.6 x 0.70 x 0.15 m, a blade 0.305 m wide, 0.457 m high and 6 mm thick,
    0.025 m/s per axis on the way down and up, 0.04 m/s forward, 3.8 deg from the vertical (another
    script has 30.8), and a run at a quarter of the size, whose cells of 3.3 mm are 13.3 mm here
    (`granular.mpm.scaling` does the same explicitly).

    Chosen here: the softer material, whose fluidity responds within 1e-6 s, because the time step
    is longer than the 1e-4 s of the paper; half of the bed, with a symmetry plane at y = 0; cells
    of 12.5 mm, which divide the bed; a no_slip floor and free_slip sides. The top of the blade
    leans backwards. The blade begins at `start` with its edge at the surface and travels as far as
    the paper's 20 s allow. The default scheme uses the particle density, with which a blade thinner
    than two cells separates the material on its two sides. With other densities the blade is made
    two cells thick, backwards from its front.

    The surface of the bed is z = 0. Forces: `granular.measure.soil_tools.tool_force`, by default
    those on the whole blade.

    Parameters
    ----------
    depth : float
        Depth of the edge while the blade moves forward [m].
    travel, speed : float
        Distance travelled at that depth [m] and its speed [m/s].
    dive_speed : float
        Forward and downward speed at the beginning, forward and upward speed at the end [m/s].
    rake_deg : float
        Angle to the vertical [deg], -60 to 60; positive if the top leans backwards.
    blade : tuple of 3 floats
        Thickness, width, height [m]; a blade as wide as the bed extends from wall to wall.
    friction : float
        Coefficient of friction between blade and soil.
    settle, ramp : float
        Time before the blade moves, and time in which it changes its velocity [s].
    duration : float or None
        Duration [s]; None for the whole motion.
    {common}; also if the blade would leave the bed.
    """
    cell, depth, speed = positive("cell", cell), positive("depth", depth), positive("speed", speed)
    travel, dive = positive("travel", travel), positive("dive_speed", dive_speed)
    rake = in_range("rake_deg", rake_deg, -60.0, 60.0)
    half = truth("half", half)
    if depth >= positive("soil", soil):
        raise ValueError(f"depth = {depth} must be less than soil = {soil}")
    thick, wide, high = blade
    thick = thickness_of("blade[0]", thick, cell, scheme)
    if not 0 < positive("blade[1]", wide) <= positive("width", width):
        raise ValueError(f"blade[1] = {wide} must be <= width = {width}")
    end = positive("start", start) + travel + 2 * depth
    if end >= positive("length", length):
        raise ValueError(
            f"start + travel + 2 depth = {end:.6g} must be less than length = {length}"
        )
    down = depth / dive
    motion = legs(
        (
            (non_negative("settle", settle), (0.0, 0.0, 0.0), 0.0),
            (down, (dive, 0.0, -dive), 0.0),
            (travel / speed, (speed, 0.0, 0.0), 0.0),
            (down, (dive, 0.0, dive), 0.0),
            (settle, (0.0, 0.0, 0.0), 0.0),
        ),
        positive("ramp", ramp),
    )
    # The position of the body is its front edge. A blade from wall to wall extends through the
    # walls, because nodes that lie on its faces would not move with it.
    across = wide + 4 * cell if wide == width else wide
    shape = Box(size=(thick, across, high), center=(-thick / 2, 0.0, high / 2))
    middle = 0.0 if half else width / 2
    level = (("length", length), ("width", width / 2 if half else width))
    return Parts(
        **bed(level, soil, headroom, cell, points_per_cell=points_per_cell, jitter=jitter),
        gravity=gravity_down(3, gravity),
        bodies=(
            Body(
                shape,
                (start, middle, 0.0),
                rotation_deg=(0.0, -rake, 0.0),
                motion=motion,
                friction=friction,
            ),
        ),
        duration=settle * 2 + 2 * down + travel / speed if duration is None else duration,
        parameters={"symmetry": "y"} if half else {},
    )


excavated = grc_1.replace(E=0.15e6, t0=PROMPT, nu=0.25, rho_c=0.6 * grc_1.rho_s)


@scene_function("mpm")
def excavator(
    *,
    bucket: tuple[float, float, float] = (0.31, 0.28, 0.41),
    thickness: float = 0.01,
    depth: float = 0.13,
    speed: float = 0.04,
    tilt_deg: tuple[float, float] = (30.0, -60.0),
    friction: float = 0.1,
    length: float = 1.0,
    width: float = 0.4,
    soil: float = 0.2,
    headroom: float = 0.5,
    start: float = 0.35,
    half: bool = True,
    settle: float = 0.1,
    ramp: float = 0.05,
    cell: float = 0.0125,
    points_per_cell: int = 8,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 6.75,
    material: Material = excavated,
    scheme: Scheme = reconnected,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Industrial excavator (Haeri & Skonieczny 2021, section 4.3, figure 1), a demonstration.

    From the paper: soil in a bucket (solid), soil that slides back into the bin (liquid), soil
    that leaks and falls (gas). From the scripts of the paper: a bin of 1.0 x 0.4 x 0.2 m, a bucket
    within 0.31 x 0.41 x 0.28 m, S = 0.06 and B = 0.1 MPa, 60 % full, friction of 0.1, 0.04 m/s in
    and out at 45 deg, a tilt that goes from 30 to -60 deg linearly, 6.75 s.

    Not in the paper, chosen here: the orientation of the bucket (0.31 m along x, 0.28 m wide, 0.41
    m high) and its parts (a back, a bottom and two sides, open to the front and above); a fluidity
    that responds within 1e-6 s; half of the bin, with a symmetry plane at y = 0; the depth; and the
    motion. The bucket moves in at 45 deg down to the depth and out at 45 deg, while it tilts back
    about its middle at a constant rate, so that its edge comes up again before its middle does.
    Sheets thinner than two cells are made two cells thick, unless the scheme separates the material
    on their two sides.

    Parameters
    ----------
    bucket : tuple of 3 floats
        Outer extents along x, y and z [m], without tilt.
    thickness : float
        Thickness of the sheets of the bucket [m].
    depth : float
        Distance by which the middle of the bucket goes down [m].
    speed : float
        Speed along each axis [m/s].
    tilt_deg : (begin, end)
        Angle of the bottom to the horizontal [deg]; positive if the edge points down.
    friction : float
        Coefficient of friction between bucket and soil.
    settle, ramp : float
        Time before the bucket moves, and time in which it changes its velocity [s].
    {common}; also if no time is left to come out again.
    """
    cell, speed, depth = positive("cell", cell), positive("speed", speed), positive("depth", depth)
    if depth >= positive("soil", soil):
        raise ValueError(f"depth = {depth} must be less than soil = {soil}")
    half = truth("half", half)
    begin_deg, end_deg = (finite(f"tilt_deg[{i}]", v) for i, v in enumerate(tilt_deg))
    settle, down = non_negative("settle", settle), depth / speed
    up = positive("duration", duration) - settle - down
    if up <= 0:
        raise ValueError(
            f"duration = {duration} must exceed settle + depth/speed = {settle + down}"
        )
    turn = -math.radians(begin_deg - end_deg) / (down + up)  # about y: lifts the edge
    motion = legs(
        (
            (settle, (0.0, 0.0, 0.0), 0.0),
            (down, (speed, 0.0, -speed), turn),
            (up, (speed, 0.0, speed), turn),
        ),
        positive("ramp", ramp),
    )
    size = vector("bucket", bucket, 3)
    sheet = thickness_of("thickness", thickness, cell, scheme)
    across = 0.0 if half else positive("width", width) / 2
    level = (("length", length), ("width", positive("width", width) / 2 if half else width))
    return Parts(
        **bed(level, soil, headroom, cell, points_per_cell=points_per_cell, jitter=jitter),
        gravity=gravity_down(3, gravity),
        bodies=(
            Body(
                _bucket(size, sheet),
                _middle(positive("start", start), across, size, begin_deg),
                rotation_deg=(0.0, begin_deg, 0.0),
                motion=motion,
                friction=friction,
            ),
        ),
        parameters={"symmetry": "y"} if half else {},
    )


def _middle(
    x: float, y: float, size: tuple[float, ...], tilt_deg: float
) -> tuple[float, float, float]:
    """Position of the middle of the bucket while its edge is at x, on the surface z = 0."""
    c, s = math.cos(math.radians(tilt_deg)), math.sin(math.radians(tilt_deg))
    return x - (c * size[0] - s * size[2]) / 2, y, (s * size[0] + c * size[2]) / 2


def _bucket(size: tuple[float, ...], sheet: float) -> Union:
    """Bottom, back and two sides about the middle; open to the front (larger x) and above."""
    x, y, z = (positive(f"bucket[{i}]", edge) for i, edge in enumerate(size))
    if not (x > 2 * sheet and y > 2 * sheet and z > 2 * sheet):
        raise ValueError(f"bucket = {size} must exceed two sheets of {sheet} m along each axis")
    side = Box(size=(x, sheet, z), center=(0.0, (y - sheet) / 2, 0.0))
    return Union(
        (
            Box(size=(x, y, sheet), center=(0.0, 0.0, (sheet - z) / 2)),
            Box(size=(sheet, y, z), center=((sheet - x) / 2, 0.0, 0.0)),
            side,
            Box(size=side.size, center=(0.0, -side.center[1], 0.0)),
        )
    )
