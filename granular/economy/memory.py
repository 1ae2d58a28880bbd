"""Memory of a run, estimated before anything is built, and the refusal of too large scenes.

The bytes are those of `benchmarks/memory.py`: fits to the largest resident memory of runs that are
recorded, of 230,000 to 430,000 points with 1 to 16 points per cell in 2D and 1 to 27 in 3D. Blocks,
thin layers, discs, material about a body or under its weight, jittered or with another law take
0.90 to 1.1 times as much as the fit; hence the `MARGIN`. With it an estimate is 1.03 to 1.25 times
the peak of 84 such runs of 20,000 to 1,000,000 points, and 1.1 to 1.35 times that of steps without
a record, in single precision to 1.65.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granular.economy import machine
from granular.geometry import Fill, Grid, combined
from granular.inflow import Inflow, points_between, standing_points
from granular.mpm.body_distances import distance_from_bodies
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.regions import Cloud
from granular.seeding import estimated_points, most_points
from granular.surfaces import Layer

if TYPE_CHECKING:
    from granular.sph.scene import Scene as SphScene
    from granular.typing import AnyScene

MARGIN = 1.12
"""Factor by which an estimate exceeds the fits, which a peak exceeded by 1.1 at most."""

_BASE = 105 * 2**20
"""Memory of the interpreter and the package [bytes]."""
_BODIES = 15 * 2**20
"""Memory of the distances from bodies at the samples of a scene [bytes]."""

_LAYER = {2: 0, 3: 65 * 2**20}
"""Memory of the squares of the seeding lattice that a layer cuts, of which a number are integrated
at a time [bytes]."""

_POINT = {
    2: {"plain": 300, "affine": 370, "cell_averaged": 365, "smoothed": 470},
    3: {"plain": 360, "affine": 510, "cell_averaged": 505, "smoothed": 630},
}
"""Memory of a point with its record [bytes], by dimension and density; with the density of the
point itself by whether its transfer carries gradients of the velocity."""
_POINT_IN_SINGLE = {2: {"affine": 385, "smoothed": 475}, 3: {"affine": 460, "smoothed": 590}}
"""Likewise in single precision, in which the record that is written counts as much."""
_CELL = {
    2: {"linear": 495, "ugimp": 910, "quadratic": 780, "cell_averaged": 685, "smoothed": 1340},
    3: {"linear": 960, "ugimp": 2410, "quadratic": 2400, "cell_averaged": 1145, "smoothed": 4010},
}
"""Memory of an active cell and of its nodes [bytes]: one with points, or next to one; by density,
with the density of the point itself by the basis."""
_CELL_IN_SINGLE = {2: {"quadratic": 565, "smoothed": 955}, 3: {"quadratic": 1630, "smoothed": 2600}}
_NONLOCAL_CELL = {2: 240, 3: 300}
"""Further memory of an active cell with a fluidity [bytes]."""
_FACE = 4
"""Memory of a face of a cell of the box [bytes], for a nonlocal law."""
_SITE = {2: 115, 3: 175}
"""Memory of a square of the seeding lattice about a region [bytes]: that of a block, a disc and
layers on slopes, of which it fills 1 to 100 %. About bodies it is twice as much."""

_GROWTH = {2: 440, 3: 560}
"""Memory of a point [bytes] in the larger buffers to which it moves from those it is in, and of new
cells: what 216,000 to 250,000 points that fly apart take at most beyond the memory at the
start when their buffers first grow, with the default scheme."""

_SPH = {2: (745, 480), 3: (1150, 850)}
"""Memory of a particle of SPH with its neighbours [bytes], of the material and of a wall, by
dimension: fits to recorded layers of 40,000 to 200,000 particles on floors of 10,000 to 112,000."""
_SPH_WITH_GAS = 1.3
"""The same for all particles of a scene with a gas, relative to those of one without."""

SAMPLES = 400
"""Cells of a fill whose neighbourhood is looked at, and the largest number of tries per cell."""
TRIES = 50
MOST_RATIO = 2.0
"""Active cells of a fill to those with points, where this is not known yet: six layers of cells
have 1.4 to 1.8."""


def size(scene: AnyScene) -> tuple[int, float]:
    """Number of points at the end, and the memory that they need [bytes]."""
    if not isinstance(scene, Scene):
        return _sph_size(scene)
    distance = distance_from_bodies(scene)
    counts = [estimated_points(scene.grid, fill, distance) for fill in scene.fills]
    ratios = [active_ratio(scene.grid, fill) for fill in scene.fills]
    entering_ones = entering(scene)
    ratios += [MOST_RATIO] * len(entering_ones)
    return sum(counts) + sum(entering_ones), _memory(scene, counts + entering_ones, ratios)


def growth(scene: AnyScene, points: int) -> float:
    """Further memory while the buffers of so many points grow [bytes]; those of SPH do not."""
    return points * _GROWTH[scene.dim] if isinstance(scene, Scene) else 0.0


def fed_by(scene: AnyScene) -> list[Inflow]:
    """Inflows of the material, and of the gas of a scene."""
    if isinstance(scene, Scene):
        return list(scene.inflows)
    return [*scene.inflows, *(inflow for inflow, _ in scene.gas_inflows())]


def entering(scene: AnyScene) -> list[int]:
    """Numbers of points that inflows bring, at the start and in the run."""
    return [
        points_between(inflow, scene.grid, 0.0, scene.duration)
        + (len(standing_points(scene, i).x) if inflow.driven and i < len(scene.inflows) else 0)
        for i, inflow in enumerate(fed_by(scene))
    ]


def _memory(scene: Scene, counts: Sequence[int], ratios: Sequence[float]) -> float:
    """Memory of a scene with so many points and active cells from its sources [bytes]."""
    point, cell = _bytes(scene.scheme, scene.dim)
    running = 0.0
    if scene.nonlocal_material is not None:
        cell += _NONLOCAL_CELL[scene.dim]
        running += _FACE * 2 * scene.dim * math.prod(scene.grid.shape)
    for source, count, ratio in zip(scene.sources, counts, ratios, strict=True):
        running += count * (point + cell * ratio / source.points_per_cell)
    seeding = max((_squares(scene.grid, fill) for fill in scene.fills), default=0.0)
    seeding *= _SITE[scene.dim] * (2 if scene.bodies else 1)
    layers = any(isinstance(fill.region, Layer) for fill in scene.fills)
    seeding += _LAYER[scene.dim] * layers
    return MARGIN * (_BASE + (_BODIES if scene.bodies else 0) + max(running, seeding))


def _bytes(scheme: Scheme, dim: int) -> tuple[int, int]:
    """Memory of a point and of an active cell with a scheme [bytes]."""
    density, basis = scheme.density.name, scheme.basis
    affine = "affine" if scheme.transfer in ("apic", "tpic") else "plain"
    of_point = affine if density == "particle" else density
    of_cell = basis if density == "particle" else density
    if scheme.precision == "single":
        return _POINT_IN_SINGLE[dim][of_point], _CELL_IN_SINGLE[dim][of_cell]
    return _POINT[dim][of_point], _CELL[dim][of_cell]


def _squares(grid: Grid, fill: Fill) -> float:
    """Number of squares of the seeding lattice in the box around a region."""
    if isinstance(fill.region, Cloud):
        return float(len(fill.region.x))
    lower, upper = np.array(fill.region.bounds)
    spacing = grid.cell / fill.points_per_axis
    return float(np.prod(np.ceil((upper - lower) / spacing) + 2))


# ---- active cells ----


def active_ratio(grid: Grid, fill: Fill) -> float:
    """Number of active cells of a fill, those with points or next to one, to that with points.

    It is the mean over cells c with points of ``sum_j 1/k_j`` over the cells j about c, itself
    included, of which k_j of the cells about j have points. Where a cell has points is tried at one
    place in it, the same for all cells about c.
    """
    places = _samples(grid, fill)
    if not len(places):
        return MOST_RATIO
    dim, ring = grid.dim, np.array(list(product(range(-2, 3), repeat=grid.dim)))
    around = places[:, None] + grid.cell * ring
    inside = fill.region.contains(around.reshape(-1, dim)).reshape(len(places), -1)
    inside[:, len(ring) // 2] = True
    counts = inside.astype(float).reshape(len(places), *(5,) * dim)
    for axis in range(1, dim + 1):  # sums over three cells along each axis
        first, second, third = (np.take(counts, range(k, k + 3), axis) for k in range(3))
        counts = first + second + third
    near = np.array(list(product(range(-1, 2), repeat=dim)))
    cells = places[:, None] + grid.cell * near
    exists = np.ones(cells.shape[:2], dtype=bool)
    for axis, (low, n) in enumerate(zip(grid.lower, grid.shape, strict=True)):
        if not grid.periodic[axis]:
            exists &= (cells[..., axis] >= low) & (cells[..., axis] < low + n * grid.cell)
    shares = exists / np.maximum(counts.reshape(len(places), -1), 1.0)
    return float(shares.sum(axis=1).mean())


def _samples(grid: Grid, fill: Fill) -> NDArray[np.float64]:
    """Places in a region, of which each part has as many as it is large."""
    rng = np.random.default_rng(0)
    if isinstance(fill.region, Cloud):
        x = fill.region.x
        return x[rng.choice(len(x), SAMPLES)]
    lower, upper = np.array(fill.region.bounds)
    parts = math.ceil((SAMPLES * TRIES) ** (1.0 / grid.dim))
    edge = (upper - lower) / parts
    x = combined([low + h * np.arange(parts) for low, h in zip(lower, edge, strict=True)])
    x = x + rng.uniform(0.0, 1.0, x.shape) * edge
    x = x[fill.region.contains(x)]
    return x[rng.permutation(len(x))[:SAMPLES]]


# ---- SPH ----


def _sph_size(scene: SphScene) -> tuple[int, float]:
    gas = () if scene.gas is None else scene.gas.fills
    counts = [estimated_points(scene.grid, fill, even=True) for fill in (*scene.fills, *gas)]
    points = sum(counts) + sum(entering(scene))
    of_material, of_wall = _SPH[scene.dim]
    particles = points * of_material + _wall_particles(scene) * of_wall
    return points, MARGIN * (_BASE + particles * (1.0 if scene.gas is None else _SPH_WITH_GAS))


def _wall_particles(scene: SphScene) -> int:
    """Number of particles of the walls; where walls meet they count twice."""
    sites = (wall.sites(f"walls[{i}]", scene.grid) for i, wall in enumerate(scene.walls))
    return sum(math.prod(last - first for first, last in ends) for ends in sites)


# ---- the check ----


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
        counts = [most_points(scene.grid, fill) for fill in scene.fills] + entering(scene)
        if _memory(scene, counts, [MOST_RATIO] * len(counts)) <= available:
            return
    points, memory = size(scene)
    if memory <= available:
        return
    cells = " x ".join(map(str, scene.grid.shape))
    raise ValueError(
        f"scene {scene.name!r} with about {points:.3g} points in {cells} cells needs about "
        f"{gigabytes(memory)} of memory, must be at most the {gigabytes(available)} that are "
        "available: take larger cells or fewer points per cell, or force=True"
    )


def gigabytes(memory: float) -> str:
    return f"{memory / 2**30:.2g} GB"
