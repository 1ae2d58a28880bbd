"""Effect of walls on the nodes of the grid: a code for each node.

The core has a table of wall rows and a map of code bytes, one for each node (`GridMap`). Code 0 is
a free node; code r (from 1 on) is row r - 1 of the tuple that `node_codes` returns.
"""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.model.grid import Grid
from granular.mpm.axis_nodes import c0_lines, node_positions
from granular.mpm.blocks import held_components, outlook, solid_cells
from granular.mpm.grid_map import GridMap, Ranges
from granular.mpm.walls import WallOrBlock
from granular.tools.arrays import BoolArray, IndexArray

if TYPE_CHECKING:
    from granular.model.inflow import Inflow
    from granular.mpm.scene import Scene


CORE_BASES = _core.enumerations()["basis"]
MAX_ROWS = 255


class WallRow(NamedTuple):
    """Constraint on the velocity of a node, by one wall or by several; the core has these rows.

    Attributes
    ----------
    fixed : int
        Bit d is set if component d is held at that of `velocity`.
    away : tuple of int, length 3
        Of these components: the direction, +1 or -1, in which the node may leave the wall; 0 where
        it is held both ways.
    friction : tuple of float, length 3
        Coulomb coefficient of the wall normal to each axis.
    opens_at : float
        Time [s] from which the node has the code `after`; inf for never.
    after : int
        That code, 0 for a free node.
    velocity : tuple of float, length 3
        Of the wall [m/s]; 0 for components that are not held.
    """

    fixed: int = 0
    away: tuple[int, int, int] = (0, 0, 0)
    friction: tuple[float, float, float] = (0.0, 0.0, 0.0)
    opens_at: float = math.inf
    after: int = 0
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)


class _Axes:
    """Node positions of a scene along its axes, and the selection of nodes by position."""

    def __init__(self, scene: Scene) -> None:
        self.grid = grid = scene.grid
        self.positions = [
            node_positions(scene.scheme.basis, n, periodic, c0_lines(grid, scene.walls, axis))
            for axis, (n, periodic) in enumerate(zip(grid.shape, grid.periodic, strict=True))
        ]

    def cells(self, axis: int, at: float) -> float:
        """Convert a coordinate [m] to cells from the lower end of the axis."""
        return (at - self.grid.lower[axis]) / self.grid.cell

    def within(self, axis: int, low: float, high: float) -> IndexArray:
        """Indices of the nodes from `low` to `high` [cells], ends included."""
        x = self.positions[axis]
        slack = self.grid.slack
        inside = (x >= low - slack) & (x <= high + slack)
        if self.grid.periodic[axis]:  # node 0 is also node n
            inside |= x + self.grid.shape[axis] <= high + slack
        return np.flatnonzero(inside)

    def of(self, wall: WallOrBlock) -> Ranges:
        """Nodes on a wall, or in and at a block."""
        extents = (wall.extent(self.grid, axis) for axis in range(self.grid.dim))
        return tuple(
            self.within(axis, *(self.cells(axis, end) for end in ends))
            for axis, ends in enumerate(extents)
        )

    def driven(self, inflow: Inflow, basis: str) -> Ranges:
        """Nodes that points of a driven inflow touch, but for those downstream of its region."""
        ranges, reach = [], REACH[basis] - self.grid.slack * 10
        for axis, ends in enumerate(zip(*inflow.region.bounds, strict=True)):
            low, high = (self.cells(axis, end) for end in ends)
            sign = inflow.velocity[axis] if axis == inflow.axis else 0.0
            ranges.append(self.within(axis, low - reach * (sign >= 0), high + reach * (sign <= 0)))
        return tuple(ranges)


REACH = {"linear": 1.0, "ugimp": 1.5, "quadratic": 1.5}
"""Largest distance of a node from the points that it touches [cells]."""


def driven(scene: Scene) -> list[Inflow]:
    """List the driven inflows of a scene."""
    return [inflow for inflow in scene.inflows if inflow.driven]


