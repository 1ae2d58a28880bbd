"""Estimates of the points, steps, time and memory of a run, made without building it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from granular.economy import bias
from granular.economy.pace import seconds_of_step, slowness
from granular.economy.suggestion import scene_function
from granular.model.inflow import points_between
from granular.model.plausible import rounded
from granular.mpm import memory as of_mpm
from granular.mpm.limits import check_time_step, step_at_rest
from granular.mpm.scene import Scene
from granular.run.memory import gigabytes
from granular.sph import memory as of_sph

if TYPE_CHECKING:
    from granular.model.typing import AnyScene

_SPH_NANOSECONDS = {(2, False): 200.0, (3, False): 820.0, (2, True): 505.0, (3, True): 3700.0}
"""Time per particle and step of SPH on one core [ns], by dimension and whether there is a gas:
benchmarks/sph/sph_speed.py on a machine with AVX-512."""

MOST_STEPS = 1e15
"""Number of steps that no run can make: at 1 us each they take 30 years."""

TOLERANCE = 0.02
"""Error with which a stiffness is enough."""
STRAIN = 1e-3
"""Pressure strain p/K at the foot of the material up to which grains are stiff enough where the
error was not measured. The laws that were measured give errors of 0.012 to 0.045 at this strain
with the default scheme, nearly all of which is the scatter of stiff runs."""


@dataclass(frozen=True)
class Cost:
    """Estimated cost of a run if no point leaves and the time step is that of material at rest.

    Attributes
    ----------
    points : int
        Number of points at the end, when those of inflows have entered; beyond 200,000 at the start
        an estimate.
    steps : int
        Number of steps.
    seconds : float
        Time on one core of this machine [s]. Runs take 0.65 to 1.1 times as long, some with tools
        in soil half of it; material that spreads over many more cells takes longer. The speed of
        the machine is measured once, in 0.1 s.
    memory : float
        Memory of a run with these points and a record [bytes]: 1.03 to 1.25 times the peak, and 1.1
        to 1.35 times (in single precision to 1.65) that of a run without a record.
    peak_memory : float
        Memory [bytes] while the buffers of the points grow, when the old and the new ones exist at
        the same time. This occurs only if material spreads over many more cells: not for a
        collapsing column, but for one that flies apart. The same as `memory` for SPH.
    E : float
        Young's modulus of the material [Pa]; nan for SPH.
    enough_E : float
        Young's modulus that would be enough [Pa]; nan if it is unknown. The number of steps is
        proportional to sqrt(E).
    error : float
        Error of the quantity of interest with it; nan if `enough_E` is that of the pressure strain
        `STRAIN`, with which the error was not measured.
    unborn : float
        Mean number over the run of the points that have not entered yet.
    pressure : float
        Pressure rho_c g H at the foot of the material [Pa]; nan for SPH.
    """

    points: int
    steps: int
    seconds: float
    memory: float
    peak_memory: float
    E: float = math.nan
    enough_E: float = math.nan
    error: float = math.nan
    unborn: float = 0.0
    pressure: float = math.nan

    @property
    def point_steps(self) -> int:
        """Number of points times number of steps; points that enter count from then on."""
        return round(self.steps * (self.points - self.unborn))

    def __str__(self) -> str:
        text = (
            f"{self.points:,} points, {self.steps:,} steps: about {_duration(self.seconds)} on one "
            f"core, {gigabytes(self.memory)}"
        )
        if self.pressure > 0:
            text += f"; E is {self.E / self.pressure:.3g} times the pressure at the foot"
        if math.isnan(self.enough_E) or self.enough_E == self.E:
            return text
        known = f"error {self.error:.2g}" if self.error >= 0 else f"p/K = {STRAIN:g} at the foot"
        change = math.sqrt(self.E / self.enough_E)
        pace = f"{change:.2g} times faster" if change > 1 else f"{1 / change:.2g} times slower"
        return (
            f"{text}; E = {self.enough_E:.2g} Pa in place of {self.E:.2g} would be enough "
            f"({known}) and {pace}"
        )


def _duration(seconds: float) -> str:
    """A time in two digits, without powers of ten: 110 s, 2.2 min."""
    units = ("days", 86400.0), ("h", 3600.0), ("min", 60.0), ("s", 1.0)
    unit, length = next((known for known in units if seconds >= 2 * known[1]), units[-1])
    return f"{float(f'{seconds / length:.2g}'):g} {unit}"


def time_step(scene: AnyScene) -> float:
    """Time step [s] of a scene at rest."""
    if not isinstance(scene, Scene):
        return scene.numerics.dt or scene.numerics.cfl * scene.longest_dt
    return step_at_rest(scene)


def cost(scene: AnyScene) -> Cost:
    """Estimate points, steps, time on one core and memory of a scene, and the stiffness it needs.

    The simulation is not built, so that this takes well below a second for any scene. The speed of
    the machine is measured once in a program, with a small block of grains.

    Raises
    ------
    ValueError
        If the time step of the scene exceeds its limit, so that no simulation could be made.
    """
    if not isinstance(scene, Scene):
        points, needed = of_sph.size(scene)
        steps = _steps(scene)
        each = _SPH_NANOSECONDS[scene.dim, scene.gas is not None]
        unborn = _unborn(scene)
        seconds = steps * (points - unborn) * each * slowness() * 1e-9
        return Cost(points, steps, seconds, needed, needed, unborn=unborn)
    points, needed = of_mpm.size(scene)
    check_time_step(scene)
    steps = _steps(scene)
    unborn = _unborn(scene)
    seconds = steps * seconds_of_step(scene, points - unborn)
    peak = needed + of_mpm.growth(scene, points)
    E, pressure = scene.material.E, bias.pressure_strain(scene) * scene.material.K
    return Cost(points, steps, seconds, needed, peak, E, *_enough(scene), unborn, pressure)


def _unborn(scene: AnyScene) -> float:
    """Mean number over the run of the points that have not entered yet."""
    mean = 0.0
    inflows = scene.inflows if isinstance(scene, Scene) else of_sph.fed_by(scene)
    for inflow in inflows:
        begin, end = (min(time, scene.duration) for time in inflow.times)
        share = 0.5 * (begin + end) / scene.duration  # of the run, for the mean point
        mean += share * points_between(inflow, scene.grid, 0.0, scene.duration)
    return mean


def _steps(scene: AnyScene) -> int:
    dt = time_step(scene)
    if not 0.0 < scene.duration < MOST_STEPS * dt:
        raise ValueError(
            f"duration = {scene.duration} must be less than {MOST_STEPS:g} time steps of {dt:.3g} s"
        )
    return math.ceil(scene.duration / dt)


def _enough(scene: Scene) -> tuple[float, float]:
    """Young's modulus that is enough [Pa], and the error with it; nan where they are unknown."""
    function, material = scene_function(scene), scene.material
    name = function.__name__ if function else ""

    def error(E: float) -> float:
        return bias.stiffness_error(scene, name, material.replace(E=E))

    try:
        with np.errstate(all="ignore"):
            E = bias.softest(scene, error, TOLERANCE)
            if not math.isnan(E):
                return E, error(E)
        strain = bias.pressure_strain(scene)
        if not material.granular or not strain > 0:
            return math.nan, math.nan
        return rounded(material.E * strain / STRAIN), math.nan
    except (ArithmeticError, RuntimeError, ValueError):  # numbers for which no law was made
        return math.nan, math.nan
