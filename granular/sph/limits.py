"""Limits of SPH runs, known failures, and the indicators that only SPH runs have."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from granular.sph.scene import Scene

__all__ = ["INDICATORS", "MACH", "REMEDIES", "courant_limit", "known_failures"]

COURANT = 0.5
"""Largest (c + speed) dt/h of SPH. The time step dt = h/(4 c) reaches it if the particles are as
fast as sound."""

MACH = 0.5
"""Ratio of the speed of particles to that of sound above which a run is suspect. Where such
particles are stopped the density rises by about this fraction, as
(v/c)^2/2 = (2 sqrt(r) + 1/r - 3)/1.5 for the ratio r of the densities."""


def known_failures(scene: Scene) -> list[str]:
    """Sentences on particles that may become nearly as fast as sound; empty if none may."""
    g = max(math.hypot(*vector) for vector in scene.gravity.vectors)
    start = max(math.hypot(*part.velocity) if part.velocity else 0.0 for part in scene.sources)
    tops = [part.region.bounds[1][-1] for part in scene.sources]
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
"""Name, reduction over the samples, limit and meaning of the additional indicators of SPH runs."""

_STIFFER = "take a larger kappa; the time step is proportional to 1/sqrt(kappa)"
REMEDIES = MappingProxyType(
    {
        "density_drift": _STIFFER,
        "mach": _STIFFER,
        "courant": "take a smaller cfl, or no fixed dt",
    }
)
"""Remedies for indicators beyond their limits.

The limit of `disconnected` was measured with MPM alone.
"""
