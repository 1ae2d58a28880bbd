"""Time of a step on one core, from measured times and the speed of this machine."""

from __future__ import annotations

import functools
import json
import time
from importlib.resources import files
from typing import Any

import numpy as np

from granular.materials.own import OwnLaw
from granular.measure.surface_area import body_cells, may_move
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.mpm.bodies import Body
from granular.mpm.body_distances import distance_from_bodies
from granular.mpm.engine import averaging_interval
from granular.mpm.scene import Scene
from granular.mpm.schemes import ParticleDensity, Scheme
from granular.mpm.walls import Wall
from granular.shapes import Box, Cylinder, HeightMap, Mesh, Sphere

_CARRIED = 1.44
"""Time of a transfer that is not in the table, relative to "flip". This is the ratio of quadratic
"apic" in 2D; in other measurements it was 1.1 to 2.2."""

_NONLOCAL, _SEVERAL = 1.25, 1.4
"""Time of a step with a nonlocal law, and with several materials, over that of one local law."""

OF_OWN_LAW = {"numpy": 400.0, "numba": 20.0, "c": 6.0}
"""Time per point and step of a law of one's own [ns], by its language."""

CONTACT, SAMPLED = 0.42, 1.3
"""Time of a contact point in a step [us]: of a body of plain shapes, and of one of samples, such as
a mesh or a height map."""

OPEN_VOLUME = 6.5
"""Time of a cell at the surface of a body in an averaging of the density [us], as the volume of the
body in it is computed again if a body has moved."""

STEP = 1.2
"""Time of a step without points [us]."""

MOST_POINTS = 300_000
"""Number of points up to which those near bodies are counted; of more the contact is left out."""


@functools.cache
def _measured() -> dict[str, Any]:
    """Times that `python benchmarks speed` has measured, with one thread.

    "reference": `reference_time` [ns]; dimension: scheme: points in a cell: rows of a number of
    points and the time per point and step [ns], the mean of states as seeded and in flow.
    """
    text = files("granular.economy").joinpath("step_times.json").read_text(encoding="utf-8")
    known: dict[str, Any] = json.loads(text)
    return known


def reference_time() -> float:
    """Time per point and step [s] of a block of 12,800 points at rest, the shortest of 30."""
    # Imported here: a scene is described without the engine.
    from granular.materials import MuI
    from granular.run.simulation import Simulation

    block = Fill(Box((0.0, 0.0), (1.0, 0.5)), 16, lithostatic=True)
    scene = Scene(
        name="pace",
        grid=Grid((0.0, 0.0), 0.025, (40, 24)),
        fills=(block,),
        material=MuI(E=1e6),
        walls=(Wall(1, 0.0),),
        gravity=Gravity.constant(9.8),
        duration=1.0,
    )
    sim = Simulation(scene, threads=1, force=True)
    sim.step(10)
    least = np.inf
    for _ in range(30):
        begin = time.perf_counter()
        sim.step(5)
        least = min(least, (time.perf_counter() - begin) / 5)
    return float(least / scene.n_points)


@functools.cache
def slowness() -> float:
    """Time of a step on this machine, relative to the table: measured once, in about 0.1 s."""
    return 1e9 * reference_time() / float(_measured()["reference"])


def nanoseconds(
    scheme: Scheme, dim: int, points: float = 10_000, per_cell: float | None = None
) -> float:
    """Time per point and step of a scheme [ns] on the machine of the table.

    A step has a part for each point and one for each cell, and both grow as the points and the sums
    of the cells outgrow the caches. Between the measured states the time is therefore linear in the
    number of cells for a point, and in the logarithm of the number of points. Without `per_cell`
    a cell has 2**dim points.
    """
    known, share = _measured()[str(dim)], 1.0

    def at(name: str) -> float:
        return _between(known[name], points, per_cell or 2**dim)

    if scheme.density.name == "cell_averaged":
        name = "cell averaged"
    elif (scheme.basis, scheme.transfer) == ("quadratic", "tpic"):
        name = "default"
    else:
        name = f"{scheme.basis} {scheme.transfer}"
    if name not in known:
        name, share = f"{scheme.basis} flip", _CARRIED
    if scheme.precision == "single":
        share *= at("default, single precision") / at("default")
    return share * at(name)


def _between(times: dict[str, list[list[float]]], points: float, per_cell: float) -> float:
    """Time [ns] between the measured ones: points in a cell: rows of points and time."""
    (few, of_few), (many, of_many) = sorted((int(n), np.transpose(t)) for n, t in times.items())
    first, last = (
        float(np.interp(np.log(max(points, 1.0)), np.log(sizes), ns))
        for sizes, ns in (of_few, of_many)
    )
    return first + (last - first) * (1 / few - 1 / per_cell) / (1 / few - 1 / many)


def seconds_of_step(scene: Scene, points: float) -> float:
    """Time of a step with these points on one core of this machine [s]."""
    each = nanoseconds(scene.scheme, scene.dim, points, _per_cell(scene))
    if scene.nonlocal_material is not None:
        each *= _NONLOCAL
    if len(scene.materials) > 1:
        each *= _SEVERAL
    languages = [m.language for m in scene.materials if isinstance(m, OwnLaw)]
    each += max((OF_OWN_LAW[language] for language in languages), default=0.0)
    return slowness() * (1e-9 * each * points + 1e-6 * (STEP + _of_bodies(scene)))


def _per_cell(scene: Scene) -> float:
    """Points in a full cell, the mean over the fills and inflows."""
    counts = [fill.points_per_cell for fill in scene.fills]
    counts += [inflow.points_per_cell for inflow in scene.inflows]
    return float(np.mean(counts)) if counts else 4.0 ** (scene.dim - 1)


def _of_bodies(scene: Scene) -> float:
    """Time in a step for the contact with bodies, and for their volumes [us]."""
    if not scene.bodies:
        return 0.0
    time = 0.0
    if scene.n_points <= MOST_POINTS:
        kinds = [leaf for body in scene.bodies for leaf in body.shape.leaves()]
        sampled = any(isinstance(leaf, HeightMap | Mesh) for leaf in kinds)
        time += _contacts(scene) * (SAMPLED if sampled else CONTACT)
    averages = not isinstance(scene.scheme.density, ParticleDensity)
    if averages and any(_sweeps(body) for body in scene.bodies):
        cells = sum(body_cells(scene, k) for k in range(len(scene.bodies)))
        time += OPEN_VOLUME * cells / averaging_interval(scene)
    return time


def _contacts(scene: Scene) -> int:
    """Number of points that touch a body at the start."""
    x = np.asarray(scene.points().x, dtype=float)
    if not len(x):
        return 0
    spacing = scene.grid.cell / _per_cell(scene) ** (1.0 / scene.dim)
    distance, _ = distance_from_bodies(scene.grid, scene.bodies)(x)
    return int(np.count_nonzero(distance < 0.75 * spacing))


def _sweeps(body: Body) -> bool:
    """True if the motion of a body changes the space that it takes: not if a round one turns."""
    if not may_move(body):
        return False
    rows, leaves = body.motion.rows(), body.shape.leaves()
    round_ = all(isinstance(leaf, Cylinder | Sphere) for leaf in leaves)
    return bool(body.free) or not (round_ and not np.any(rows[:, 1:4]))
