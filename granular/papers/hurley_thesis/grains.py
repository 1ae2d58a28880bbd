"""Plain discrete element method for discs and spheres, whose contact forces are known.

It makes the data of the figures of chapters 2 and 3, and is the reference of the tests of
`granular.grain_scale.inference`. Contacts have linear springs (the tangential one with memory and a
Coulomb limit), walls are free-slip, and several boxes are stored side by side in the same arrays.
All vectors have three components; in 2D the third stays zero.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from granular.tools.arrays import Array, BoolArray, IndexArray

Table = dict[str, Any]
"""Arrays of contacts: bodies, positions, normals, forces on the first body."""


def cross(a: Array, b: Array) -> Array:
    """Cross products of rows; faster than `numpy.cross`."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def volumes(R: Array, dim: int) -> Array:
    """Areas of discs or volumes of spheres."""
    return np.pi * R**2 if dim == 2 else 4 / 3 * np.pi * R**3


def layered_positions(
    n: int, across: tuple[int, ...], spacing: float, dim: int, rng: np.random.Generator
) -> Array:
    """n positions with random offsets, in layers of across[0] (x across[1]) points at a spacing."""
    positions = np.zeros((n, dim))
    rest = np.arange(n)
    for axis, count in enumerate(across):
        positions[:, axis] = rest % count + 0.5
        rest = rest // count
    positions[:, dim - 1] = rest + 0.5
    return spacing * (positions + rng.uniform(-0.08, 0.08, positions.shape))


