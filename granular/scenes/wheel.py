"""A wheel that rolls and slips over a bed under a load."""

from __future__ import annotations

from typing import Any

from granular import shapes
from granular.materials import Material
from granular.mpm.bodies import Body
from granular.mpm.schemes import Scheme
from granular.scenes._build import Parts, gravity_down, in_soft_soil
from granular.scenes._registry import scene_function
from granular.scenes._tools import bed, legs
from granular.scenes.excavation import soft_grc_1
from granular.tools.checks import in_range, non_negative, positive

MOST_SKID = -10.0
"""Least slip: the wheel moves eleven times as fast as it rolls."""


@scene_function("mpm")
def wheel(
    *,
    slip: float = 0.2,
    load: float = 164.0,
    diameter: float = 0.3,
    tread: float = 0.125,
    grousers: int = 0,
    grouser_height: float = 0.0,
    grouser_thickness: float | None = None,
    omega: float = 0.13,
    friction: float = 0.4,
    length: float = 0.9,
    width: float = 0.1875,
    soil: float = 0.0875,
    headroom: float = 0.05,
    start: float = 0.25,
    settle: float = 1.0,
    ramp: float = 0.2,
    cell: float = 0.0125,
    points_per_cell: int = 8,
    jitter: float = 0.0,
    gravity: float = 9.81,
    duration: float = 20.0,
    material: Material = soft_grc_1,
    scheme: Scheme = in_soft_soil,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Single wheel in a soil bin (Haeri & Skonieczny 2021, section 4.3, figures 16 to 18).

    From the paper: GRC-1, a smooth wheel 30 cm across and 12.5 cm wide against a window, a bin of
    0.90 x 0.193 m, friction of 0.4, a load of 164 N, free to rise and sink, slips of 20, 40 and
    70 %. From the scripts of the paper: 0.0875 m of soil, 0.13 rad/s, a run at a quarter of the
    size. The slip is 1 - v/(omega R).

    Chosen here: E = 0.15 MPa in place of 15 MPa, and a fluidity that responds within 1e-6 s in
    place of 1e-4 s, than which the time step is longer; a bin of 0.1875 m, which is a whole number
    of cells; a free_slip window at y = 0. The wheel begins on the soil, sinks for a second, then
    rolls towards larger x. Its mass is load/gravity, so that the load is correct at rest and on the
    average. The published runs damp upward motion; this one does not.

    Parameters
    ----------
    slip : float
        Slip, less than 1. A negative one is the skid of a wheel that is braked: it moves faster
        than it rolls, at -1 twice as fast.
    load : float
        Weight of the wheel [N].
    diameter, tread : float
        Diameter, without grousers, and width of the wheel [m].
    grousers : int
        Number of bars across the tread, see `granular.shapes.wheel`.
    grouser_height, grouser_thickness : float
        Their height above the tread and their thickness [m]; by default they are half as thick as
        high, but at least three cells.
    omega : float
        Angular velocity [rad/s].
    friction : float
        Coefficient of friction between wheel and soil.
    length, width, soil, headroom : float
        Length (x) and width (y) of the bed, its depth, and the height above it [m], whole cells.
    start : float
        Initial position x of the axle [m].
    settle, ramp : float
        Time before the wheel turns, and time in which it takes up its velocity [s].
    {common}; also if the wheel would leave the bed.
    """
    slip = in_range("slip", slip, MOST_SKID, 1.0, open_high=True)
    load, gravity = positive("load", load), positive("gravity", gravity)
    radius, omega = positive("diameter", diameter) / 2, positive("omega", omega)
    thickness = max(non_negative("grouser_height", grouser_height) / 2, 3 * positive("cell", cell))
    if grouser_thickness is not None:
        thickness = positive("grouser_thickness", grouser_thickness)
    settle, duration = non_negative("settle", settle), positive("duration", duration)
    speed = (1.0 - slip) * omega * radius
    rolling = max(duration - settle, 2 * positive("ramp", ramp))
    begin, end = positive("start", start), start + speed * rolling
    reach = radius + non_negative("grouser_height", grouser_height)
    if begin < reach or end > positive("length", length) - reach:
        raise ValueError(
            f"start = {start} must keep the wheel, of radius {reach:.6g}, in the bed of "
            f"length = {length}: it goes to {end:.6g}"
        )
    if positive("tread", tread) > positive("width", width):
        raise ValueError(f"tread = {tread} must be <= width = {width}")
    motion = legs(
        ((settle, (0.0, 0.0, 0.0), 0.0), (rolling, (speed, 0.0, 0.0), omega)),
        positive("ramp", ramp),
    )
    # The wheel is twice as wide as the tread: the window at y = 0 cuts it in its middle.
    shape = shapes.wheel(
        radius,
        2 * tread,
        grousers=grousers,
        height=grouser_height,
        thickness=thickness,
    )
    level = (("length", length), ("width", width))
    return Parts(
        **bed(level, soil, headroom, cell, points_per_cell=points_per_cell, jitter=jitter),
        gravity=gravity_down(3, gravity),
        bodies=(
            Body(
                shape,
                (begin, 0.0, reach),
                motion=motion,
                friction=friction,
                free="z",
                mass=load / gravity,
            ),
        ),
    )
