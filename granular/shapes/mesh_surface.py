"""Closed solids from surfaces of triangles: shells, their orientation and nesting."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from granular import _core
from granular.tools.arrays import Array, BoolArray, IndexArray, IntArray

Faces = NDArray[np.int32]

LEAST_SIGNS = 1e-9
"""Least ratio of the volume of a shell to the cube of its size."""
PROBES = 64
"""Vertices of a shell at which it is tested whether they lie in others."""


class MeshWarning(UserWarning):
    """A surface of triangles was repaired, or may not be the intended one."""


def mended(vertices: Array, faces: Faces) -> tuple[Faces, list[str]]:
    """Return the triangles of closed shells that are oriented, and sentences on the changes.

    A solid is the inside of a shell of positive volume, less the cavities in it: shells of
    negative volume that lie in solids. The body is the union of its solids.

    Raises
    ------
    ValueError
        If shells are not closed, have no orientation or no volume.
    """
    changes = []
    before = len(faces)
    edges = _Edges.of(faces, len(vertices))
    if (edges.counts > 2).any():
        faces = _without_copies(faces, edges, len(vertices))
    if before > len(faces):
        changes.append(
            f"left out {before - len(faces)} of {before} triangles, which are duplicates"
        )
        edges = _Edges.of(faces, len(vertices))
    given = faces
    faces = _oriented(faces, edges)
    if faces is not given:
        edges = _Edges.of(faces, len(vertices))
    _refuse_open(vertices, faces, edges)
    shells = _Shells.of(vertices, faces, edges)
    flat = abs(shells.volume) <= LEAST_SIGNS * shells.size**3
    if flat.all():
        raise ValueError(
            f"faces: they hold the volume {shells.volume.sum():.4g} m3, must hold some: a sheet "
            "needs a thickness"
        )
    if flat.any():
        changes.append(f"left out {flat.sum()} of {len(flat)} closed parts, which hold no volume")
        solid = ~flat[shells.label]
        faces, given = np.ascontiguousarray(faces[solid]), given[solid]
        shells = _Shells.of(vertices, faces, _Edges.of(faces, len(vertices)))
    wrong, idle = _inside_out(shells)
    if wrong.any():
        changes.append(f"reversed {wrong.sum()} of {len(wrong)} closed parts that were inside out")
    turned = (faces != given).any(axis=1)
    single = turned & ~wrong[shells.label]
    if single.any():
        changes.append(f"reversed {single.sum()} of {len(faces)} triangles, to agree with others")
    if idle:
        changes.append(
            f"{idle} of {len(wrong)} closed parts lie within others and have no effect; a cavity "
            "has triangles that are anticlockwise as seen from within it"
        )
    return _flipped(faces, wrong[shells.label]), changes


def solids(vertices: Array, faces: Faces) -> IndexArray:
    """Return the number of the solid to which each triangle of a repaired surface belongs, from
    0."""
    shells = _Shells.of(vertices, faces, _Edges.of(faces, len(vertices)))
    if len(shells.volume) == 1:
        return shells.label
    parent = np.arange(len(shells.volume))
    for i, holders, winding in _held(shells):
        if shells.volume[i] < 0:
            around = [j for j, w in zip(holders, winding, strict=True) if np.median(w) > 0.5]
            if around:
                parent[i] = min(around, key=lambda j: shells.volume[j])
    labels: IndexArray = np.unique(parent, return_inverse=True)[1][shells.label]
    return labels


# ---- edges ----


@dataclass(frozen=True)
class _Edges:
    """Sides of triangles, side 3 i + k from vertex k of triangle i to the next, edge by edge."""

    order: IndexArray
    """Sides, grouped by edges."""
    begins: IndexArray
    """First of each edge in this order."""
    counts: IndexArray
    rises: BoolArray
    """For each side in this order: its second vertex has the higher index."""

    @classmethod
    def of(cls, faces: Faces, count: int) -> _Edges:
        start, end = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel()
        key = np.minimum(start, end) * count + np.maximum(start, end)
        order = np.argsort(key, kind="stable")
        begins = np.flatnonzero(np.diff(key[order], prepend=-1))
        return cls(order, begins, np.diff(begins, append=len(order)), (start < end)[order])

    def rising(self) -> IntArray:
        """Sides of each edge that rise."""
        rising: IntArray = np.add.reduceat(self.rises.astype(np.int64), self.begins)
        return rising

    def pairs(self) -> tuple[IndexArray, IndexArray, BoolArray]:
        """Both triangles at the edges that have two, and whether one of them must be reversed."""
        first = self.begins[self.counts == 2]
        same = self.rises[first] == self.rises[first + 1]
        return self.order[first] // 3, self.order[first + 1] // 3, same


def _components(count: int, first: IndexArray, second: IndexArray) -> tuple[int, IndexArray]:
    """Number of connected parts of `count` things with links, and the part of each thing."""
    links = scipy.sparse.coo_matrix((np.ones(len(first), bool), (first, second)), (count, count))
    components: tuple[int, IndexArray] = scipy.sparse.csgraph.connected_components(
        links, directed=False
    )
    return components


def _flipped(faces: Faces, which: BoolArray) -> Faces:
    if not which.any():
        return faces
    faces = faces.copy()
    faces[which] = faces[which][:, [0, 2, 1]]
    return faces


def _without_copies(faces: Faces, edges: _Edges, count: int) -> Faces:
    """Leave out duplicate triangles.

    Of those of equal direction one stays. Two of opposite directions are a wall between parts that
    touch, of which none stays, or a surface with triangles on both its sides, of which one does:
    whichever closes the surface.
    """
    shared = np.zeros(len(faces), dtype=bool)
    shared[edges.order[np.repeat(edges.counts > 2, edges.counts)] // 3] = True
    at = np.flatnonzero(shared)
    corners = np.sort(faces[at], axis=1)
    _, first, same = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    if len(first) == len(at):
        return faces
    least = np.argmin(faces[at], axis=1)[:, None]
    follows, last = (np.take_along_axis(faces[at], (least + k) % 3, 1) for k in (1, 2))
    sense = np.where(follows < last, 1, -1)[:, 0]
    net = np.bincount(same.ravel(), weights=sense)
    once, turn, paired = ~shared, np.zeros_like(shared), np.zeros_like(shared)
    once[at[first]] = True
    turn[at[first]] = net * sense[first] < 0  # the one that stays has the direction of most
    paired[at[first]] = net == 0
    faces, paired = _flipped(faces, turn)[once], paired[once]
    without = faces[~_walls(faces, paired, count)]
    is_open = (_Edges.of(without, count).counts % 2).any()
    return np.ascontiguousarray(faces if is_open else without)


def _walls(faces: Faces, paired: BoolArray, count: int) -> BoolArray:
    """Those of the paired triangles that are connected to others by edges, by way of paired ones.

    The others are closed parts with triangles on both sides.
    """
    edges = _Edges.of(faces, count)
    edge = np.repeat(np.arange(len(edges.counts)), edges.counts)
    mine = paired[edges.order // 3]
    bordering = np.bincount(edge[~mine], minlength=len(edges.counts)) > 0
    triangle, edge = edges.order[mine] // 3, edge[mine]
    joined = np.flatnonzero(np.diff(edge) == 0)
    _, patch = _components(len(faces), triangle[joined], triangle[joined + 1])
    walls: BoolArray = paired & np.isin(patch, patch[triangle[bordering[edge]]])
    return walls


def _oriented(faces: Faces, edges: _Edges) -> Faces:
    """Reverse triangles so that those at the edges of two agree, as few as possible in each
    part."""
    first, second, same = edges.pairs()
    if not same.any():
        return faces
    # two copies of each triangle, one reversed: those that agree are connected
    n = len(faces)
    _, label = _components(
        2 * n,
        np.concatenate([first, first + n]),
        np.concatenate([second + n * same, second + n * ~same]),
    )
    here, there = label[:n], label[n:]
    if (here == there).any():
        bad = int(np.flatnonzero(here == there)[0])
        raise ValueError(
            f"faces: triangles connected with faces[{bad}] = {faces[bad].tolist()} have no common "
            "orientation, as those of a Moebius strip: the surface needs a thickness"
        )
    part, turned = np.minimum(here, there), here > there
    most = 2 * np.bincount(part, turned) > np.bincount(part)
    return _flipped(faces, turned != most[part])


def _refuse_open(vertices: Array, faces: Faces, edges: _Edges) -> None:
    """Refuse a surface unless each edge has as many triangles on one side as on the other."""
    rising, of = edges.rising(), len(edges.counts)
    bad = np.flatnonzero(2 * rising != edges.counts)
    if not len(bad):
        return
    single = bad[edges.counts[bad] == 1]
    first = single[0] if len(single) else bad[0]
    side = edges.order[edges.begins[first]]
    face, k = divmod(int(side), 3)
    a, b = sorted((int(faces[face, k]), int(faces[face, (k + 1) % 3])))
    if len(single):
        used = vertices[np.unique(faces)]
        same = len(used) - len(np.unique(used, axis=0))
        merge = f"; {same} vertices lie where others do: such must be one" if same else ""
        raise ValueError(
            f"faces: the edge from vertex {a} to {b} belongs to one triangle, must be two: the "
            "surface must be closed, or have a thickness (edges of one triangle: "
            f"{len(single)} of {of}{merge})"
        )
    n, one = int(edges.counts[first]), int(rising[first])
    raise ValueError(
        f"faces: the edge from vertex {a} to {b} belongs to {n} triangles, {one} of them in this "
        "direction, must be half of them: walls within the solid must be left out, or parts that "
        f"touch must not share vertices (such edges: {len(bad)} of {of})"
    )


# ---- shells ----


@dataclass(frozen=True)
class _Shells:
    """Closed parts of an oriented surface."""

    vertices: Array
    faces: Faces
    label: IndexArray
    """Shell of each triangle."""
    volume: Array
    """Negative if inside out [m3]."""
    low: Array
    high: Array
    """Corners of the box about each shell (n, 3) [m]."""

    @classmethod
    def of(cls, vertices: Array, faces: Faces, edges: _Edges) -> _Shells:
        label = _shells(len(faces), edges)
        corners = vertices[faces] - vertices[faces[0, 0]]
        six = np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
        count = label.max() + 1
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        if count == 1:
            low[0], high[0] = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        else:
            np.minimum.at(low, label, corners.min(axis=1))
            np.maximum.at(high, label, corners.max(axis=1))
        return cls(vertices, faces, label, np.bincount(label, six) / 6, low, high)

    @property
    def size(self) -> Array:
        size: Array = (self.high - self.low).max(axis=1)
        return size

    def origin(self) -> Array:
        origin: Array = self.vertices[self.faces[0, 0]]
        return origin


def _shells(count: int, edges: _Edges) -> IndexArray:
    """Number of the shell of each triangle.

    Triangles at edges of two are of one shell. At an edge of more, such as that of two cubes that
    touch, a part that is closed without the others is a shell, and the others are one.
    """
    first, second, _ = edges.pairs()
    parts, label = _components(count, first, second)
    more = np.repeat(edges.counts > 2, edges.counts)
    if not more.any():
        return label
    edge = np.repeat(np.arange(len(edges.counts)), edges.counts)[more]
    part = label[edges.order[more] // 3]
    keys, of = np.unique(edge * parts + part, return_inverse=True)
    unpaired = np.bincount(of.ravel(), np.where(edges.rises[more], 1, -1)) != 0
    edge, part = keys[unpaired] // parts, keys[unpaired] % parts
    joined = np.flatnonzero(np.diff(edge) == 0)
    labels: IndexArray = _components(parts, part[joined], part[joined + 1])[1][label]
    return labels


def _held(shells: _Shells) -> Iterator[tuple[int, IndexArray, Array]]:
    """Shells from large to small; larger ones whose boxes overlap; their winding numbers about it.

    The numbers (larger shells, vertices of the shell) are taken as if all were oriented outwards.
    """
    trees: dict[int, object] = {}
    vertices = np.ascontiguousarray(shells.vertices - shells.origin())
    largest = np.argsort(-abs(shells.volume), kind="stable")
    by_shell = np.argsort(shells.label, kind="stable")
    ends = np.cumsum(np.bincount(shells.label))
    for rank, i in enumerate(largest):
        before = largest[:rank]
        apart = (shells.low[before] > shells.high[i]) | (shells.high[before] < shells.low[i])
        holders = before[~apart.any(axis=1)]
        shell = by_shell[(ends[i - 1] if i else 0) : ends[i]]
        chosen = shell[np.linspace(0, len(shell) - 1, min(PROBES, len(shell))).astype(int)]
        places = np.ascontiguousarray(vertices[shells.faces[chosen, 0]])
        winding = np.zeros((len(holders), len(places)))
        for row, j in enumerate(holders):
            if j not in trees:
                chosen = by_shell[(ends[j - 1] if j else 0) : ends[j]]
                trees[j] = _core.mesh_tree(vertices, np.ascontiguousarray(shells.faces[chosen]))
            winding[row] = np.sign(shells.volume[j]) * _core.mesh_winding(trees[j], places)
        yield int(i), holders, winding


def _inside_out(shells: _Shells) -> tuple[BoolArray, int]:
    """Shells that must be reversed, and the number of solids that lie wholly within others."""
    negative = shells.volume < 0
    if len(negative) == 1:
        return negative, 0
    held = list(_held(shells))
    outer = {i for i, _, winding in held if not (winding > 0.5).any(axis=0).all()}
    if negative[list(outer)].all():  # the surface as a whole
        negative = ~negative
    solid = np.where(negative & [i not in outer for i in range(len(negative))], -1.0, 1.0)
    idle = 0
    for i, holders, winding in held:  # from large to small: the holders are known
        if i in outer:
            continue
        inside = bool((solid[holders] @ (winding > 0.5) > 0.5).all())
        if not inside:
            solid[i] = 1.0  # in a cavity
        elif solid[i] > 0:
            idle += 1
    wrong = (solid < 0) != (shells.volume < 0)
    return wrong, idle