class Grains:
    """Grains, each in a box of walls; with `load` the upper walls of the last axis are pistons.

    Walls are numbered -1 - 2 axis (lower) and -2 - 2 axis (upper); infinite walls are absent.
    Masses are per unit depth in 2D.

    Parameters
    ----------
    x, R, m : ndarray
        Centroids [m], radii [m], masses [kg].
    lower, upper : array_like
        Positions of the walls of each grain [m].
    dim : int
    kn, kt, mu : float
        Stiffnesses [N/m] and friction of contacts.
    dt : float
        Time step [s].
    damping : float
        Share of the critical damping of a contact.
    drag : float
        Rate at which velocities decay [1/s].
    load : float
        Force on each piston [N]; 0 for fixed walls.
    gravity : float
        Its magnitude [m/s2].
    box : ndarray of int, optional
        Number of the box of each grain.
    """

    def __init__(
        self,
        x: Array,
        R: Array,
        m: Array,
        lower: ArrayLike,
        upper: ArrayLike,
        *,
        dim: int,
        kn: float,
        kt: float,
        mu: float,
        dt: float,
        damping: float = 0.3,
        drag: float = 0.0,
        load: float = 0.0,
        gravity: float = 0.0,
        box: IndexArray | None = None,
    ) -> None:
        n = len(x)
        self.x, self.R, self.m, self.dim = np.zeros((n, 3)), R, m, dim
        self.x[:, :dim] = x
        self.lower, self.upper = np.full((n, 3), -np.inf), np.full((n, 3), np.inf)
        self.lower[:, :dim], self.upper[:, :dim] = lower, upper
        self.kn, self.kt, self.mu, self.dt = kn, kt, mu, dt
        self.dashpot = damping * 2 * np.sqrt(np.median(m) / 2 * kn)
        self.drag, self.load = drag, load
        self.gravity = np.zeros(3)
        self.gravity[dim - 1] = -gravity
        self.box = np.zeros(n, int) if box is None else box
        self.inertia = (0.5 if dim == 2 else 0.4) * m * R**2
        self.v, self.w = np.zeros((n, 3)), np.zeros((n, 3))
        self.piston_v = np.zeros(self.box.max() + 1)
        self.piston_m = np.bincount(self.box, m) / 2
        self.pairs, self.history = np.zeros((0, 2), int), np.zeros((0, 3))
        self.skin = 0.3 * R.min()
        self.search()

    def search(self) -> None:
        """Find the pairs that may soon touch; pairs in contact keep the memory of their springs."""
        n = len(self.x)
        largest = np.sort(self.R)[-1] + np.sort(self.R)[-min(n, 2)]
        pairs = cKDTree(self.x).query_pairs(largest + self.skin, output_type="ndarray")
        gap = np.linalg.norm(self.x[pairs[:, 0]] - self.x[pairs[:, 1]], axis=1)
        pairs = pairs[gap < self.R[pairs].sum(axis=1) + self.skin]
        old, memory = self.pairs @ [n, 1], self.history
        self.pairs = pairs[np.lexsort(pairs.T[::-1])]
        self.history = np.zeros((len(pairs), 3))
        _, new, before = np.intersect1d(self.pairs @ [n, 1], old, return_indices=True)
        self.history[new] = memory[before]
        entries = (self.pairs.T.ravel(), np.tile(np.arange(len(pairs)), 2))
        signs = np.repeat([1.0, -1.0], len(pairs))
        self.act = csr_array((signs, entries), (n, len(pairs)))
        self.searched_at = self.x.copy()

    def pair_forces(self, dt: float) -> tuple[Array, Array, Array, Array, BoolArray]:
        """Normals, arms and forces on the first grain of each pair; springs advance by `dt`."""
        i, j = self.pairs.T
        apart = self.x[j] - self.x[i]
        far = np.sqrt((apart**2).sum(axis=1))
        normal = apart / far[:, None]
        overlap = self.R[i] + self.R[j] - far
        touching = overlap > 0
        arm_i, arm_j = self.R[i] - overlap / 2, self.R[j] - overlap / 2
        spin = arm_i[:, None] * self.w[i] + arm_j[:, None] * self.w[j]
        v = self.v[i] - self.v[j] + cross(spin, normal)
        closing = (v * normal).sum(axis=1)
        push = np.maximum(self.kn * overlap + self.dashpot * closing, 0) * touching
        h = self.history + dt * (v - closing[:, None] * normal)
        h = (h - (h * normal).sum(axis=1)[:, None] * normal) * touching[:, None]
        stretch = self.kt * np.sqrt((h**2).sum(axis=1))
        h *= np.minimum(1, self.mu * push / np.maximum(stretch, 1e-300))[:, None]
        self.history = h
        return normal, arm_i, arm_j, -push[:, None] * normal - self.kt * h, touching

    def wall_forces(self) -> tuple[Array, Array]:
        """Penetration and outward push of each grain at lower and upper walls, shape (2, n, 3)."""
        R = self.R[:, None]
        depth = np.stack([self.lower + R - self.x, self.x + R - self.upper])
        speed = np.stack([-self.v, self.v])
        speed[1, :, self.dim - 1] -= self.piston_v[self.box]
        push = self.kn * depth + self.dashpot * speed
        return depth, np.where(depth > 0, np.maximum(push, 0), 0)

    def total(self, dt: float) -> tuple[Array, Array, Array]:
        """Forces and torques on the grains, and the push on each piston."""
        normal, arm_i, arm_j, f, _ = self.pair_forces(dt)
        _, push = self.wall_forces()
        force = self.act @ f + push[0] - push[1] + self.m[:, None] * self.gravity
        # The force on i and its reaction on j give the same torque: arm times normal x force.
        turn = cross(normal, f)
        i, j = self.pairs.T
        n = len(self.x)
        torque = np.stack(
            [
                np.bincount(i, arm_i * turn[:, k], n) + np.bincount(j, arm_j * turn[:, k], n)
                for k in range(3)
            ],
            axis=1,
        )
        lift = np.bincount(self.box, push[1, :, self.dim - 1])
        return force, torque, lift.astype(float)

    def step(self, steps: int) -> None:
        """Advance by a number of steps (semi-implicit Euler)."""
        fade = np.exp(-self.drag * self.dt)
        up = self.dim - 1
        for _ in range(steps):
            if np.abs(self.x - self.searched_at).max() > self.skin / 4:
                self.search()
            force, torque, lift = self.total(self.dt)
            self.v = fade * (self.v + self.dt * force / self.m[:, None])
            self.w = fade * (self.w + self.dt * torque / self.inertia[:, None])
            self.x = self.x + self.dt * self.v
            if self.load:
                self.piston_v = self.piston_v + self.dt * (lift - self.load) / self.piston_m
                self.upper[:, up] += self.dt * self.piston_v[self.box]

    def unbalance(self) -> float:
        """Largest net force on a grain over the largest contact force."""
        force, _, _ = self.total(0.0)
        return float(np.abs(force).max() / np.abs(self.pair_forces(0.0)[3]).max())

    def contacts(self, box: int | None = None) -> Table:
        """Contact arrays of a `Packing` and the contact forces, of all grains or of one box."""
        normal, arm, _, f, touching = self.pair_forces(0.0)
        depth, push = self.wall_forces()
        side, grain, axis = np.nonzero(depth > 0)
        outward = np.zeros((len(grain), 3))
        outward[np.arange(len(grain)), axis] = 2 * side - 1
        i = self.pairs[touching, 0]
        k = np.flatnonzero(touching)
        reach = (self.R[grain] - depth[side, grain, axis])[:, None]
        table = {
            "bodies": np.concatenate(
                [self.pairs[k], np.stack([grain, -1 - 2 * axis - side], axis=1)]
            ),
            "positions": np.concatenate(
                [self.x[i] + arm[k, None] * normal[k], self.x[grain] + reach * outward]
            ),
            "normals": np.concatenate([normal[k], outward]),
            "forces": np.concatenate([f[k], -push[side, grain, axis][:, None] * outward]),
        }
        if box is not None:
            mine = self.box[table["bodies"][:, 0]] == box
            table = {name: array[mine] for name, array in table.items()}
            first = np.flatnonzero(self.box == box)[0]
            table["bodies"] = np.where(
                table["bodies"] >= 0, table["bodies"] - first, table["bodies"]
            )
        flat = {name: array[:, : self.dim] for name, array in table.items()}
        return flat | {"bodies": table["bodies"]}
