"""What a run costs, before it is made."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular.scene import Scene
from granular.schemes import Scheme
from granular.stability import dt_limit

__all__ = ["Cost", "cost", "nanoseconds", "time_step"]

_NANOSECONDS = {
    ("linear", "flip"): 14.0,
    ("linear", "xpic"): 20.0,
    ("linear", "apic"): 18.0,
    ("linear", "tpic"): 18.0,
    ("ugimp", "flip"): 24.0,
    ("quadratic", "flip"): 22.0,
    ("quadratic", "apic"): 28.0,
}
"""Of a point and step on one core with few points, tracked density (docs/kernels.md); those not in
that table are guesses. Only their ratios matter here."""

_OTHER, _DIFFUSED, _SHARED = 30.0, 37.0, 20.0


@dataclass(frozen=True)
class Cost:
    """An estimate: as if no point ever left, and at the time step of a material at rest.

    Attributes
    ----------
    points : int
        At the start.
    steps : int
    seconds : float
        Of one core [s], to a factor of two or so.
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


def nanoseconds(scheme: Scheme) -> float:
    """Time of a point and step of a scheme on one core, about [ns]."""
    if scheme.density != "tracked":
        return _DIFFUSED if scheme.density == "diffused" else _SHARED
    return _NANOSECONDS.get((scheme.basis, scheme.transfer), _OTHER)


def cost(scene: Scene) -> Cost:
    """What a scene would cost on one core.

    Raises
    ------
    ValueError
        If its fixed time step is beyond the limit.
    """
    dt = time_step(scene)
    if dt > dt_limit(scene):
        raise ValueError(f"dt = {dt} must be <= {dt_limit(scene):.4g}")
    steps = math.ceil(scene.duration / dt)
    seconds = steps * scene.n_points * nanoseconds(scene.scheme) * 1e-9
    return Cost(scene.n_points, steps, seconds)
