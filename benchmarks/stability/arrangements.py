"""Largest stable time step of an arrangement of points, from the eigenvalues of M^-1 K."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

import granular as gr
from stability.cells import Map

NU = 0.3
LAME = NU / (1 - NU)
"""lambda/(lambda + 2 G). The unit of moduli is the one of compression waves, so that c = dx = 1."""
SHEAR = (1 - LAME) / 2
LIGHTEST = 1e-14
"""Mass cutoff of the schemes, in point masses."""


def linear(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear shape function: weight and slope at the distance s [cells] from a node."""
    inside = abs(s) < 1
    return np.where(inside, 1 - abs(s), 0.0), np.where(inside, -np.sign(s), 0.0)


def spline(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quadratic B-spline: weight and slope at the distance s [cells] from a node."""
    a = abs(s)
    near, far = a < 0.5, (a >= 0.5) & (a < 1.5)
    weight = np.where(near, 0.75 - s * s, np.where(far, (1.5 - a) ** 2 / 2, 0.0))
    return weight, np.where(near, -2 * s, np.where(far, -np.sign(s) * (1.5 - a), 0.0))


def averaged_linear(half: float) -> Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Linear shape function averaged over a point of half-width `half` [cells] (uGIMP)."""

    def integral(s: np.ndarray) -> np.ndarray:
        t = np.clip(s, -1.0, 1.0)
        return t - np.sign(t) * t * t / 2

    def shape(s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        weight = (integral(s + half) - integral(s - half)) / (2 * half)
        return weight, (linear(s + half)[0] - linear(s - half)[0]) / (2 * half)

    return shape


def largest_eigenvalue(
    x: np.ndarray,
    shape: Callable,
    cells: int,
    volume: float,
    weight_correction: np.ndarray | None = None,
) -> float:
    """Largest eigenvalue of M^-1 K for points at x (n, dim).

    The points are in a box of some cells with two empty cells around it. `weight_correction` is the
    largest fraction of its volume by which each point counts more in the force; its local mean is
    subtracted, as in an averaging step.
    """
    n, dim = x.shape
    nodes = cells + 5
    where = np.arange(nodes) - 2.0
    along = [shape(x[:, d, None] - where) for d in range(dim)]  # (n, nodes) each

    def tensor(kinds: list[int]) -> np.ndarray:
        parts = [along[d][kind] for d, kind in enumerate(kinds)]
        out = parts[0]
        for part in parts[1:]:
            out = (out[:, :, None] * part[:, None, :]).reshape(n, -1)
        return out

    weight = tensor([0] * dim)
    slope = [tensor([int(d == axis) for d in range(dim)]) for axis in range(dim)]
    mass = volume * weight.sum(axis=0)
    used = mass > LIGHTEST * volume
    B = [g[:, used] for g in slope]
    if weight_correction is not None:
        share = weight[:, used]
        excess = weight_correction - share @ (weight_correction @ share / share.sum(axis=0))
        most = abs(weight_correction).max()
        stiffer = np.sqrt(1 + np.clip(excess, -most, most))
        B = [stiffer[:, None] * g for g in B]
    shear = sum(volume * SHEAR * g.T @ g for g in B)
    blocks = [[None] * dim for _ in range(dim)]
    for a, b in product(range(dim), repeat=2):
        blocks[a][b] = volume * (LAME * B[a].T @ B[b] + SHEAR * B[b].T @ B[a])
        if a == b:
            blocks[a][b] = blocks[a][b] + shear
    root = np.tile(1 / np.sqrt(mass[used]), dim)
    K = np.block(blocks) * root[:, None] * root[None, :]
    return float(np.linalg.eigvalsh(K)[-1])


def smallest_step(
    basis: str, dim: int, per_axis: int, tries: int, limit: float = 0.0
) -> tuple[float, dict]:
    """Smallest c dt/dx = 2/sqrt(lambda_max) over random, shifted and isolated arrangements.

    The quadrature weights of the points are 1 + limit or 1 - limit at random.
    """
    shape = {"linear": linear, "quadratic": spline, "ugimp": averaged_linear(0.5 / per_axis)}[basis]
    rng = np.random.default_rng(3)
    cells = 4 if dim == 1 else 2
    steps = []
    for i in range(tries):
        if i % 3 == 0:  # anywhere
            x = rng.uniform(0, cells, (per_axis**dim * cells**dim, dim))
        else:  # a jittered, shifted seeding lattice; every second one with an isolated point
            line = (np.arange(per_axis * cells) + 0.5) / per_axis
            x = np.stack(np.meshgrid(*[line] * dim), -1).reshape(-1, dim)
            x = x + rng.uniform(-0.5, 0.5, x.shape) / per_axis + rng.uniform(0, 1, dim)
            if i % 3 == 2:
                x = np.vstack([x, rng.uniform(0, cells + 1, dim)])
        x = np.clip(x, 0.0, cells + 1.0 - 1e-9)
        weight_correction = limit * rng.choice([-1.0, 1.0], len(x)) if limit else None
        largest = largest_eigenvalue(x, shape, cells + 1, per_axis**-dim, weight_correction)
        steps.append(2 / np.sqrt(largest))
    return float(min(steps)), {"1 %": float(np.quantile(steps, 0.01)), "tries": tries}


def arrangements(quick: bool) -> Map:
    """Time step against arrangement; any larger step creates energy, whatever the motion."""
    result = Map(
        "arrangement",
        "Time step of the worst arrangement of points",
        "smallest 2/sqrt(lambda_max(M^-1 K)) c/dx",
        "basis",
        "dimension, points per cell",
        0.5,
        least=True,
    )
    rows = {basis: (basis, 0.0) for basis in ("linear", "ugimp", "quadratic")}
    rows["quadratic, weighted"] = "quadratic", gr.schemes.default.density.weight_correction_limit
    for row, (basis, limit) in rows.items():
        for dim in (1, 2, 3):
            for per_axis in (1, 2) if quick or dim == 3 else (1, 2, 3):
                tries = (60, 60, 6)[dim - 1] if quick else (3000, 600, 150)[dim - 1]
                column = f"{dim}-D, {per_axis**dim}"
                result.add(row, column, smallest_step, basis, dim, per_axis, tries, limit)
    return result
