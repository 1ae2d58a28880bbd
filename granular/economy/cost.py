"""Estimate of the cost of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular.mpm.limits import check_time_step
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme

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
"""Time per point and step on one core [ns], by dimension; 16 points per cell in 2D and 8 in 3D. The
numbers are those of benchmarks/results/speed.json and must be updated with it. They hold for a
machine with AVX-512; one with AVX2 only, two generations older, took twice as long."""

_SHARED = {2: 10.2, 3: 34.3}
"""Time per point and step of a scheme with the cell-averaged density [ns], likewise."""

_CARRIED = 1.15
"""Time of a transfer that is not in the table, relative to "flip". This is the ratio of quadratic
"apic" in 2D; in other measurements it was 1.1 to 2.2."""


@dataclass(frozen=True)
class Cost:
    """Estimated cost of a run if no point leaves and the time step is that of material at rest.

    Attributes
    ----------
    points : int
        Number of points at the start.
    steps : int
        Number of steps.
    seconds : float
        Time on one core [s], within a factor of about two; with 4 points per cell in 2D it is
        about twice as long.
    """

    points: int
    steps: int
    seconds: float

    @property
    def point_steps(self) -> int:
        """Number of points times number of steps."""
        return self.points * self.steps


def time_step(scene: Scene) -> float:
    """Time step [s] of a scene at rest."""
    scheme = scene.scheme
    if scheme.dt is not None:
        return scheme.dt
    return scheme.cfl * scene.grid.cell / scene.material.wave_speed


def nanoseconds(scheme: Scheme, dim: int) -> float:
    """Approximate time per point and step of a scheme on one core [ns]."""
    if scheme.density.name == "cell_averaged":
        return _SHARED[dim]
    known = _NANOSECONDS[dim]
    measured = known.get((scheme.basis, scheme.transfer))
    return measured or _CARRIED * known[scheme.basis, "flip"]


def cost(scene: Scene) -> Cost:
    """Estimate the cost of a scene on one core.

    Raises
    ------
    ValueError
        If the time step of the scene exceeds its limit, so that no simulation could be made.
    """
    check_time_step(scene)
    steps = math.ceil(scene.duration / time_step(scene))
    seconds = steps * scene.n_points * nanoseconds(scene.scheme, scene.dim) * 1e-9
    return Cost(scene.n_points, steps, seconds)
