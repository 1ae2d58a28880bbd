"""Limits of SPH runs, known failures, and the indicators that only SPH runs have."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from granular.model.indicators import MACH, Row, common

if TYPE_CHECKING:
    from granular.sph.scene import Scene


COURANT = 0.5
"""Largest (c + speed) dt/h of SPH. The time step dt = h/(4 c) reaches it if the particles are as
fast as sound."""


def known_failures(scene: Scene) -> list[str]:
    """List known failures that raise no error, one sentence each."""
    return _without_walls(scene) + _fast(scene)


def _without_walls(scene: Scene) -> list[str]:
    """Warn of scenes without walls. An inflow is a reservoir, and a gas carries the particles."""
    pull = np.abs(scene.gravity.vectors).max(axis=0)
    falls = pull.any() and not scene.grid.periodic[int(pull.argmax())]
    if scene.walls or scene.gas or scene.inflows or not falls:
        return []
    return ["there are no walls: particles fall out of the domain, where they are dropped"]


def _fast(scene: Scene) -> list[str]:
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


STOPPED = Row(
    "stopped", "largest", None, "times that a particle entered a wall and was put back on it"
)

_STIFFER = "take a larger kappa; the time step is proportional to 1/sqrt(kappa)"
REMEDIES = MappingProxyType(
    {
        "density_drift": _STIFFER,
        "mach": _STIFFER,
        "compression": _STIFFER,
        "dilution": "find the cause of particles that fly apart",
        "courant": "take a smaller cfl, or no fixed dt",
    }
)
"""Remedies for indicators beyond their limits.

The limit of `disconnected` was measured with MPM alone.
"""


def indicators(scene: Scene) -> tuple[Row, ...]:
    """Indicators of a scene, without an energy balance, as walls exchange energy."""
    rows = common(scene, remedies(scene))
    return (*(row for row in rows if row.name != "energy_created"), STOPPED)


def remedies(scene: Scene) -> Mapping[str, str]:
    """Remedies for indicators beyond their limits; those without one have no limit.

    Without a limit of the density: a stream in free fall leaves cells of one particle empty, so
    that its density would appear to have drifted by a fifth.
    """
    if not scene.inflows:
        return REMEDIES
    return {name: text for name, text in REMEDIES.items() if name != "density_drift"}
