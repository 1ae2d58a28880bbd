"""Limits of SPH runs, what is known to fail, and the indicators of its own."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from granular.sph.scene import Scene

__all__ = ["INDICATORS", "MACH", "courant_limit", "known_failures"]

COURANT = 0.5
"""Largest (c + speed) dt/h of SPH: dt = h/(4 c) where particles are as fast as
sound, the faster of which counts."""

MACH = 0.5
"""Speed of particles over that of sound from which a run is suspect: the density
rises by about this share where they are stopped, as (v/c)^2/2 = (2 sqrt(r) + 1/r - 3)/1.5 for the
ratio r of the densities."""


def known_failures(scene: Scene) -> list[str]:
    """Sentences on particles that may become as fast as sound; empty where none may."""
    g = max(math.hypot(*vector) for vector in scene.gravity.vectors)
    start = max(math.hypot(*fill.velocity) if fill.velocity else 0.0 for fill in scene.fills)
    tops = [fill.region.bounds[1][-1] for fill in scene.fills]
    speed = math.sqrt(start**2 + 2.0 * g * (max(tops) - scene.grid.lower[-1]))
    c = scene.material.wave_speed
    if speed <= MACH * c:
        return []
    needed = scene.material.kappa * (speed / (MACH * c)) ** 2
    return [
        f"particles may fall at {speed:.3g} m/s and sound has {c:.3g} m/s: where they are stopped "
        f"the density rises by about {speed / c:.0%}; take kappa >= {needed:.2g}"
    ]


def courant_limit(scene: Scene) -> float:
    """Largest (c + speed) dt/dx, dx the spacing of the particles."""
    return COURANT * scene.numerics.smoothing


INDICATORS = (
    ("mach", "largest", MACH, "largest speed over that of sound: beyond, densities are off"),
    ("stopped", "largest", None, "times that a particle entered a wall and was put back on it"),
)
"""Name, how samples add up, limit and meaning of what SPH runs are watched for besides."""
