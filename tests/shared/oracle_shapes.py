"""Plain reference for shape functions: NumPy written from their definitions."""

import math
from functools import cached_property

import numpy as np

from granular.mpm.axis_nodes import c0_lines


def _linear_shapes(x, lines):
    """Linear shape functions of the unit grid at x and their antiderivatives, (n, len(lines))."""
    r = x[:, None] - lines
    inner = np.clip(r, -1.0, 1.0)
    area = np.where(inner < 0, (1 + inner) ** 2 / 2, 1 - (1 - inner) ** 2 / 2)
    return np.maximum(0.0, 1 - abs(r)), area


def _linear(x, lines):
    side = np.where(x[:, None] < lines, 1.0, -1.0)
    near = (abs(x[:, None] - lines) < 1) | (x[:, None] == lines - 1)
    return _linear_shapes(x, lines)[0], np.where(near, side, 0.0)


def _ugimp(x, lines, half, ends):
    """Linear shape functions averaged over [x - half, x + half], cut at walls (`ends`)."""
    ends = np.array(sorted({-np.inf, np.inf, *ends}))
    place = np.searchsorted(ends, x, side="right") - 1
    low, high = np.maximum(x - half, ends[place]), np.minimum(x + half, ends[place + 1])
    (at_low, area_low), (at_high, area_high) = (
        _linear_shapes(low, lines),
        _linear_shapes(high, lines),
    )
    width = (high - low)[:, None]
    return (area_high - area_low) / width, (at_high - at_low) / width


def _splines(x, knots, degree=2):
    """B-splines by the recursion of Cox and de Boor, and their derivatives."""
    values = ((x[:, None] >= knots[:-1]) & (x[:, None] < knots[1:])).astype(float)
    for k in range(1, degree + 1):
        before = values
        count = len(knots) - 1 - k
        values = np.zeros((len(x), count))
        slopes = np.zeros((len(x), count))
        for i in range(count):
            if knots[i + k] > knots[i]:
                width = knots[i + k] - knots[i]
                values[:, i] += (x - knots[i]) / width * before[:, i]
                slopes[:, i] += k / width * before[:, i]
            if knots[i + k + 1] > knots[i + 1]:
                width = knots[i + k + 1] - knots[i + 1]
                values[:, i] += (knots[i + k + 1] - x) / width * before[:, i + 1]
                slopes[:, i] -= k / width * before[:, i + 1]
    return values, slopes


def axis_functions(basis, n, periodic, lines, half, x):
    """Values and slopes (per cell) at x (cells), node positions (cells), true node of each.

    Nodes of periodic axes appear several times, once for each image.
    """
    if basis == "quadratic":
        if periodic:
            knots = np.arange(-4, n + 5, dtype=float)
        else:
            knots = np.sort(np.concatenate([[0, 0], np.arange(n + 1), [n, n], lines])).astype(float)
        w, g = _splines(x, knots)
        at = (knots[1:-2] + knots[2:-1]) / 2
        real = np.round(at - 0.5).astype(int) % n if periodic else np.arange(len(at))
        return w, g, at, real
    at = np.arange(-2, n + 3) if periodic else np.arange(n + 1)
    real = at % n if periodic else at
    if basis == "linear":
        w, g = _linear(x, at)
    else:
        w, g = _ugimp(x, at, half, [*lines] + ([] if periodic else [0, n]))
    return w, g, at.astype(float), real


def axis_nodes(scene, d):
    """Positions of the true nodes along axis d, in cells from the lower end."""
    grid, basis = scene.grid, scene.scheme.basis
    lines, middle = c0_lines(grid, scene.walls, d), np.array([0.5])
    *_, at, real = axis_functions(basis, grid.shape[d], grid.periodic[d], lines, 0.25, middle)
    inside = (at >= 0) & (at < grid.shape[d] if grid.periodic[d] else True)
    positions = np.empty(inside.sum())
    positions[real[inside]] = at[inside]
    return positions


def _product(factors):
    """Products (points, images) of one factor (points, images along it) of each axis."""
    out = factors[0]
    for factor in factors[1:]:
        out = (out[:, :, None] * factor[:, None, :]).reshape(len(out), -1)
    return out


