"""Estimates of the points, steps, time and memory of a run, made before anything is built."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from granular.economy import bias, machine
from granular.economy.suggestion import scene_function
from granular.inflow import Inflow, points_between, standing_points
from granular.mpm.body_distances import distance_from_bodies
from granular.mpm.limits import check_time_step, damped_step
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.seeding import estimated_points, most_points

if TYPE_CHECKING:
    from granular.sph.scene import Scene as SphScene
    from granular.typing import AnyScene

_NANOSECONDS = {
    2: {
        ("linear", "flip"): 10.4,
        ("ugimp", "flip"): 19.7,
        ("quadratic", "flip"): 16.5,
        ("quadratic", "apic"): 23.8,
        ("quadratic", "tpic"): 28.0,
    },
    3: {
        ("linear", "flip"): 24.1,
        ("ugimp", "flip"): 70.4,
        ("quadratic", "flip"): 61.7,
        ("quadratic", "apic"): 87.9,
        ("quadratic", "tpic"): 119.1,
    },
}
"""Time per point and step on one core [ns], by dimension; 16 points per cell in 2D and 8 in 3D. The
numbers are those of benchmarks/results/speed.json and must be updated with it. They hold for a
server processor of 2022 with AVX-512 (Zen 4); others were from 0.6 to 2 times as fast."""

_SHARED = {2: 14.9, 3: 39.7}
"""Time per point and step of a scheme with the cell-averaged density [ns], likewise."""

_IN_SINGLE = {2: 0.70, 3: 0.57}
"""Time of the default scheme in single precision, relative to double precision, likewise."""

_CARRIED = 1.44
"""Time of a transfer that is not in the table, relative to "flip". This is the ratio of quadratic
"apic" in 2D; in other measurements it was 1.1 to 2.2."""


_SPH_NANOSECONDS = {(2, False): 200.0, (3, False): 820.0, (2, True): 505.0, (3, True): 3700.0}
"""Time per particle and step of SPH on one core [ns], by dimension and whether there is a gas:
benchmarks/sph_speed.py on a machine with AVX-512."""

_BASE_MEMORY = 105 * 2**20
"""Memory of the interpreter and the package [bytes]."""
_POINT_MEMORY = 700
"""Memory of a point and of its seeding [bytes]. With `_CELL_MEMORY` it is within 0.7 to 1.3 of the
largest memory of seven scenes of 25,000 to 1,000,000 points: columns, cylinders and silos with 1 to
16 points per cell in 2D and 3D, with the default scheme."""
_CELL_MEMORY = {2: 1700, 3: 6600}
"""Memory of a cell with points and of its nodes [bytes]."""
_GROWTH_MEMORY = {2: 440, 3: 560}
"""Memory of a point [bytes] in the larger buffers to which it moves from those it is in, and of new
cells: what 216,000 to 250,000 points that fly apart take at most beyond the memory at the
start when their buffers first grow, with the default scheme."""
_SPH_MEMORY = {2: 500, 3: 1000}
"""Memory of a particle of SPH with its neighbours [bytes], be it of the material, a gas or a wall:
0.83 to 1.08 of that of layers of 50,000 to 200,000 particles on floors of 8000 to 200,000."""
_FACE_MEMORY = 4
"""Memory of a face of a cell of the box [bytes], for a nonlocal law."""

MOST_STEPS = 1e15
"""Number of steps that no run can make: at 1 us each they take 30 years."""

TOLERANCE = 0.02
"""Error with which a stiffness is enough."""
STRAIN = 1e-3
"""Pressure strain p/K at the foot of the material up to which grains are stiff enough where the
error was not measured. The laws that were measured give errors of 0.012 to 0.03 at this strain with
the default scheme, nearly all of which is the scatter of stiff runs."""


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
        Time on one core [s], within a factor of about two; with 4 points per cell in 2D it is
        about twice as long, and thin layers of material on a body take up to ten times as long.
    memory : float
        Memory with these points [bytes], within about a third.
    peak_memory : float
        Memory [bytes] while the buffers of the points grow, the old and the new ones being there at
        the same time. That happens only to material that spreads over many more cells: a
        column that collapses does not, one that flies apart does. The same as `memory` for SPH.
    E : float
        Young's modulus of the material [Pa]; nan for SPH.
    enough_E : float
        Young's modulus that would be enough [Pa]; nan if nothing is known. The number of steps is
        proportional to sqrt(E).
    error : float
        Error of the quantity of interest with it; nan if `enough_E` is that of the pressure strain
        `STRAIN`, with which the error was not measured.
    unborn : float
        Mean number over the run of the points that are still to enter.
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

    @property
    def point_steps(self) -> int:
        """Number of points times number of steps; points that enter count from then on."""
        return round(self.steps * (self.points - self.unborn))

    def __str__(self) -> str:
        text = (
            f"{self.points:,} points, {self.steps:,} steps: about {_duration(self.seconds)} on one "
            f"core, {_gigabytes(self.memory)}"
        )
        if not self.enough_E < self.E:
            return text
        known = f"error {self.error:.2g}" if self.error >= 0 else f"p/K = {STRAIN:g} at the foot"
        faster = math.sqrt(self.E / self.enough_E)
        return (
            f"{text}; E = {self.enough_E:.2g} Pa in place of {self.E:.2g} would be enough "
            f"({known}) and {faster:.2g} times faster"
        )


def _duration(seconds: float) -> str:
    for unit, length in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2 * length:
            return f"{seconds / length:.2g} {unit}"
    return f"{seconds:.2g} s"


def _gigabytes(memory: float) -> str:
    return f"{memory / 2**30:.2g} GB"


def time_step(scene: AnyScene) -> float:
    """Time step [s] of a scene at rest."""
    if not isinstance(scene, Scene):
        return scene.numerics.dt or scene.numerics.cfl * scene.longest_dt
    scheme = scene.scheme
    if scheme.dt is not None:
        return scheme.dt
    return damped_step(scene, scheme.cfl * scene.grid.cell / scene.wave_speed)


def nanoseconds(scheme: Scheme, dim: int) -> float:
    """Approximate time per point and step of a scheme on one core [ns]."""
    if scheme.density.name == "cell_averaged":
        return _SHARED[dim]
    known = _NANOSECONDS[dim]
    measured = known.get((scheme.basis, scheme.transfer))
    share = _IN_SINGLE[dim] if scheme.precision == "single" else 1.0
    return share * (measured or _CARRIED * known[scheme.basis, "flip"])


def cost(scene: AnyScene) -> Cost:
    """Estimate points, steps, time on one core and memory of a scene, and the stiffness it needs.

    Nothing is built, so that this takes well below a second for any scene.

    Raises
    ------
    ValueError
        If the time step of the scene exceeds its limit, so that no simulation could be made.
    """
    points, memory = _size(scene)
    if not isinstance(scene, Scene):
        steps = _steps(scene)
        each = _SPH_NANOSECONDS[scene.dim, scene.gas is not None]
        unborn = _unborn(scene)
        seconds = steps * (points - unborn) * each * 1e-9
        return Cost(points, steps, seconds, memory, memory, unborn=unborn)
    check_time_step(scene)
    steps = _steps(scene)
    unborn = _unborn(scene)
    seconds = steps * (points - unborn) * nanoseconds(scene.scheme, scene.dim) * 1e-9
    peak = memory + points * _GROWTH_MEMORY[scene.dim]
    return Cost(points, steps, seconds, memory, peak, scene.material.E, *_enough(scene), unborn)


def _unborn(scene: AnyScene) -> float:
    """Mean number over the run of the points that are still to enter."""
    mean = 0.0
    for inflow in _fed_by(scene):
        begin, end = (min(time, scene.duration) for time in inflow.times)
        share = 0.5 * (begin + end) / scene.duration  # of the run, for the mean point
        mean += share * points_between(inflow, scene.grid, 0.0, scene.duration)
    return mean


def _fed_by(scene: AnyScene) -> list[Inflow]:
    """Inflows of the material, and of the gas of a scene."""
    if isinstance(scene, Scene):
        return list(scene.inflows)
    return [*scene.inflows, *(inflow for inflow, _ in scene.gas_inflows())]


def _entering(scene: AnyScene) -> list[int]:
    """Numbers of points that inflows bring, at the start and in the run."""
    return [
        points_between(inflow, scene.grid, 0.0, scene.duration)
        + (len(standing_points(scene, i).x) if inflow.driven and i < len(scene.inflows) else 0)
        for i, inflow in enumerate(_fed_by(scene))
    ]


def _steps(scene: AnyScene) -> int:
    dt = time_step(scene)
    if not 0.0 < scene.duration < MOST_STEPS * dt:
        raise ValueError(
            f"duration = {scene.duration} must be less than {MOST_STEPS:g} time steps of {dt:.3g} s"
        )
    return math.ceil(scene.duration / dt)


def _size(scene: AnyScene) -> tuple[int, float]:
    """Number of points at the end, and the memory that they need [bytes]."""
    if not isinstance(scene, Scene):
        points = _sph_particles(scene)
        particles = points + _wall_particles(scene)
        return points, _BASE_MEMORY + particles * _SPH_MEMORY[scene.dim]
    distance = distance_from_bodies(scene)
    counts = [estimated_points(scene.grid, fill, distance) for fill in scene.fills]
    counts += _entering(scene)
    return sum(counts), _memory(scene, counts)


def _memory(scene: Scene, counts: Sequence[int]) -> float:
    """Memory of a scene with so many points from its sources [bytes]."""
    memory = float(_BASE_MEMORY)
    for source, count in zip(scene.sources, counts, strict=True):
        memory += count * (_POINT_MEMORY + _CELL_MEMORY[scene.dim] / source.points_per_cell)
    if scene.nonlocal_material is not None:
        memory += _FACE_MEMORY * 2 * scene.dim * math.prod(scene.grid.shape)
    return memory


def _sph_particles(scene: SphScene) -> int:
    """Number of particles of the material and of the gas."""
    gas = () if scene.gas is None else scene.gas.fills
    counts = [estimated_points(scene.grid, fill, even=True) for fill in (*scene.fills, *gas)]
    return sum(counts) + sum(_entering(scene))


def _wall_particles(scene: SphScene) -> int:
    """Number of particles of the walls; where walls meet they count twice."""
    extents = (wall.extent(f"walls[{i}]", scene.grid) for i, wall in enumerate(scene.walls))
    return sum(math.prod(last - first for first, last in ends) for ends in extents)


def _enough(scene: Scene) -> tuple[float, float]:
    """Young's modulus that is enough [Pa], and the error with it; nan where nothing is known."""
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
        return bias.rounded(material.E * strain / STRAIN), math.nan
    except (ArithmeticError, RuntimeError, ValueError):  # numbers for which no law was made
        return math.nan, math.nan


def check_memory(scene: AnyScene, force: bool = False) -> None:
    """Refuse a scene that needs more memory than the machine has, unless `force` is set.

    Raises
    ------
    ValueError
        Naming the number of points, the cells, and the memory needed and available.
    """
    available = machine.available_memory()
    if force:
        return
    if isinstance(scene, Scene):
        # If there is memory for all squares of the seeding lattices, the open ones need no count.
        counts = [most_points(scene.grid, fill) for fill in scene.fills] + _entering(scene)
        if _memory(scene, counts) <= available:
            return
    points, memory = _size(scene)
    if memory <= available:
        return
    cells = " x ".join(map(str, scene.grid.shape))
    raise ValueError(
        f"scene {scene.name!r} with about {points:.3g} points in {cells} cells needs about "
        f"{_gigabytes(memory)} of memory, must be at most the {_gigabytes(available)} that are "
        "available: take larger cells or fewer points per cell, or force=True"
    )
