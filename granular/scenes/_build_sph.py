"""Functions shared by the SPH scenes."""

from __future__ import annotations

from collections.abc import Sequence

from granular.checks import non_negative, positive
from granular.gravity import Gravity
from granular.scenes._build import whole_cells

SETTLE = 0.5
"""Time in which the particles settle before walls open [s]."""


def settling_gravity(full: Sequence[float], settle: object) -> Gravity:
    """Gravity that grows to `full` [m/s2] in the first fifth of the settling time `settle` [s].

    It is zero at first because the seeding lattice is stress-free: under full gravity the particles
    would fall together at once and bounce.
    """
    settle = positive("settle", settle)
    return Gravity((0.0, 0.2 * settle), ((0.0,) * len(full), tuple(full)))


def across(width: object, spacing: float) -> tuple[int, ...]:
    """Number of particles across, as a tuple of one number; empty for a 2D scene (width 0)."""
    if non_negative("width", width) == 0.0:
        return ()
    return (whole_cells("width", width, spacing),)
