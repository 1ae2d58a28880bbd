"""What a run costs, before it is made."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular.mpm.limits import check_time_step
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme

__all__ = ["Cost", "cost", "nanoseconds", "time_step"]

_NANOSECONDS = {
    2: {
        ("linear", "flip"): 7.3,
        ("ugimp", "flip"): 13.9,
        ("quadratic", "flip"): 11.8,
        ("quadratic", "apic"): 13.4,
        ("quadratic", "tpic"): 17.5,
    },
    3: {
        ("linear", "flip"): 17.6,
        ("ugimp", "flip"): 52.6,
        ("quadratic", "flip"): 55.9,
        ("quadratic", "apic"): 51.5,
        ("quadratic", "tpic"): 93.8,
    },
}
"""Of a point and step on one core, by dimension; 16 points per cell in the plane and 8 in space.
From benchmarks/results/speed.json, to be renewed with it: of a machine with AVX-512; one with AVX2
alone, two generations older, took twice as long."""

_SHARED = {2: 10.2, 3: 34.3}
"""Of a scheme that shares its density in cells, likewise."""

_CARRIED = 1.15
"""Of a transfer that is not in the table over "flip": that of quadratic "apic" in the plane. On
other occasions 1.1 to 2.2."""


@dataclass(frozen=True)
class Cost:
    """An estimate: as if no point ever left, and at the time step of a material at rest.

    Attributes
    ----------
    points : int
        At the start.
    steps : int
    seconds : float
        Of one core [s], to a factor of two or so; with 4 points per cell in the plane about twice
        as much.
    """

    points: int
    steps: int
    seconds: float

    @property
    def point_steps(self) -> int:
        """Points times steps."""
        return self.points * self.steps


def time_step(scene: Scene) -> float:
    """Time step [s] of a scene at rest."""
    scheme = scene.scheme
    if scheme.dt is not None:
        return scheme.dt
    return scheme.cfl * scene.grid.cell / scene.material.wave_speed


def nanoseconds(scheme: Scheme, dim: int) -> float:
    """Time of a point and step of a scheme on one core, about [ns]."""
    if scheme.density.name == "cell_averaged":
        return _SHARED[dim]
    known = _NANOSECONDS[dim]
    measured = known.get((scheme.basis, scheme.transfer))
    return measured or _CARRIED * known[scheme.basis, "flip"]


def cost(scene: Scene) -> Cost:
    """What a scene would cost on one core.

    Raises
    ------
    ValueError
        If its time step is beyond the limit: no simulation would be made of it.
    """
    check_time_step(scene)
    steps = math.ceil(scene.duration / time_step(scene))
    seconds = steps * scene.n_points * nanoseconds(scene.scheme, scene.dim) * 1e-9
    return Cost(scene.n_points, steps, seconds)
