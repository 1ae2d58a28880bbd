"""Functions and schemes shared by the scenes."""

from __future__ import annotations

import math

from granular.checks import non_negative, positive
from granular.gravity import Gravity
from granular.mpm.schemes import Fluidity, ParticleDensity, Scheme

ROUND_OFF = 1e-9
"""Fraction of a cell by which a length may differ from a whole number of cells."""

HEADROOM = 4
"""Empty cells above the initial surface of scenes whose material only falls."""

reconnected = Scheme(fluidity=Fluidity(floor=1e-6, reconnect_fluidity=True))
"""Scheme of the scenes of Haeri & Skonieczny 2021. Due to the floor of the fluidity, material that
has come to rest can flow again (their code begins with a fluidity of 1 1/s). Points that become
dense again get the fluidity of their eq. 23."""

sided = reconnected.replace(transfer="tpic", density=ParticleDensity())
"""The scheme `reconnected` with the density with which the material on the two sides of a thin
body is kept apart."""


def whole_cells(name: str, length: object, cell: float) -> int:
    """Number of cells in a length.

    Raises
    ------
    TypeError, ValueError
        If the length is not a number, not positive, or not a whole number of cells.
    """
    ratio = positive(name, length) / cell
    count = round(ratio) if math.isfinite(ratio) else 0
    if count < 1 or abs(ratio - count) > ROUND_OFF * max(1.0, ratio):
        raise ValueError(f"{name} = {length} must be a whole number of cells of {cell}")
    return count


def enough_cells(length: float, cell: float) -> int:
    """Smallest number of cells that are together at least as long as `length`.

    Raises
    ------
    ValueError
        If the number is not finite.
    """
    if not math.isfinite(length / cell):
        raise ValueError(f"cell = {cell} must not be so small for a domain of {length}")
    return math.ceil(length / cell - ROUND_OFF)


def gravity_down(dim: int, magnitude: object, ramp: object) -> Gravity:
    """Gravity against the last axis; it grows from zero to `magnitude` [m/s2] within `ramp` [s]."""
    zero = (0.0,) * dim
    full = (*zero[1:], -positive("gravity", magnitude))
    end = non_negative("ramp", ramp)
    if end == 0.0:
        return Gravity((0.0,), (full,))
    return Gravity((0.0, end), (zero, full))
