"""Memory of a run by SPH, estimated before anything is built; see `granular.mpm.memory`."""

from __future__ import annotations

import math

from granular.model.inflow import Inflow
from granular.model.seeding import estimated_points
from granular.run.memory import BASE, MARGIN, entering, refuse
from granular.sph.scene import Scene
from granular.tools.checks import truth

_PARTICLE = {2: (745, 480), 3: (1150, 850)}
"""Memory of a particle of SPH with its neighbours [bytes], of the material and of a wall, by
dimension: fits to recorded layers of 40,000 to 200,000 particles on floors of 10,000 to 112,000."""
_WITH_GAS = 1.3
"""The same for all particles of a scene with a gas, relative to those of one without."""


def size(scene: Scene) -> tuple[int, float]:
    """Number of particles at the end, without walls, and the memory needed [bytes]."""
    gas = () if scene.gas is None else scene.gas.fills
    counts = [estimated_points(scene.grid, fill, even=True) for fill in (*scene.fills, *gas)]
    points = sum(counts) + sum(entering(scene, fed_by(scene)))
    of_material, of_wall = _PARTICLE[scene.dim]
    particles = points * of_material + _wall_particles(scene) * of_wall
    return points, MARGIN * (BASE + particles * (1.0 if scene.gas is None else _WITH_GAS))


def fed_by(scene: Scene) -> list[Inflow]:
    """Inflows of the material, and of the gas of a scene."""
    return [*scene.inflows, *(inflow for inflow, _ in scene.gas_inflows())]


def _wall_particles(scene: Scene) -> int:
    """Number of particles of the walls; where walls meet they count twice."""
    sites = (wall.sites(f"walls[{i}]", scene.grid) for i, wall in enumerate(scene.walls))
    return sum(math.prod(last - first for first, last in ends) for ends in sites)


def check(scene: Scene, force: bool) -> None:
    """Refuse a scene that needs more memory than the machine has, unless `force` is set.

    Raises
    ------
    ValueError
        See `granular.run.memory.refuse`.
    """
    if not truth("force", force):
        refuse(scene, *size(scene))
