"""Plain reference for rigid bodies: distances, and the feet of points on their surfaces."""

from dataclasses import replace

import numpy as np
from oracle_shapes import Shapes
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from granular import Box, Cylinder, Union


def _turn(rotation_deg):
    vector = rotation_deg if np.ndim(rotation_deg) else (0, 0, rotation_deg)
    return Rotation.from_rotvec(np.radians(vector))


def _space(vector):
    return np.array([*vector, 0.0])[:3]


def _box(shape, x):
    y = _turn(shape.rotation_deg).inv().apply(x - _space(shape.center))[: len(shape.size)]
    beyond = np.abs(y) - np.array(shape.size) / 2
    return np.linalg.norm(np.maximum(beyond, 0)) + min(beyond.max(), 0)


def _cylinder(shape, x):
    axis = _space((0, 0) if shape.axis is None else shape.axis)
    axis = np.array([0, 0, 1.0]) if shape.axis is None else axis / np.linalg.norm(axis)
    arm = x - _space(shape.center)
    along = arm @ axis
    radial = np.linalg.norm(arm - along * axis) - shape.radius
    beyond = np.array([radial, abs(along) - shape.length / 2])
    distance = np.linalg.norm(np.maximum(beyond, 0)) + min(beyond.max(), 0)
    return -distance if shape.inside else distance


def distance(shape, x):
    """Signed distance of a position (3,) in coordinates of the body."""
    if isinstance(shape, Union):
        return min(distance(part, x) for part in shape.parts)
    if isinstance(shape, Box):
        return _box(shape, x)
    if isinstance(shape, Cylinder):
        return _cylinder(shape, x)
    normal = _space(shape.normal)
    return normal @ (x - _space(shape.through)) / np.linalg.norm(normal)


def gradient(shape, x, h=1e-6):
    """Unit normal: the gradient of the distance by central differences."""
    dim = shape.dim
    out = np.zeros(3)
    for d in range(dim):
        step = h * np.eye(3)[d]
        out[d] = (distance(shape, x + step) - distance(shape, x - step)) / (2 * h)
    return out / np.linalg.norm(out)


def at_its_place(body, state):
    """The body where it is now, in 2D or 3D."""
    turn = np.eye(3)
    turn[: body.dim, : body.dim] = state.rotation
    vector = Rotation.from_matrix(turn).as_rotvec(degrees=True)
    angle = vector[2] if body.dim == 2 else tuple(vector)
    return replace(body, position=tuple(state.position), rotation_deg=angle)


class Feet:
    """Feet of the points of a simulation on a body, with what acts there.

    `distance` (n,) [m] and `normal` (n, 3) are those of the points, `x` (n, 3) [m] the places of
    the feet, or of the points whose feet lie outside of the domain, `force` (n, 3) [N] that on the
    material, `pressing` (n,) its part along the normal, `flat` (n,) where the surface has no edge
    within a cell, `slip` (n, 3) [m/s] the velocity of the material relative to the surface,
    NaN where there is not enough mass about the foot.
    """

    def __init__(self, sim, nodes, body, velocity, omega):
        buffers, dim, cell = sim.buffers, body.dim, sim.scene.grid.cell
        held = buffers["mass"][0] > 0
        place = buffers["x"][:, held].T
        self.mass = buffers["mass"][0, held]
        self.distance, self.normal = body.distance(place)
        foot = place - self.distance[:, None] * self.normal
        self.flat = np.ones(len(foot), dtype=bool)
        for tangent in _tangents(self.normal):
            for side in (-1.2, 1.2):
                away = body.distance(foot + side * cell * tangent)[0]
                self.flat &= abs(away) < 0.3 * cell
        self.force = np.pad(buffers["contact_force"][:, held].T, ((0, 0), (0, 3 - dim)))
        self.normal = np.pad(self.normal, ((0, 0), (0, 3 - dim)))
        grid = sim.scene.grid
        inside = np.all((foot >= grid.lower) & (foot <= grid.upper), axis=1)
        self.x = np.pad(np.where(inside[:, None], foot, place), ((0, 0), (0, 3 - dim)))
        self.pressing = np.einsum("nd,nd->n", self.force, self.normal)
        self.slip = self._slip(sim, nodes, foot, body, np.array(velocity), np.array(omega))

    def _slip(self, sim, nodes, foot, body, velocity, omega):
        out = np.full((len(foot), 3), np.nan)
        grid = sim.scene.grid
        away = 1.5 * grid.cell if sim.scene.walls else 0.0  # walls act nearer to them
        seen = np.all((foot > np.add(grid.lower, away)) & (foot < grid.upper), axis=1)
        seen &= (self.distance > -0.5 * grid.cell) & (self.distance < 1.5 * grid.cell)
        shapes = Shapes(sim.scene, foot[seen])
        place = np.full((int(np.prod(shapes.counts)), body.dim), np.nan)
        place[shapes.node] = shapes.at
        near = np.flatnonzero(np.isfinite(place[:, 0]))
        number = np.full(len(place), -1)  # of each node of the grid among the active ones
        apart, active = cKDTree(nodes["x"]).query(place[near])
        number[near] = np.where(apart < 1e-6 * grid.cell, active, -1)
        number = number[shapes.node]
        mass = np.where(number >= 0, nodes["mass"][number], 0.0)
        mean = shapes.w @ mass
        # Light nodes count less, and where there are some, weights are moved to the surface.
        used = np.minimum(shapes.w, mass / (0.15 * np.maximum(mean, 1e-300))[:, None])
        total = used.sum(axis=1)
        away = shapes.at - foot[seen][:, None]
        height = np.einsum("nkd,nd->nk", away, self.normal[seen, : body.dim]) / grid.cell
        light = (used < shapes.w).any(axis=1) & (total > 0)
        used[light] = total[light, None] * _on_surface(used[light], height[light])
        enough = (total > 0.2) & (mean > 0.1 * sim.scene.material.rho_c * grid.cell**grid.dim)
        v = used @ np.pad(nodes["v"][number], ((0, 0), (0, 3 - body.dim)))
        v /= np.where(enough, total, 1.0)[:, None]
        surface = velocity + np.cross(omega, self.x[seen] - _space(body.position))
        out[seen] = np.where(enough[:, None], v - surface, np.nan)
        return out


def _on_surface(weight, height):
    """Weights (n, nodes) of the sum 1 that act at the surface, changed by a half at most."""
    weight = weight / weight.sum(axis=1)[:, None]
    mean = np.einsum("nk,nk->n", weight, height)[:, None]
    off = height - mean
    variance = np.einsum("nk,nk->n", weight, off**2)[:, None]
    farthest = np.where(weight > 0, abs(off), 0.0).max(axis=1)[:, None]
    slope = mean / np.maximum(np.maximum(variance, 2 * abs(mean) * farthest), 1e-300)
    return weight * np.where(variance > 1e-9, 1 - slope * off, 1.0)


def _tangents(normal):
    if normal.shape[1] == 2:
        return [np.stack([-normal[:, 1], normal[:, 0]], axis=1)]
    other = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(normal, other)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return [first, np.cross(normal, first)]
