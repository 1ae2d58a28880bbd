"""A flat blade that dives into a bed, moves forward and comes out again."""

from __future__ import annotations

import math
from typing import Any

from granular.checks import in_range, non_negative, positive, truth
from granular.materials import Material, grc_1
from granular.mpm.bodies import Body, Box
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.scenes._build import sided
from granular.scenes._registry import scene_function
from granular.scenes._tools import bed, legs, thickness_of

soft_grc_1 = grc_1.replace(E=0.15e6)


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
) -> Scene:
    """Excavation by a blade (Haeri & Skonieczny 2021, section 4.2, figures 11 to 15).

    From the paper: GRC-1 with E = 15 MPa, or a hundredth of it, which is faster and changes the
    force by 16 %; 2 and 5 cm deep; friction of tan 30 deg on the blade; 20 s. From the scripts of
    the paper: a bed of 1.6 x 0.70 x 0.15 m, a blade 0.305 m wide, 0.457 m high and 6 mm thick,
    0.025 m/s per axis on the way down and up, 0.04 m/s forward, 3.8 deg from the vertical (another
    script has 30.8), and a run at a quarter of the size, whose cells of 3.3 mm are 13.3 mm here
    (`granular.mpm.scaling` does the same explicitly).

    Chosen here: the softer material; half of the bed, with a symmetry plane at y = 0; cells of
    12.5 mm, which divide the bed; a no_slip floor and free_slip sides. The top of the blade leans
    backwards. The blade begins at `start` with its edge at the surface and travels as far as the
    paper's 20 s allow. The default scheme uses the particle density, with which a blade thinner
    than two cells separates the material on its two sides. With other densities the blade is made
    two cells thick, backwards from its front, and only the nodes within it move with it: soil then
    passes through it and the force is half as large (see the documentation, page "Three
    dimensions").

    The surface of the bed is z = 0. Forces: `granular.measure.soil_tools.tool_force`, which doubles
    those of half a bed.

    Parameters
    ----------
    depth : float
        Depth of the edge while the blade moves forward [m].
    travel, speed : float
        Distance travelled at that depth [m] and its speed [m/s].
    dive_speed : float
        Forward and downward speed at the begin, forward and upward speed at the end [m/s].
    rake_deg : float
        Angle to the vertical [deg], -60 to 60; positive if the top leans backwards.
    blade : tuple of 3 floats
        Thickness, width, height [m]; a blade as wide as the bed extends from wall to wall.
    friction : float
        Coefficient of friction between blade and soil.
    length, width, soil, headroom : float
        Length (x) and width (y) of the bed, its depth, and the height above it [m], whole cells
        (`width/2` too if `half`).
    start : float
        Initial position x of the edge [m].
    half : bool
        If true, only y >= 0 is modelled.
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
    shape = Box((thick, across, high), center=(-thick / 2, 0.0, high / 2))
    middle = 0.0 if half else width / 2
    return Scene(
        name="excavation",
        **bed(
            length=length,
            width=width / 2 if half else width,
            depth=soil,
            headroom=headroom,
            cell=cell,
            points_per_cell=points_per_cell,
            jitter=jitter,
            gravity=gravity,
        ),
        material=material,
        scheme=scheme,
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
        seed=seed,
    )