def _wall_hold(wall: WallOrBlock, axis: int, grid: Grid) -> WallRow:
    """Row of a wall normal to an axis."""
    everything, normal = (1 << grid.dim) - 1, 1 << axis
    if wall.rule.sticks:
        vx, vy, vz = (*(wall.velocity or ()), 0.0, 0.0, 0.0)[:3]
        return WallRow(fixed=everything, opens_at=wall.opens_at, velocity=(vx, vy, vz))
    if not wall.rule.rubs:
        return WallRow(fixed=normal, opens_at=wall.opens_at)
    line = grid.line("at", axis, wall.extent(grid, axis)[0])
    side = 1 if line == 0 else -1 if line == grid.shape[axis] else 0
    ax, ay, az = (side if d == axis else 0 for d in range(3))
    fx, fy, fz = (wall.friction if d == axis else 0.0 for d in range(3))
    return WallRow(normal, (ax, ay, az), (fx, fy, fz), wall.opens_at)


Where = tuple[IndexArray, ...] | BoolArray
"""Index into an array with a value for each class of nodes."""


class WallNodes:
    """Nodes of a scene by classes: walls, blocks and faces have all nodes of a class or none.

    Attributes
    ----------
    zeros : GridMap
        Zero for each class.
    where : list
        Index into its values for each of `Scene.boundaries`.
    driven : list
        The same for each driven inflow.
    """

    def __init__(self, scene: Scene) -> None:
        axes = _Axes(scene)
        self._walls, self._everything = scene.boundaries, (1 << scene.grid.dim) - 1
        self._solid = solid_cells(scene.grid, scene.walls)
        self._outlooks = [
            outlook(*along)
            for along in zip(axes.positions, self._solid.classes, scene.grid.periodic, strict=True)
        ]
        ranges = [axes.of(wall) for wall in scene.boundaries]
        moved = [axes.driven(inflow, scene.scheme.basis) for inflow in driven(scene)]
        cuts = None
        if any(map(_slips, scene.walls)):
            cuts = [
                np.flatnonzero(np.diff(outlook_).any(axis=0)) + 1 for outlook_ in self._outlooks
            ]
        self.zeros = GridMap.zeros([len(x) for x in axes.positions], [*ranges, *moved], cuts)
        self.where: list[Where] = [self.zeros.of(nodes) for nodes in ranges]
        self.driven: list[Where] = [self.zeros.of(nodes) for nodes in moved]

    def block_holds(self) -> Iterator[tuple[Where, WallRow]]:
        """Yield the components that blocks hold; faces are those of the union of all blocks."""
        slips = np.zeros(self.zeros.values.shape, dtype=bool)
        for wall, where in zip(self._walls, self.where, strict=True):
            if _slips(wall):
                slips[where] = True
            elif wall.is_block:
                yield where, WallRow(fixed=self._everything)
        if slips.any():
            firsts = zip(self._outlooks, self.zeros.firsts(), strict=True)
            held = held_components(self._solid, [outlook_[:, first] for outlook_, first in firsts])
            for fixed in np.unique(held[slips]):
                yield slips & (held == fixed), WallRow(fixed=int(fixed))


def _slips(wall: WallOrBlock) -> bool:
    """True for a free-slip block."""
    return wall.is_block and wall.slips


T = TypeVar("T")


def collected(
    shape: tuple[int, ...], parts: Iterable[tuple[Where, T]]
) -> tuple[NDArray[np.int32], list[frozenset[T]]]:
    """Collect the members of each entry of an array: numbers of sets, and the sets."""
    state = np.zeros(shape, dtype=np.int32)
    known: dict[frozenset[T], int] = {frozenset(): 0}
    for where, thing in parts:
        old, places = np.unique(state[where], return_inverse=True)
        sets = list(known)
        new = [known.setdefault(sets[i] | {thing}, len(known)) for i in old]
        if new:
            state[where] = np.array(new, dtype=np.int32)[places].reshape(state[where].shape)
    return state, list(known)


