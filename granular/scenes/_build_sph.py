"""What the scenes of particle hydrodynamics share."""

from __future__ import annotations

from collections.abc import Sequence

from granular.checks import non_negative, positive
from granular.gravity import Gravity
from granular.scenes._build import whole_cells

SETTLE = 0.5
"""Time in which grains settle before walls open [s]."""


def settling_gravity(full: Sequence[float], settle: object) -> Gravity:
    """Gravity that grows to `full` [m/s2] in the first fifth of the time to settle [s].

    It is zero at first since a lattice bears nothing: grains that fall into it at once bounce.
    """
    settle = positive("settle", settle)
    return Gravity((0.0, 0.2 * settle), ((0.0,) * len(full), tuple(full)))


def across(width: object, spacing: float) -> tuple[int, ...]:
    """Points across the plane of a scene, one number; none where the width is 0."""
    if non_negative("width", width) == 0.0:
        return ()
    return (whole_cells("width", width, spacing),)
