"""Packings with known contact forces in exact balance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import lsqr

from granular.grain_scale.inference import Packing
from granular.papers.hurley_thesis.grains import Grains, Table, layered_positions, volumes
from granular.tools.arrays import Array

TOP, BOTTOM = -4, -3
"""Numbers of the upper wall in 2D, which carries the load, and of the lower one."""
SEEDS = (0, 1, 2, 3, 5, 6, 7, 8, 9, 10)
"""Seeds of the oedometric tests; 4 settles slowly."""


@dataclass(frozen=True)
class Case:
    """A packing and its contact forces [N, in 2D N/m]."""

    packing: Packing
    forces: Array


# ---- exact balance ----


def sums(table: Table, centroids: Array) -> tuple[csr_array, csr_array]:
    """Sparse matrices of force and moment sums and of sym(f x), row by row for each grain."""
    dim = centroids.shape[1]
    rows, columns, values = [], [], []
    planes = [(0, 1)] if dim == 2 else [(1, 2), (2, 0), (0, 1)]
    moments = dim + len(planes)
    size = moments + dim + len(planes)
    for c, pair in enumerate(table["bodies"]):
        for p, sign in zip(pair, (1.0, -1.0), strict=True):
            if p < 0:
                continue
            x = sign * (table["positions"][c] - centroids[p])
            entries = [(a, a, sign) for a in range(dim)]
            for k, (a, b) in enumerate(planes):
                entries += [(dim + k, b, x[a]), (dim + k, a, -x[b])]
            entries += [(moments + a, a, x[a]) for a in range(dim)]
            for k, (a, b) in enumerate(planes):
                entries += [(moments + dim + k, a, x[b]), (moments + dim + k, b, x[a])]
            for row, column, value in entries:
                rows.append(size * p + row)
                columns.append(dim * c + column)
                values.append(value)
    shape = (size * len(centroids), dim * len(table["bodies"]))
    matrix = csr_array((values, (rows, columns)), shape)
    which = np.arange(shape[0]) % size
    return matrix[which < moments], matrix[which >= moments]


def balanced(table: Table, centroids: Array, scale: float) -> Array:
    """Contact forces in exact equilibrium that are nearest to those of grains still in motion."""
    balance, _ = sums(table, centroids)
    dim = centroids.shape[1]
    size = balance.shape[0] // len(centroids)
    weights = np.where(np.arange(balance.shape[0]) % size < dim, 1.0, 1 / scale)
    scaled = csr_array(balance * weights[:, None])
    f = table["forces"].ravel()
    # Two passes: the first leaves an error of the size of the solver tolerance.
    for _ in range(2):
        f = f - lsqr(scaled, scaled @ f, atol=1e-15, btol=1e-15, iter_lim=20 * len(f))[0]
    return f.reshape(-1, dim)


def average_stresses(table: Table, centroids: Array, volume: Array) -> Array:
    """Stress of each grain, shape (n, dim, dim): the sum of sym(f x)/V over its contacts."""
    dim = centroids.shape[1]
    stresses = np.zeros((len(centroids), dim, dim))
    for (p, q), at, f in zip(table["bodies"], table["positions"], table["forces"], strict=True):
        for body, force in ((p, f), (q, -f)):
            if body >= 0:
                outer = np.outer(force, at - centroids[body])
                stresses[body] += (outer + outer.T) / (2 * volume[body])
    return stresses


def case_from(table: Table, centroids: Array, R: Array, **motion: Any) -> Case:
    """Case of contacts with the stresses that their forces make."""
    forces, volume = table["forces"], volumes(R, centroids.shape[1])
    packing = Packing(
        bodies=table["bodies"],
        positions=table["positions"],
        normals=table["normals"],
        centroids=centroids,
        volumes=volume,
        stresses=average_stresses(table, centroids, volume),
        **motion,
    )
    return Case(packing, forces)


def balanced_case(table: Table, centroids: Array, R: Array) -> Case:
    """Case of contacts whose forces are approximately balanced."""
    return case_from(table | {"forces": balanced(table, centroids, R.mean())}, centroids, R)


def case_of(grains: Grains, box: int | None = None) -> Case:
    """Case at rest: relaxed forces, corrected to exact equilibrium, and the resulting stresses."""
    table, dim = grains.contacts(box), grains.dim
    mine = slice(None) if box is None else grains.box == box
    return balanced_case(table, grains.x[mine, :dim], grains.R[mine])


def admissible(case: Case, mu: float) -> bool:
    """True if all contacts push and none slips."""
    normals, f = case.packing.normals, case.forces
    push = -(f * normals).sum(axis=1)
    slip = np.linalg.norm(f + push[:, None] * normals, axis=1)
    return bool((push > 0).all() and (slip <= mu * push).all())


# ---- oedometric tests ----


def oedometers(
    seeds: Sequence[int],
    *,
    dim: int = 2,
    n: int = 58,
    width: float = 0.039,
    pressure: float = 30e3,
    free: int = 5000,
    damped: int = 4000,
    mu: float = 0.5,
    shift: float = 0.0,
) -> Grains:
    """Grains of 2.5 mm to 4 mm compressed in boxes by free-slip pistons, one box for each seed.

    Parameters
    ----------
    n : int
        Number of grains in a box.
    width, pressure : float
        Width of a box [m], and pressure on its piston [Pa].
    free, damped : int
        Number of steps with little drag and with much.
    mu : float
        Friction of contacts.
    shift : float
        Displacement of all grains at the start along the first axis [m].
    """
    starts, radii, boxes = [], [], []
    across = (int(width / 7.8e-3),) * (dim - 1)
    for k, seed in enumerate(seeds):
        rng = np.random.default_rng(seed)
        x = layered_positions(n, across, width / across[0], dim, rng)
        x[:, 0] += 10 * width * k
        starts.append(x)
        radii.append(rng.uniform(2.5e-3, 4e-3, n))
        boxes.append(np.full(n, k))
    x, R, box = np.concatenate(starts), np.concatenate(radii), np.concatenate(boxes)
    m = 2000 * volumes(R, dim)
    lower, upper = np.zeros((len(x), dim)), np.full((len(x), dim), width)
    lower[:, 0], upper[:, 0] = 10 * width * box, 10 * width * box + width
    upper[:, -1] = x[:, -1].max() + 5e-3
    x[:, 0] += shift
    load = pressure * width ** (dim - 1)
    kn = 2000 * load / width  # the overlap is some thousandths of a radius
    grains = Grains(
        x, R, m, lower, upper, dim=dim, kn=kn, kt=kn, mu=0.98 * mu, load=load, box=box,
        dt=0.2 * np.sqrt(m.min() / kn),
    )  # fmt: skip
    rng = np.random.default_rng(len(seeds))
    grains.v[:, :dim] = rng.normal(0, 0.3, x.shape)
    beat = np.sqrt(np.median(m) / kn)
    for drag, steps in ((0.001, free), (0.03, damped)):
        grains.drag = drag / beat
        grains.step(steps)
    return grains


def settled(grains: Grains, boxes: Iterable[int], mu: float = 0.5, rounds: int = 30) -> list[Case]:
    """Cases of several boxes, stepped on until the forces are admissible in all of them."""
    boxes = list(boxes)
    for _ in range(rounds):
        cases = [case_of(grains, box) for box in boxes]
        if all(admissible(case, mu) for case in cases):
            return cases
        grains.step(400)
    raise RuntimeError(f"grains still move: unbalance {grains.unbalance():.1e}")


@cache
def pressed_discs(count: int = 10, shift: float = 0.0) -> list[Case]:
    """Ten oedometric tests of section 2.4, or fewer: 58 discs, with other radii in each."""
    seeds = SEEDS[:count]
    return settled(oedometers(seeds, shift=shift), range(len(seeds)))


@cache
def pressed_spheres(n: int = 40, seed: int = 0, shift: float = 0.0) -> Case:
    """Spheres compressed in a box, with 9 in a layer, or 16 if there are more than 60.

    Raises
    ------
    RuntimeError
        If they do not come to rest.
    """
    width, damped = (0.026, 1500) if n <= 60 else (0.032, 3000)
    grains = oedometers(
        [seed], dim=3, n=n, width=width, free=12000, damped=damped, shift=shift
    )  # fmt: skip
    return settled(grains, [0])[0]


# ---- regular arrays of any size ----


def jittered_grid(shape: tuple[int, ...], *, shake: float = 0.05, seed: int = 0) -> Case:
    """Grains on a square or cubic grid with random offsets and similar pushes; any number of
    grains.

    The outermost layers are walls. Contacts lie halfway between centroids.
    """
    rng, dim = np.random.default_rng(seed), len(shape)
    sites = np.stack(np.meshgrid(*[np.arange(k) for k in shape], indexing="ij"), axis=-1)
    index = np.arange(np.prod(shape)).reshape(shape)
    border = np.any([(sites[..., a] == 0) | (sites[..., a] == shape[a] - 1) for a in range(dim)], 0)
    number = np.where(border.ravel(), -1, np.cumsum(~border.ravel()) - 1)
    x = sites.reshape(-1, dim) + rng.uniform(-shake, shake, (index.size, dim))
    pairs = np.concatenate(
        [
            np.stack([np.delete(index, -1, a).ravel(), np.delete(index, 0, a).ravel()], axis=1)
            for a in range(dim)
        ]
    )
    pairs = pairs[(number[pairs] >= 0).any(axis=1)]
    away = x[pairs[:, 1]] - x[pairs[:, 0]]
    normals = away / np.linalg.norm(away, axis=1)[:, None]
    push = rng.uniform(0.7, 1.3, len(pairs))
    table = {
        "bodies": number[pairs],
        "positions": x[pairs].mean(axis=1),
        "normals": normals,
        "forces": -push[:, None] * normals,
    }
    centroids = x[number >= 0]
    return balanced_case(table, centroids, np.full(len(centroids), 0.5))
