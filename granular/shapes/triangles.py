"""Exact distances from surfaces of triangles, and the thickness of the solids that they enclose."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from granular import _core
from granular.shapes.quadrature import Moments
from granular.tools.arrays import Array, BoolArray, IndexArray

POINTS = 2048
"""Points of a surface at which the thickness is measured."""
SHARE = 0.01
"""Share of the surface that walls must have to count."""
CLEAR = 0.99
"""Share of its radius within which a ball must hold no triangle.

With 1 a ball in a fine triangulation of a ball would be compared with all triangles. Between two
planes the radius that fits is their distance over 1 + CLEAR thereby.
"""
OPPOSITE = 0.01
"""Distance of the surface from the far end of a ball, in radii, up to which it touches there.

In a wedge of the angle a it is 1 - cos a: parts that taper by less than 8 degrees are walls.
"""
LARGEST = 16
"""Balls of the largest radii, whose depth is measured without this."""
BEYOND = 1.2
"""Position in radii from which the other side of a wall is the nearest."""
OFF = 1e-6
"""Distance from the surface, over its size, at which its two sides are tested."""


class Triangles:
    """A surface of triangles.

    Parameters
    ----------
    vertices, faces : ndarray
    solids : ndarray of int, shape (n,), optional
        Solid of each triangle of a closed surface, from 0 on; None for a sheet.
    thickness : float
        Thickness of a sheet [m].
    """

    def __init__(
        self, vertices: Array, faces: NDArray[np.int32], solids: IndexArray | None, thickness: float
    ) -> None:
        used = vertices[faces.ravel()]
        low, high = used.min(axis=0), used.max(axis=0)
        self.origin = 0.5 * (low + high)
        self._size, self._half = high - low, 0.5 * thickness
        self._vertices = np.ascontiguousarray(vertices - self.origin)  # no digits are lost far off
        self._faces, self.closed = faces, solids is not None
        self._tree = _core.mesh_tree(self._vertices, faces)
        self._solid = np.zeros(len(faces), dtype=np.intp) if solids is None else solids
        self._parts = [(self._tree, -self._size, self._size)]
        if self._solid.any():
            self._parts = [
                self._part(faces[self._solid == s]) for s in range(self._solid.max() + 1)
            ]

    def _part(self, faces: NDArray[np.int32]) -> tuple[object, Array, Array]:
        """Tree of a solid, and corners of its box."""
        used = self._vertices[faces.ravel()]
        tree = _core.mesh_tree(self._vertices, np.ascontiguousarray(faces))
        return tree, used.min(axis=0), used.max(axis=0)

    @property
    def count(self) -> int:
        """Number of triangles."""
        return len(self._faces)

    def distance(self, x: Array) -> Array:
        """Signed distance [m] of points (n, 3).

        It is that of the solid whose surface is nearest, and inside the greatest depth in a solid:
        walls of one solid within another vanish.
        """
        places = np.ascontiguousarray(x - self.origin)
        distance = _core.mesh_distance(self._tree, places, self.closed) - self._half
        if len(self._parts) > 1 and len(inside := np.flatnonzero(distance < 0)):
            depth = np.zeros(len(inside))
            for tree, low, high in self._parts:
                here = np.flatnonzero(
                    ((places[inside] >= low) & (places[inside] <= high)).all(axis=1)
                )
                if len(here):
                    signed = _core.mesh_distance(tree, places[inside[here]], True)
                    depth[here] = np.maximum(depth[here], -signed)
            distance[inside] = np.where(depth > 0, -depth, distance[inside])
        return distance

    def winding(self, x: Array) -> Array:
        """Number of times that the surface goes around points (n, 3)."""
        return _core.mesh_winding(self._tree, np.ascontiguousarray(x - self.origin))

    def points(self, count: int) -> tuple[Array, Array, IndexArray]:
        """Points of the surface, spread evenly by area, their normals and the solids."""
        a, b, c = (self._vertices[self._faces[:, k]] for k in range(3))
        twice = np.cross(b - a, c - a)
        area = np.linalg.norm(twice, axis=1)
        sums = np.cumsum(area)
        at = np.searchsorted(sums, (np.arange(count) + 0.5) / count * sums[-1])
        at = np.minimum(at, len(area) - 1)
        # a sequence of low discrepancy in the square (R2), folded into the triangle
        share = (np.arange(count)[:, None] * (0.7548776662466927, 0.5698402909980532) + 0.5) % 1
        over = share.sum(axis=1) > 1
        share[over] = 1 - share[over]
        places = a[at] + share[:, :1] * (b - a)[at] + share[:, 1:] * (c - a)[at]
        return places + self.origin, twice[at] / area[at, None], self._solid[at]

    def _sides(self, at: Array, normal: Array) -> tuple[Array, Array]:
        """Winding numbers just within and just outside of points of a closed surface."""
        off = OFF * self._size.max() * normal
        return self.winding(at - off), self.winding(at + off)

    def overlaps(self, count: int) -> BoolArray:
        """True for solids of a closed surface that lie in others, or cross them or themselves.

        It is tested at points of the surface.
        """
        at, normal, solid = self.points(count)
        mask = np.zeros(len(self._parts), dtype=bool)
        inner, outer = self._sides(at, normal)
        mask[solid[(abs(inner - 1) > 0.5) | (abs(outer) > 0.5)]] = True
        return mask

    def clusters(self) -> list[IndexArray]:
        """Solids in groups, whose boxes are apart from those of all others."""
        low, high = (np.array([part[k] for part in self._parts]) for k in (1, 2))
        meet = ((low[:, None] < high) & (low < high[:, None])).all(axis=2)
        count, label = scipy.sparse.csgraph.connected_components(meet, directed=False)
        return [np.flatnonzero(label == group) for group in range(count)]

    def part(self, solids: IndexArray) -> Triangles:
        """Return the surface of some of the solids."""
        mask = np.isin(self._solid, solids)
        used, at = np.unique(self._faces[mask], return_inverse=True)
        faces = at.reshape(-1, 3).astype(np.int32)
        label = np.unique(self._solid[mask], return_inverse=True)[1].reshape(-1)
        return Triangles(self._vertices[used] + self.origin, faces, label, 2 * self._half)

    def sides(self, x: Array, radius: float) -> NDArray[np.int8]:
        """Return -1 where a ball of this radius is inside, 1 where it is outside, 0 near
        triangles."""
        places = np.ascontiguousarray(x - self.origin)
        sides = np.zeros(len(x), dtype=np.int8)
        if not self.closed:
            distance = _core.mesh_distance(self._tree, places, False) - self._half
            return np.where(abs(distance) < radius, 0, np.sign(distance)).astype(np.int8)
        clear = np.flatnonzero(_core.mesh_clear(self._tree, places, np.full(len(x), radius)))
        sides[clear] = np.where(self.inside(x[clear]), -1, 1)
        return sides

    def inside(self, x: Array) -> BoolArray:
        """True for points (n, 3) in a solid."""
        if self.closed:
            return self.winding(x) > 0.5
        places = np.ascontiguousarray(x - self.origin)
        return _core.mesh_distance(self._tree, places, False) < self._half

    def bounds(self, directions: Array) -> tuple[Array, Array]:
        """Least and largest coordinates [m] along directions, the rows (n, 3)."""
        along = (self._vertices[np.unique(self._faces)] + self.origin) @ directions.T
        return along.min(axis=0) - self._half, along.max(axis=0) + self._half

    def moments(self) -> Moments:
        """Moments of the solid that a closed surface encloses, by the theorem of Gauss.

        They are sums over the tetrahedra of each triangle with the middle of the box.
        """
        a, b, c = (self._vertices[self._faces[:, k]] for k in range(3))
        six = np.einsum("ni,ni->n", a, np.cross(b, c))
        corners, total = np.stack([a, b, c]), a + b + c
        sums = np.empty((4, 4))
        sums[0, 0] = six.sum() / 6
        sums[0, 1:] = sums[1:, 0] = six @ total / 24
        of_corners = np.einsum("n,kni,knj->ij", six, corners, corners)
        sums[1:, 1:] = (of_corners + np.einsum("n,ni,nj->ij", six, total, total)) / 120
        volume, center = float(sums[0, 0]), sums[0, 1:] / sums[0, 0]
        second = sums[1:, 1:] - volume * np.outer(center, center)
        return Moments(volume, center + self.origin, second, 0.0)

    def thickness(self) -> tuple[float, float]:
        """Thickness [m] of the thinnest walls, and the diameter of a large ball inside.

        Walls are of a hundredth of the surface at least; inf if there are none. They are measured
        by the largest balls inside that touch the surface at a point of it: where such a ball
        touches the surface at its far end, too, there is a wall. The diameter of the largest of
        these balls is a bound of that of the largest inside.
        """
        if not self.closed:
            return 2 * self._half, 2 * self._half
        at, normal, solid = self.points(POINTS)
        inner, outer = self._sides(at, normal)
        is_surface = (inner > 0.5) & (outer < 0.5)
        radius, wall = np.zeros(POINTS), np.full(POINTS, np.inf)
        for s, (tree, _, _) in enumerate(self._parts):
            here = np.flatnonzero(is_surface & (solid == s))
            if len(here):
                radius[here], wall[here] = self._touching(
                    tree, at[here] - self.origin, normal[here]
                )
        least = int(np.ceil(SHARE * max(is_surface.sum(), 1)))
        best = np.argsort(radius)[-LARGEST:]
        depth = -self.distance(at[best] - radius[best, None] * normal[best])
        largest = max(2 * depth.max(), wall[np.isfinite(wall)].max(initial=0.0))
        return float(np.sort(wall)[least - 1]), float(largest)

    def _touching(self, tree: object, at: Array, normal: Array) -> tuple[Array, Array]:
        """Radii of the largest balls that touch points from within; thickness of walls, or inf."""
        low, high = np.zeros(len(at)), np.full(len(at), self._size.min() / (1 + CLEAR))
        for _ in range(16):
            radius = 0.5 * (low + high)
            fits = _core.mesh_clear(tree, at - radius[:, None] * normal, CLEAR * radius)
            low, high = np.where(fits, radius, low), np.where(fits, high, radius)
        far = at - (1 + CLEAR) * low[:, None] * normal
        touches = ~_core.mesh_clear(tree, far, OPPOSITE * low)
        beyond = at - BEYOND * low[:, None] * normal
        rest = _core.mesh_distance(tree, beyond, False)
        return low, np.where(touches, BEYOND * low + rest, np.inf)
