"""Memory of a run, estimated without building it, and the refusal of too large scenes.

The bytes are from the benchmark `memory`: fits to the largest resident memory of runs that are
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

import numpy as np

from granular.model.fill import Fill
from granular.model.grid import Grid, combined
from granular.model.regions import Cloud, Mask
from granular.model.seeding import estimated_points, is_level_box, most_points
from granular.model.seeding_lattice import AT_ONCE
from granular.mpm.body_distances import distance_from_bodies
from granular.mpm.point_field import SUMMED
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme
from granular.run import memory
from granular.run.memory import BASE, MARGIN, entering, refuse
from granular.tools.arrays import Array
from granular.tools.checks import truth

_CUTS = 29 * 2**20
"""Memory of the parts of SciPy that cut the squares of a seeding lattice, and of the distances from
bodies at the samples of a scene [bytes]: `rotating_drum` has the most of the ready scenes."""

_POINT = {
    2: {"plain": 300, "affine": 270, "cell_averaged": 265, "smoothed": 370},
    3: {"plain": 360, "affine": 410, "cell_averaged": 405, "smoothed": 530},
}
"""Memory of a point [bytes], by dimension and density; with the density of the point
itself by whether its transfer carries gradients of the velocity."""
_POINT_IN_SINGLE = {2: {"affine": 285, "smoothed": 375}, 3: {"affine": 360, "smoothed": 490}}
"""Likewise in single precision, in which the record is as large."""
_CELL = {
    2: {"linear": 600, "ugimp": 780, "quadratic": 650, "cell_averaged": 750, "smoothed": 970},
    3: {"linear": 810, "ugimp": 1490, "quadratic": 1360, "cell_averaged": 1050, "smoothed": 2330},
}
"""Memory of an active cell and of its nodes [bytes]: one with points, or next to one; by density,
with the density of the point itself by the basis."""
_CELL_IN_SINGLE = {2: {"quadratic": 515, "smoothed": 790}, 3: {"quadratic": 990, "smoothed": 1630}}
_SAMPLED = 130
"""Memory of a point that is summed for a sample of the run [bytes]."""
_LITHOSTATIC = 40
"""Further memory of a point of a scene with the pressure of the weight above [bytes]."""
_NEAR_BODIES = 40
"""Further memory of a point of a scene with bodies [bytes]."""
_NONLOCAL_CELL = {2: 240, 3: 300}
"""Further memory of an active cell with a fluidity [bytes]."""
_FACE = 4
"""Memory of a face of a cell of the box [bytes], for a nonlocal law."""
_SITE = {2: 115, 3: 175}
"""Memory of a square of the seeding lattice about a region [bytes], of those that are seeded at
once: that of a block, a disc and layers on slopes, of which it fills 1 to 100 %. About bodies it is
twice as much."""

_GROWTH = {2: 440, 3: 560}
"""Memory of a point [bytes] in the larger buffers to which it moves, and of new cells: the largest
increase of memory when the buffers of 216,000 to 250,000 points that fly apart first grow, with the
default scheme."""

SAMPLES = 400
"""Number of cells of a fill whose neighbourhood is sampled, and the largest number of tries per
cell."""
TRIES = 50
MOST_RATIO = 2.0
"""Active cells of a fill to those with points, where this is not known yet: six layers of cells
have 1.4 to 1.8."""


def size(scene: Scene, share: float = 1.0) -> tuple[int, float]:
    """Number of points at the end, and the memory that a share of them needs [bytes]."""
    distance = distance_from_bodies(scene.grid, scene.bodies)
    counts = [estimated_points(scene.grid, fill, distance) for fill in scene.fills]
    ratios = [active_ratio(scene.grid, fill) for fill in scene.fills]
    later = entering(scene, scene.inflows)
    ratios += [MOST_RATIO] * len(later)
    return sum(counts) + sum(later), _memory(scene, counts + later, ratios, share)


def growth(scene: Scene, points: int) -> float:
    """Further memory while the buffers of so many points grow [bytes]."""
    return points * _GROWTH[scene.dim]


def check(scene: Scene, force: bool, share: float = 1.0, of_device: float | None = None) -> None:
    """Refuse a scene that needs more memory than the machine has, unless `force` is set.

    Parameters
    ----------
    share : float
        Share of the points that this machine has; it seeds all of them in any case.
    of_device : float, optional
        Memory of the device that makes the steps [bytes], if it is not that of the machine.

    Raises
    ------
    ValueError
        See `granular.run.memory.refuse`.
    """
    if truth("force", force):
        return
    # If there is memory for all squares of the seeding lattices, the open ones need no count.
    counts = [most_points(scene.grid, fill) for fill in scene.fills]
    counts += entering(scene, scene.inflows)
    available = memory.available_memory()
    if of_device is not None:
        available = min(available, of_device)
    if _memory(scene, counts, [MOST_RATIO] * len(counts), share) > available:
        refuse(scene, *size(scene, share), available)


def _memory(scene: Scene, counts: Sequence[int], ratios: Sequence[float], share: float) -> float:
    """Memory of a share of so many points and active cells from the sources [bytes]."""
    point, cell = _bytes(scene.scheme, scene.dim)
    point += _LITHOSTATIC * any(fill.lithostatic for fill in scene.fills)
    point += _NEAR_BODIES * bool(scene.bodies)
    running = _SAMPLED * min(share * sum(counts), SUMMED)
    if scene.nonlocal_material is not None:
        cell += _NONLOCAL_CELL[scene.dim]
        running += _FACE * 2 * scene.dim * math.prod(scene.grid.shape)
    for source, count, ratio in zip(scene.sources, counts, ratios, strict=True):
        running += share * count * (point + cell * ratio / source.points_per_cell)
    squares = max((_squares(scene.grid, fill) for fill in scene.fills), default=0.0)
    seeding = min(squares, AT_ONCE)
    seeding *= _SITE[scene.dim] * (2 if scene.bodies else 1)
    cuts = bool(scene.bodies) or any(_is_cut(fill) for fill in scene.fills)
    return MARGIN * (BASE + _CUTS * cuts + max(running, seeding))


def _is_cut(fill: Fill) -> bool:
    """True for a region whose boundary cuts the squares of a seeding lattice."""
    return not isinstance(fill.region, (Cloud, Mask)) and not is_level_box(fill.region)


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
    included, of which k_j of the cells about j have points. A cell is tested at one position in it,
    the same for all cells about c.
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


def _samples(grid: Grid, fill: Fill) -> Array:
    """Positions in a region, uniformly distributed over its parts."""
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
