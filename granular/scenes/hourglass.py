"""Hourglasses with a flat or a sloped divider, in a plane or round."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from granular.materials import Material, glass_beads
from granular.model.fill import Fill
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Solid, Wall
from granular.scenes._build import HEADROOM, Parts, whole_cells
from granular.scenes._registry import scene_function
from granular.shapes import Box, Difference, Region, Union
from granular.tools.checks import in_range, non_negative, one_of, positive, truth

WIDTHS = {"flat": 1.0, "sloped": 0.5}
FLOOR_OVER_WIDTH = 2
"""Extent of the flat hourglass's floor, divided by the width of its upper part."""


@dataclass(frozen=True)
class _Lines:
    """Dimensions of the hourglass on the grid [cells]."""

    neck: int  # the divider begins here
    half: int  # half-width of the upper part
    drop: int  # height of the divider
    fill: int
    cell: float

    def at(self, line: int) -> float:
        return line * self.cell

    def box(self, x0: int, y0: int, x1: int, y1: int) -> Box:
        return Box((self.at(x0), self.at(y0)), (self.at(x1), self.at(y1)))


def _stairs(lines: _Lines, slope_deg: float) -> list[Solid]:
    """Blocks, each reaching to the side wall, whose upper inner corners lie on the slope."""
    rise = math.tan(math.radians(slope_deg))
    top = lines.drop + lines.fill + HEADROOM
    blocks, reached = [], lines.drop
    for line in range(lines.neck + 1, lines.half):
        # tan(45 deg) is a little less than 1
        level = min(lines.drop + math.floor((line - lines.neck) * rise + 1e-9), top)
        if level > reached:
            box = lines.box(line, lines.drop, lines.half, level)
            blocks.append(Solid(box.lower, box.upper, kind="free_slip"))
            reached = level
    return blocks


def _walls(lines: _Lines, kind: str, opens_at: float) -> list[Wall]:
    """Walls of either kind of hourglass; the lid of the orifice is the wall that opens."""
    neck, half, drop = lines.at(lines.neck), lines.at(lines.half), lines.at(lines.drop)
    top = lines.at(lines.drop + lines.fill + HEADROOM)
    return [
        Wall(1, 0.0, kind="no_slip"),
        Wall(1, drop, kind="free_slip", span=((neck, half),)),
        Wall(1, drop, kind="free_slip", span=((0.0, neck),), opens_at=opens_at),
        Wall(0, half, kind="free_slip", span=((drop, top),) if kind == "flat" else None),
    ]


@scene_function("mpm")
def hourglass(
    *,
    kind: str = "flat",
    axisymmetric: bool = False,
    orifice_radius: float = 0.02,
    width: float | None = None,
    fill_height: float = 0.25,
    drop: float = 0.5,
    slope_deg: float = 45.0,
    cell: float = 0.01,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    opens_at: float = 0.1,
    gravity: float = 9.8,
    ramp: float = 0.1,
    duration: float = 10.0,
    material: Material = glass_beads,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Right half of an hourglass (Dunatunga & Kamrin 2015, section 4.3), or a round one.

    From the paper: divider 0.5 m above the base, opening radius 0.02 m, fill 0.25 m high, cells
    of 0.01 m with 4 points, no_slip base, all other walls free_slip, 10 s. The rest is as in the
    silo, including the definition of the opening by the last free node: the divider begins at
    orifice_radius + cell. Flat: 1 m wide, no side wall below the divider. Sloped: 0.5 m wide,
    side wall at 0.25 m down to the base, slope as a staircase of free_slip blocks.

    Chosen here: the slope, which the paper does not give, rises at 45 deg from the edge of the
    opening, with the upper inner corners of the steps on the line. It is filled up to a level
    `fill_height` above the opening. Where both faces of a step meet, no velocity component is free,
    so that the staircase hinders sliding. The floor of the flat hourglass ends at the width of its
    upper part (twice its half-width); points that roll further are removed.

    Parameters
    ----------
    kind : {"flat", "sloped"}
        Divider with the opening: level, or a staircase that slopes towards it.
    orifice_radius : float
        Half the width of the opening [m], whole cells.
    width : float or None
        Full width of the upper part [m], twice whole cells; None for 1 (flat) or 0.5 (sloped).
    fill_height, drop : float
        Height of the fill above the divider, and of the divider above the base [m], whole cells.
    axisymmetric : bool
        Whether the plane is one of radius and height: widths are diameters.
    slope_deg : float
        Slope of the staircase to the horizontal [deg], 0 < slope < 90; unused when flat.
    opens_at : float
        Time at which the orifice opens [s].
    {common}; also if the opening leaves no divider.
    """
    one_of("kind", kind, ("flat", "sloped"))
    cell = positive("cell", cell)
    slope_deg = in_range("slope_deg", slope_deg, 0.0, 90.0, open_low=True, open_high=True)
    width = WIDTHS[kind] if width is None else positive("width", width)
    lines = _Lines(
        neck=whole_cells("orifice_radius", orifice_radius, cell) + 1,
        half=whole_cells("width/2", width / 2, cell),
        drop=whole_cells("drop", drop, cell),
        fill=whole_cells("fill_height", fill_height, cell),
        cell=cell,
    )
    if lines.neck >= lines.half:
        raise ValueError(
            f"orifice_radius = {orifice_radius} must be less than width/2 = {width / 2}"
            f" by more than one cell of {cell}"
        )
    walls: list[Wall | Solid] = [*_walls(lines, kind, non_negative("opens_at", opens_at))]
    if not truth("axisymmetric", axisymmetric):
        walls.insert(1, Wall(0, 0.0, kind="free_slip"))
    region: Region = lines.box(0, lines.drop, lines.half, lines.drop + lines.fill)
    if kind == "sloped":
        blocks = _stairs(lines, slope_deg)
        if blocks:
            region = Difference(region, Union(tuple(Box(b.lower, b.upper) for b in blocks)))
        walls += blocks
    n_x = lines.half * (FLOOR_OVER_WIDTH if kind == "flat" else 1)
    return Parts(
        name=f"hourglass_{kind}",
        grid=Grid(
            (0.0, 0.0),
            cell,
            (n_x, lines.drop + lines.fill + HEADROOM),
            open_sides=frozenset({"x+"} if kind == "flat" else ()),
            axisymmetric=axisymmetric,
        ),
        fills=(Fill(region, points_per_cell, jitter=jitter),),
        walls=tuple(walls),
        parameters={"width": width} | ({} if axisymmetric else {"half": True}),
    )
