"""Density correction: pressure modes that cells damp, and shifting of particles at walls."""

import numpy as np
import pytest
from same_bits import same_bits
from stages import disturbed, living

import granular as gr
from granular import Gravity
from granular.mpm.cell_codes import FLAG_WALL, cell_flags

CELL_AVERAGED = ("linear", "tpic", "cell_averaged")
MEAN, PART = 1e-3, 1e-4
"""Mean log-density of the layer, and the amplitude of its variation between cells."""


def stepped(scene, pattern):
    """Change of c in a step from rest, in cells ordered by position, and the factor r/(1 + r)."""
    scene = scene.replace(gravity=Gravity((0.0,), ((0.0,) * scene.dim,)))
    sim = gr.Simulation(scene, threads=1)
    at, cell = living(sim), scene.grid.cell
    place = np.floor((sim.buffers["x"][:, at].T - scene.grid.lower) / cell).astype(int)
    c = MEAN + PART * pattern(place)
    sim.buffers["log_density"][0, at] = c
    sim.buffers["stress"][:3, at] = -scene.material.K * c
    sim.step()
    r = sim.dt * scene.scheme.density.diffusion * scene.material.wave_speed / cell
    return place, (sim.buffers["log_density"][0, living(sim)] - c) / PART, r / (1 + r)


@pytest.fixture
def still(small_scene):
    """A regular layer four cells high on a no-slip floor, without relaxation and shifting."""

    def make(dim):
        return small_scene(
            "periodic", dim, CELL_AVERAGED, jitter=0.0, relaxation=0.0, shifting=0.0, diffusion=0.5
        )

    return make


def test_a_pressure_that_alternates_is_taken_away(still):
    """The second row loses the fraction r/(1 + r), the row at the floor half of it."""
    place, change, share = stepped(still(2), lambda at: (-1.0) ** at.sum(axis=1))
    sign = (-1.0) ** place.sum(axis=1)
    second, floor = place[:, 1] == 1, place[:, 1] == 0
    np.testing.assert_allclose(change[second], -share * sign[second], rtol=1e-9)
    np.testing.assert_allclose(change[floor], -share * sign[floor] / 2, rtol=1e-9)


def test_a_linear_pressure_is_left(still, dim):
    """A linear pressure moves cells at both ends, with or without exchange between neighbours."""
    scene = still(dim)
    alone = scene.replace(
        scheme=scene.scheme.replace(density=scene.scheme.density.replace(diffusion=0.0))
    )
    _, change, share = stepped(scene, lambda at: -at[:, -1].astype(float))
    _, expected, _ = stepped(alone, lambda at: -at[:, -1].astype(float))
    assert share > 0.1
    np.testing.assert_allclose(change, expected, atol=1e-9)


def test_same_bits_with_any_number_of_threads():
    """Some cells read their neighbours while others already transfer to the nodes (P2G)."""
    scheme = gr.schemes.cell_averaged
    same_bits(
        gr.scenes.column_collapse(aspect=1.0, cell=0.0125, scheme=scheme, jitter=0.5), 100, 200
    )


def test_points_that_leave_a_cell_do_not_change_what_its_neighbours_read(small_scene, dim):
    """The number of points of a cell changes while its neighbours are updated by other threads."""
    scene = small_scene("outlet", dim, CELL_AVERAGED, E=1e5, shifting=8.0)
    found = []
    for threads in (1, 2):
        sim = gr.Simulation(scene, threads=threads)
        sim.step(60)
        found.append({name: a.tobytes() for name, a in sim.checkpoint().arrays.items()})
    assert found[0] == found[1]


# ---- particle shifting out of over-compressed regions ----

CELL = 0.1
WALL = 3 * CELL
"""Position of the inner wall of the scene "walls", which is up to two cells high."""


@pytest.mark.parametrize("distance", [1e-4, 1e-12])
@pytest.mark.parametrize(
    "combination", [("quadratic", "tpic", "smoothed"), CELL_AVERAGED], ids="-".join
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
    blocked, free = base.replace(walls=(*base.walls, block)), base
    flags = cell_flags(blocked).dense() ^ cell_flags(free).dense()
    sides = {(2, 3): 1 << 0, (2, 1): 1 << 1, (3, 2): 1 << 2, (1, 2): 1 << 3}  # y, x of cells
    for place, side in sides.items():
        assert flags[place] // FLAG_WALL == side
    assert flags[2, 2] & 1
    assert np.count_nonzero(flags) == 5
