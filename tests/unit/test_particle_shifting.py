"""Particle shifting out of over-compressed regions, at walls."""

import numpy as np
import pytest
from test_kernels import disturbed, living

import granular as gr
from granular.mpm.cell_codes import FLAG_WALL, cell_flags

CELL = 0.1
WALL = 3 * CELL
"""Position of the inner wall of the scene "walls", which is up to two cells high."""


@pytest.mark.parametrize("distance", [1e-4, 1e-12])
@pytest.mark.parametrize(
    "combination",
    [("quadratic", "tpic", "smoothed"), ("linear", "tpic", "cell_averaged")],
    ids="-".join,
)
def test_the_shift_carries_no_point_through_an_inner_wall(small_scene, combination, dim, distance):
    """Over-compressed points behind the points at a wall shift these towards it."""
    scene = small_scene("walls", dim, combination)
    sim = disturbed(scene)
    at, buffers = living(sim), sim.buffers
    x, height = buffers["x"][0], buffers["x"][-1]
    beside = at[(abs(x[at] - WALL) < 0.5 * CELL) & (height[at] < 1.9 * CELL)]
    side = np.sign(x[beside] - WALL)
    assert min((side > 0).sum(), (side < 0).sum()) >= 3
    x[beside] = WALL + side * distance * CELL
    ids = buffers["id"][beside]
    # over-compressed except at the wall
    buffers["mass"][0, at] *= np.where(np.isin(at, beside), 0.5, 1.8)

    sim.step(1)
    state = sim.state
    place = np.searchsorted(state.id, ids)
    np.testing.assert_array_equal(np.sign(state.x[place, 0] - WALL), side)
    moved = abs(state.x[place, 0] - WALL) / (distance * CELL) - 1
    assert abs(moved).max() > 1e-3, "nothing was tried"


def test_faces_of_blocks_hold_the_shift_as_walls_do(small_scene):
    """The cells around a block of one cell know on which side the block is."""
    base = small_scene("periodic", 2, ("quadratic", "tpic", "smoothed"))
    low, cell = np.array(base.grid.lower), base.grid.cell
    block = gr.mpm.walls.Solid(tuple(low + 2 * cell), tuple(low + 3 * cell))
    flags = cell_flags(base.replace(walls=(*base.walls, block))) ^ cell_flags(base)
    sides = {(2, 3): 1 << 0, (2, 1): 1 << 1, (3, 2): 1 << 2, (1, 2): 1 << 3}  # y, x of cells
    for place, side in sides.items():
        assert flags[place] // FLAG_WALL == side
    assert flags[2, 2] & 1
    assert np.count_nonzero(flags) == 5
