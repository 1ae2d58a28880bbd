"""Functions and schemes shared by the scenes."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

from granular.materials import glass_beads
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.mpm.schemes import Fluidity, ParticleDensity, Scheme
from granular.mpm.walls import Wall
from granular.shapes import Box
from granular.tools.checks import in_range, integer, non_negative, positive, truth

Parts = dict[str, Any]
"""Parts of a scene by name; a scene function returns those that it sets itself."""

ROUND_OFF = 1e-9
"""Fraction of a cell by which a length may differ from a whole number of cells."""

HEADROOM = 4
"""Empty cells above the initial surface of scenes whose material only falls."""

MARGIN = 3
"""Cells of the grid beyond the surface of a body that holds the material, as splines extend over
two nodes."""

SETTLE = 0.5
"""Time in which the particles of SPH settle before walls open [s]."""

soft_beads = glass_beads.replace(E=1e6)
"""Material of scenes whose boundaries are bodies: the time steps are thirty times those of
`glass_beads`, and p/E is below 0.002 in a bed 0.1 m deep."""

PROMPT = 1e-6
"""Response time t0 of the fluidity of soft grains [s], for time steps longer than the 1e-4 s of the
papers: the law then flows within a step. With 1e-4 s in one substep it responds late, which makes
the force on a blade a seventh smaller and a wheel sink two fifths deeper
(docs/explanation/fluidity.md)."""

reconnected = Scheme(fluidity=Fluidity(floor=1e-6, reconnect_fluidity=True))
"""Scheme of the scenes of Haeri & Skonieczny 2021. Due to the floor of the fluidity, material that
has come to rest can flow again (their code begins with a fluidity of 1 1/s). Points that become
dense again get the fluidity of their eq. 23."""

in_soft_soil = reconnected.replace(tpic_least_decay=6.0)
"""The same for softer soil: without a slight decay its velocities differ by a tenth within a cell
(docs/explanation/transfers.md)."""

sided = in_soft_soil.replace(transfer="tpic", density=ParticleDensity())
"""The scheme `in_soft_soil` with the density with which the material on the two sides of a thin
body is kept apart."""


def whole_cells(name: str, length: object, cell: float) -> int:
    """Number of cells in a length; refuses one that is not a whole number of cells."""
    ratio = positive(name, length) / cell
    count = round(ratio) if math.isfinite(ratio) else 0
    if count < 1 or abs(ratio - count) > ROUND_OFF * max(1.0, ratio):
        raise ValueError(f"{name} = {length} must be a whole number of cells of {cell}")
    return count


def enough_cells(length: float, cell: float) -> int:
    """Smallest number of cells that are together at least as long as `length`; must be finite."""
    if not math.isfinite(length / cell):
        raise ValueError(f"cell = {cell} must not be so small for a domain of {length}")
    return math.ceil(length / cell - ROUND_OFF)


def level_cells(columns: object, columns_across: object) -> tuple[int, ...]:
    """Numbers of cells along the horizontal axes, which are two, or one with 0 columns across."""
    along, across = integer("columns", columns, 1), integer("columns_across", columns_across, 0)
    return (along, across) if across else (along,)


def cells_across(name: str, width: object, spacing: float) -> tuple[int, ...]:
    """Number of particles across, as a tuple of one number; empty for a 2D scene (width 0)."""
    if non_negative(name, width) == 0.0:
        return ()
    return (whole_cells(name, width, spacing),)


def block(
    cell: float,
    cells: tuple[int, ...],
    upper: tuple[float, ...],
    *,
    lower: tuple[float, ...] | None = None,
    base: tuple[float, ...] | None = None,
    periodic: Collection[int] = (),
    open_sides: Collection[str] = (),
    axisymmetric: bool = False,
    points_per_cell: int = 1,
    **fill: Any,
) -> Parts:
    """Grid and fills of a scene that begins as a box of material.

    The box reaches from `base` to `upper` [m]. The grid begins at `lower`, by default in the
    origin, and so does the box without a `base`. `periodic` names axes of the grid, and `fill` has
    further arguments of `Fill`.
    """
    lower = lower or (0.0,) * len(cells)
    flags = tuple(axis in periodic for axis in range(len(cells)))
    return {
        "grid": Grid(lower, cell, cells, flags, frozenset(open_sides), axisymmetric),
        "fills": (Fill(Box(base or lower, upper), points_per_cell, **fill),),
    }


def dimension(dim: object, axisymmetric: object, default: int) -> int:
    """Dimension of a scene, by default that of its plane if it is axisymmetric."""
    if truth("axisymmetric", axisymmetric):
        if dim not in (None, 2):
            raise ValueError(f"dim = {dim} must be 2 or None with axisymmetric = True")
        return 2
    return default if dim is None else integer("dim", dim, 2, 3)


def smooth_sides(grid: Grid) -> tuple[Wall, ...]:
    """Free-slip walls at both ends of the horizontal axes of a grid, but not on an axis of
    symmetry."""
    return tuple(
        Wall(axis, end[axis], kind="free_slip")
        for axis in range(grid.dim - 1)
        for end in ((grid.upper,) if grid.has_axis else (grid.lower, grid.upper))
    )


def down_slope(dim: int, magnitude: object, angle_deg: object) -> tuple[float, ...]:
    """Vector of gravity [m/s2] with the first axis down a slope of `angle_deg`, from 0 to 90."""
    angle = math.radians(in_range("angle_deg", angle_deg, 0.0, 90.0, open_high=True))
    g = positive("gravity", magnitude)
    return (g * math.sin(angle), *(0.0,) * (dim - 2), -g * math.cos(angle))


def gravity_down(dim: int, magnitude: object, ramp: object = 0.0) -> Gravity:
    """Gravity against the last axis; it grows from zero to `magnitude` [m/s2] within `ramp` [s]."""
    return ramped((*(0.0,) * (dim - 1), -positive("gravity", magnitude)), ramp)


def ramped(full: tuple[float, ...], ramp: object) -> Gravity:
    """Gravity that grows from zero to the vector `full` [m/s2] within `ramp` [s]."""
    end = non_negative("ramp", ramp)
    if end == 0.0:
        return Gravity((0.0,), (full,))
    return Gravity((0.0, end), ((0.0,) * len(full), full))


def settling_gravity(full: tuple[float, ...], settle: object) -> Gravity:
    """Gravity that grows to `full` [m/s2] in the first fifth of the settling time `settle` [s].

    It is zero at first because the seeding lattice is stress-free: under full gravity the particles
    would fall together at once and bounce.
    """
    return ramped(full, 0.2 * positive("settle", settle))
