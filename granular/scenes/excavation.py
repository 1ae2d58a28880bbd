"""A flat blade that dives into a bed, goes forward and comes out again."""

from __future__ import annotations

import math

from granular.checks import in_range, non_negative, positive
from granular.materials import Material, grc_1
from granular.mpm.bodies import Body, Box
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.scenes._build import scene_parameters, sided
from granular.scenes._tools import bed, legs, thickness_of

soft_grc_1 = grc_1.replace(E=0.15e6)


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
) -> Scene:
    """Excavation by a blade (Haeri & Skonieczny 2021, section 4.2, figures 11 to 15).

    From the paper: GRC-1 with E = 15 MPa, or a hundredth for speed, at the cost of 16 % of the
    force; 2 and 5 cm deep; friction of tan 30 deg on the blade; 20 s. From the scripts behind it:
    a bed of 1.6 x 0.70 x 0.15 m, a blade 0.305 m wide, 0.457 m high and 6 mm thick, 0.025 m/s per
    axis on the way down and up, 0.04 m/s forward, 3.8 deg from the vertical (another has 30.8),
    and a run at a quarter of the size, whose cells of 3.3 mm are 13.3 mm here
    (`granular.mpm.scaling` does the same, openly).

    Chosen here: the softer material; half of the bed, with a symmetry plane at y = 0; cells of
    12.5 mm, which divide the bed; a rough floor and smooth sides; the top of the blade leans
    backwards; it begins at `start` with its edge at the surface and travels so far that the
    paper's 20 s are used. The density is tracked: then a blade thinner than two
    cells has two sides. With others it is made two cells thick, backwards from its front, and held
    by the nodes within it: it lets soil through and feels half the force (the docs, page "Three
    dimensions").

    The surface of the bed is z = 0. Forces: `granular.measure.tool_force`, which doubles those of
    half a bed.

    Parameters
    ----------
    depth : float
        Of the edge while it goes forward [m].
    travel, speed : float
        Way forward at depth [m] and its speed [m/s].
    dive_speed : float
        Forward and downward, and upward at the end [m/s].
    rake_deg : float
        From the vertical, -60 to 60; positive if the top leans backwards.
    blade : tuple of 3 floats
        Thickness, width, height [m]; with the width of the bed it goes from wall to wall.
    friction : float
        Coefficient between blade and soil.
    length, width, soil, headroom : float
        Of the bed along x and y, its depth, and the room above [m], whole cells (`width/2` too if
        `half`).
    start : float
        Where the edge begins [m].
    half : bool
        Whether only y >= 0 is modelled.
    settle, ramp : float
        Time before the blade moves, and in which it changes its velocity [s].
    cell : float
        Cell [m].
    points_per_cell, jitter
        See `granular.geometry.Fill`.
    gravity : float
        m/s2, from the start.
    duration : float or None
        Seconds; None for the whole motion.
    material, scheme, seed
        See `Scene`.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range; also if the blade would leave the bed.
    """
    called = scene_parameters(locals())
    cell, depth, speed = positive("cell", cell), positive("depth", depth), positive("speed", speed)
    travel, dive = positive("travel", travel), positive("dive_speed", dive_speed)
    rake = in_range("rake_deg", rake_deg, -60.0, 60.0)
    if not isinstance(half, bool):
        raise TypeError(f"half = {half!r} must be True or False")
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
    # its front edge is the position of the body
    # nodes on its face would not be held: between walls it goes through them
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
        parameters=called,
    )
