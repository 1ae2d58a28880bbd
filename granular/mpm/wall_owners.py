"""Which wall of a scene the impulse on a node counts for, component by component."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from granular.mpm.node_codes import WallNodes, collected, driven
from granular.tools.arrays import Array

if TYPE_CHECKING:
    from granular.mpm.scene import Scene


class WallOwners(NamedTuple):
    """Owners of the components of the impulse on each node; the core has these arrays.

    Attributes
    ----------
    codes : ndarray of int32, shape (..., classes along y, along x)
        Row of each class of nodes, the classes being those of `node_codes`; row 0 is for nodes
        without a wall.
    owners : ndarray of int32, shape (rows, 3)
        Index into the walls of the scene for each component, and beyond them into its driven
        inflows; -1 for none.
    opens_at : ndarray, shape (rows,)
        Time [s] from which the row `after` holds; inf for never.
    after : ndarray of int32, shape (rows,)
    """

    codes: NDArray[np.int32]
    owners: NDArray[np.int32]
    opens_at: Array
    after: NDArray[np.int32]


def wall_owners(scene: Scene) -> WallOwners:
    """Find the owners of the impulse on each node.

    Where several walls and blocks meet, a component counts for the first of these: a wall to which
    it is normal; a no-slip wall; a no-slip block; the Coulomb wall with the highest friction; a
    block. Of several of one kind the first one of the scene counts. A driven inflow comes before
    all of them.
    """
    nodes = WallNodes(scene)
    # Nothing owns what acts on the axis of symmetry: its radial force has no meaning.
    places = enumerate([*nodes.where[: len(scene.walls)], *nodes.driven])
    state, sets = collected(nodes.zeros.values.shape, ((where, i) for i, where in places))
    ends = [
        *(wall.opens_at for wall in scene.walls),
        *(inflow.times[1] for inflow in driven(scene)),
    ]
    rows: list[tuple[list[int], float, frozenset[int]]] = []
    numbers: dict[frozenset[int], int] = {}
    waiting = list(sets)
    while waiting:
        walls = waiting.pop(0)
        if walls in numbers:
            continue
        numbers[walls] = len(rows)
        opens_at = min((ends[i] for i in walls), default=math.inf)
        left = frozenset(i for i in walls if ends[i] > opens_at)
        rows.append(([_owner(scene, walls, d) for d in range(3)], opens_at, left))
        if opens_at < math.inf:
            waiting.append(left)
    return WallOwners(
        np.array([numbers[walls] for walls in sets], dtype=np.int32)[state],
        np.array([owners for owners, _, _ in rows], dtype=np.int32),
        np.array([opens_at for _, opens_at, _ in rows]),
        np.array([numbers[left] if at < math.inf else 0 for _, at, left in rows], dtype=np.int32),
    )


def _owner(scene: Scene, walls: frozenset[int], axis: int) -> int:
    """Index of the wall that a component counts for, -1 for none."""

    def rank(i: int) -> tuple[float, ...]:
        if i >= len(scene.walls):
            return (-1.0, 0.0, i)
        return (*scene.walls[i].order(axis), i)

    best = min(walls, key=rank, default=-1)
    return best if best >= 0 and rank(best)[0] < math.inf else -1