class Shapes:
    """Shape functions of all nodes at all points.

    `w` (points, images) are the values, `g` (points, images, dim) [1/m] the gradients, `r` (points,
    images, dim) [m] the vectors from point to node, `at` (images, dim) [m] the places of the nodes,
    `node` (images,) the number of the node, x fastest. Gradients and vectors are made when they are
    first asked for, as they are large.
    """

    def __init__(self, scene, x):
        grid, scheme = scene.grid, scene.scheme
        half = 0.5 / round(scene.fills[0].points_per_cell ** (1 / grid.dim))
        self._values, self._slopes, self._vectors, places, nodes = [], [], [], [], []
        for d in range(grid.dim):
            lines = c0_lines(grid, scene.walls, d)
            at = (x[:, d] - grid.lower[d]) / grid.cell
            w, g, position, node = axis_functions(
                scheme.basis, grid.shape[d], grid.periodic[d], lines, half, at
            )
            self._values.append(w)
            self._slopes.append(g / grid.cell)
            self._vectors.append((position - at[:, None]) * grid.cell)
            places.append(grid.lower[d] + position * grid.cell)
            nodes.append(node)
        self.counts = [int(node.max()) + 1 for node in nodes]
        stride = np.cumprod([1, *self.counts[:-1]])
        steps = [s * node for s, node in zip(stride, nodes, strict=True)]
        self.node = sum(np.meshgrid(*steps, indexing="ij")).ravel()
        self.at = np.stack([p.ravel() for p in np.meshgrid(*places, indexing="ij")], axis=1)
        self.w = _product(self._values)

    @cached_property
    def g(self):
        factors = [list(self._values) for _ in self._slopes]
        for d, slopes in enumerate(self._slopes):
            factors[d][d] = slopes
        return np.stack([_product(f) for f in factors], axis=-1)

    @cached_property
    def r(self):
        ones = [np.ones_like(vectors) for vectors in self._vectors]
        parts = [[*ones[:d], r, *ones[d + 1 :]] for d, r in enumerate(self._vectors)]
        return np.stack([_product(part) for part in parts], axis=-1)

    def to_nodes(self, values):
        """Sum of values (points, images, ...) over points and images, shape (nodes, ...)."""
        out = np.zeros((math.prod(self.counts), *values.shape[2:]))
        np.add.at(out, self.node, values.sum(axis=0))
        return out


def node_volumes(scene, *, blocks=True):
    """Integral of each shape function over the domain, in volumes of cells; Gauss quadrature.

    In an axisymmetric grid it is that of the function times the radius in cells.
    """
    grid = scene.grid
    at, weight = np.polynomial.legendre.leggauss(3)
    one = [
        (np.arange(n)[:, None] + (at + 1) / 2).ravel() * grid.cell + low
        for n, low in zip(grid.shape, grid.lower, strict=True)
    ]
    mesh = np.meshgrid(*one, indexing="ij")
    x = np.stack([m.ravel() for m in mesh], axis=1)
    share = [np.tile(weight / 2, n) for n in grid.shape]
    volume = math.prod(np.meshgrid(*share, indexing="ij")).ravel()
    if grid.axisymmetric:
        volume = volume * x[:, 0] / grid.cell
    for wall in scene.walls:
        if blocks and type(wall).__name__ == "Solid":
            volume[np.all((x > wall.lower) & (x < wall.upper), axis=1)] = 0.0
    shapes = Shapes(scene, x)
    return shapes.to_nodes(shapes.w * volume[:, None])


def node_radii(scene):
    """Mean radius over each shape function [cells]; 1 unless the grid is axisymmetric."""
    flat = scene.replace(grid=scene.grid.replace(axisymmetric=False))
    return node_volumes(scene, blocks=False) / node_volumes(flat, blocks=False)


def full_mass(scene):
    """Mass of a full cell [kg], over its radius [cells] in an axisymmetric grid."""
    grid = scene.grid
    size = 2 * math.pi * grid.cell**3 if grid.axisymmetric else grid.cell**grid.dim
    return scene.material.rho_c * size