class _Rows:
    """Table of the rows made so far, without repetitions."""

    def __init__(self, dim: int) -> None:
        self.everything = (1 << dim) - 1
        self.codes: dict[WallRow, int] = {}

    def code(self, holds: frozenset[WallRow]) -> int:
        """Code of a node with these constraints; makes its row, and the rows after openings."""
        if not holds:
            return 0
        opens_at = min(hold.opens_at for hold in holds)
        after = 0
        if opens_at < math.inf:
            after = self.code(frozenset(hold for hold in holds if hold.opens_at > opens_at))
        fixed = functools.reduce(operator.or_, (hold.fixed for hold in holds))
        away = _in_common(holds, lambda hold: hold.away, 0)
        fx, fy, fz = (max(hold.friction[d] for hold in holds) for d in range(3))
        if fixed == self.everything and not any(away):
            fx = fy = fz = 0.0  # no component is left for friction
        velocity = _in_common(holds, lambda hold: hold.velocity, 0.0)
        row = WallRow(fixed, away, (fx, fy, fz), velocity=velocity)
        if after:  # if another wall holds the node after the opening, there is no change
            remaining = list(self.codes)[after - 1]
            if remaining._replace(opens_at=math.inf, after=0) == row:
                return after
        row = row._replace(opens_at=opens_at, after=after)
        return self.codes.setdefault(row, len(self.codes) + 1)

    def driven_code(self, inflow: Inflow, holds: frozenset[WallRow]) -> int:
        """Code of a node of a driven inflow, at which other constraints count when it has ended."""
        end, after = inflow.times[1], 0
        if end < math.inf:
            after = self.code(frozenset(hold for hold in holds if hold.opens_at > end))
        vx, vy, vz = (*inflow.velocity, 0.0)[:3]
        row = WallRow(self.everything, opens_at=end, after=after, velocity=(vx, vy, vz))
        return self.codes.setdefault(row, len(self.codes) + 1)


def _in_common(
    holds: frozenset[WallRow], of: Callable[[WallRow], tuple[T, T, T]], zero: T
) -> tuple[T, T, T]:
    """Vector that the constraints on a node have in common; zero where components differ."""
    x, y, z = (
        values.pop() if len(values) == 1 else zero
        for d in range(3)
        for values in [{of(hold)[d] for hold in holds if hold.fixed >> d & 1}]
    )
    return x, y, z


def node_codes(scene: Scene) -> tuple[GridMap, tuple[WallRow, ...]]:
    """Codes of the nodes by the walls and blocks of a scene.

    A wall acts on the nodes on its line and within its span, ends included. Constraints on one node
    add up, and so do the frictions of Coulomb walls that are normal to different axes; of those
    normal to one the highest counts. A component in which walls have different velocities rests. At
    a driven inflow its velocity alone counts. When a wall opens, or such an inflow ends, the node
    changes to the code `after`, the row of which has the remaining constraints.

    Returns
    -------
    codes : GridMap
        0 for a free node, else 1 + the index of its row.
    rows : tuple of WallRow
        At most 255; some may be in use only after an opening.

    Raises
    ------
    ValueError
        If a wall does not lie on grid lines, or more than 255 different rows are needed.
    """
    nodes, grid = WallNodes(scene), scene.grid
    holds: list[tuple[Where, WallRow]] = [
        (where, _wall_hold(wall, wall.axis, grid))
        for wall, where in zip(scene.boundaries, nodes.where, strict=True)
        if wall.axis is not None
    ]
    codes = nodes.zeros
    state, sets = collected(codes.values.shape, [*holds, *nodes.block_holds()])
    rows = _Rows(grid.dim)
    code_of = np.zeros(len(sets), dtype=np.int64)
    for i in np.unique(state):
        code_of[i] = rows.code(sets[i])
    values = code_of[state]
    for inflow, where in zip(driven(scene), nodes.driven, strict=True):
        driven_codes = {i: rows.driven_code(inflow, sets[i]) for i in np.unique(state[where])}
        values[where] = np.vectorize(driven_codes.__getitem__, otypes=[np.int64])(state[where])
    if len(rows.codes) > MAX_ROWS:
        raise ValueError(f"walls make {len(rows.codes)} kinds of nodes, must be <= {MAX_ROWS}")
    return codes._replace(values=values.astype(np.uint8)), tuple(rows.codes)
