"""C0 lines, node positions and codes by hand on tiny grids; sponge layers."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scenes_by_hand import scene_with
from schemes_by_name import scheme_of
from scipy.interpolate import BSpline

import granular as gr
from granular import Box, Fill, Gravity, Grid, Scheme, Solid, SpongeLayer, Wall
from granular.mpm.axis_nodes import c0_lines, node_positions
from granular.mpm.node_codes import WallRow, node_codes

BASES = ("linear", "ugimp", "quadratic")


def coded(walls, *, shape=(3, 2), basis="linear", periodic=(), lower=None):
    """Node codes of a scene with unit cells and without material."""
    grid = Grid(lower or (0.0,) * len(shape), 1.0, shape, periodic)
    scheme = Scheme(basis=basis)
    scene = SimpleNamespace(grid=grid, walls=walls, boundaries=walls, scheme=scheme, inflows=())
    codes, rows = node_codes(scene)
    return codes.dense(), rows


def fixed(walls, **options):
    """`fixed` of each node, as nested lists with the last axis first."""
    codes, rows = coded(walls, **options)
    return np.array([0, *(row.fixed for row in rows)])[codes].tolist()


# --- node positions


def test_positions_by_hand():
    assert node_positions("linear", 3, False).tolist() == [0, 1, 2, 3]
    assert node_positions("ugimp", 3, True, (1,)).tolist() == [0, 1, 2]
    assert node_positions("quadratic", 3, False).tolist() == [0, 0.5, 1.5, 2.5, 3]
    assert node_positions("quadratic", 4, False, (2,)).tolist() == [0, 0.5, 1.5, 2, 2.5, 3.5, 4]
    assert node_positions("quadratic", 3, True).tolist() == [0.5, 1.5, 2.5]
    assert node_positions("quadratic", 1, False).tolist() == [0, 0.5, 1]


@pytest.mark.parametrize("lines", [(), (1,), (3, 4), (1, 2, 6)])
def test_splines_with_values_at_these_nodes_reproduce_linear_fields(lines):
    n = 7
    knots = np.sort([0.0, 0, 0, *range(1, n), n, n, n, *lines])
    nodes = node_positions("quadratic", n, False, lines)
    assert len(nodes) == n + 2 + len(lines)
    x = np.linspace(0, n, 41)[:-1] + 0.01
    assert np.allclose(BSpline(knots, 3 * nodes - 1, 2)(x), 3 * x - 1, atol=1e-13)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (("cubic", 3, False), ValueError, "basis"),
        (("linear", 0, False), ValueError, "n_cells = 0"),
        (("quadratic", 3, False, (3,)), ValueError, "c0_lines = 3"),
        (("quadratic", 3, False, (2, 1)), ValueError, "must ascend"),
        (("quadratic", 3, False, (1, 1)), ValueError, "must ascend"),
        (("quadratic", 3, True, (1,)), ValueError, "periodic axis"),
    ],
)
def test_positions_refuse(arguments, error, message):
    with pytest.raises(error, match=message):
        node_positions(*arguments)


# --- c0_lines


def test_c0_lines_at_inner_walls_and_ends_of_spans():
    grid = Grid((-1.0, 0.0), 0.5, (6, 4))
    walls = [
        Wall(0, -1.0),  # domain walls over their whole length make no C0 line
        Wall(1, 2.0),
        Wall(1, 0.0, span=((0.0, 2.0),)),  # floor with an opening: x = 0 is line 2
        Wall(1, 0.0, opens_at=0.1),
        Wall(0, 1.0, span=((0.5, 1.0),)),  # inner wall: x line 4, y lines 1 and 2
        Wall(1, 1.5),  # inner wall over the whole width: y line 3
        Solid((-0.5, 0.5), (0.5, 1.0)),
    ]
    assert c0_lines(grid, walls, 0) == (2, 4)
    assert c0_lines(grid, walls, 1) == (1, 2, 3)
    assert c0_lines(grid, [], 0) == ()


@pytest.mark.parametrize("periodic", [False, True])
def test_a_block_across_the_domain_has_a_c0_line_on_its_faces(periodic):
    grid = Grid((-1.0, 0.0), 0.5, (6, 4), periodic=(periodic, False))
    floor, ceiling = Solid((-1.0, 0.0), (2.0, 0.5)), Solid((-1.0, 1.5), (2.0, 2.0))
    assert c0_lines(grid, [floor, ceiling], 1) == (1, 3)
    assert c0_lines(grid, [floor, ceiling], 0) == ()
    assert c0_lines(grid, [Solid((-1.0, 0.0), (1.5, 0.5))], 1) == ()  # not all the way across
    assert c0_lines(grid, [Solid((0.0, 0.0), (0.5, 2.0))], 0) == (() if periodic else (2, 3))


def test_a_wall_off_the_grid_lines_is_refused():
    grid = Grid((0.0, 0.0), 0.1, (10, 10))
    with pytest.raises(ValueError, match=r"walls\[0\].* = 0.25 must lie on a grid line of x"):
        c0_lines(grid, [Wall(0, 0.25)], 0)
    assert c0_lines(grid, [Wall(0, 0.1 + 0.2)], 0) == (3,)  # rounding errors are accepted


# --- node codes


def test_no_slip_floor_and_symmetry_plane():
    walls = (Wall(1, 0.0, kind="no_slip"), Wall(0, 0.0, kind="free_slip"))
    assert fixed(walls) == [[3, 3, 3, 3], [1, 0, 0, 0], [1, 0, 0, 0]]
    assert fixed(walls, basis="ugimp") == fixed(walls)
    assert fixed(walls, basis="quadratic") == [[3, 3, 3, 3, 3], *[[1, 0, 0, 0, 0]] * 3]
    codes, rows = coded(walls)
    assert codes.dtype == np.uint8 and codes.flags.c_contiguous
    assert sorted(row.fixed for row in rows) == [1, 3]


@pytest.mark.parametrize("basis", BASES)
def test_orifice_opens(basis):
    walls = (Wall(1, 0.0, span=((2.0, 4.0),)), Wall(1, 0.0, opens_at=0.1))
    codes, rows = coded(walls, shape=(4, 2), basis=basis)
    floor = [rows[code - 1] for code in codes[0]]
    # quadratic nodes: 0, 0.5, 1.5 | 2, 2.5, 3.5, 4
    lids = 3 if basis == "quadratic" else 2
    assert floor[:lids] == [WallRow(fixed=3, opens_at=0.1, after=0)] * lids
    assert all(row == WallRow(fixed=3) for row in floor[lids:])
    assert len(floor) == (7 if basis == "quadratic" else 5)
    assert not codes[1:].any()


@pytest.mark.parametrize("basis", BASES)
def test_inner_wall_acts_on_its_line_and_span_only(basis):
    got = np.array(fixed((Wall(1, 1.0, kind="free_slip", span=((1.0, 2.0),)),), basis=basis))
    x = node_positions(basis, 3, False, (1, 2))
    y = node_positions(basis, 2, False, (1,))
    wanted = 2 * np.outer(y == 1.0, (x >= 1.0) & (x <= 2.0))
    assert got.tolist() == wanted.tolist()
    assert wanted.sum() == (6 if basis == "quadratic" else 4)  # nodes 1, 1.5, 2 or 1, 2


def test_coulomb_walls_let_material_leave_at_the_ends_of_the_grid():
    walls = [Wall(1, y, kind="coulomb", friction=0.3) for y in (0.0, 1.0, 2.0)]
    codes, rows = coded(walls)
    assert [rows[codes[j, 1] - 1].away[1] for j in range(3)] == [1, 0, -1]
    assert all((row.fixed, row.friction) == (2, (0.0, 0.3, 0.0)) for row in rows)


def test_coulomb_in_corners():
    rough = (Wall(1, 0.0, kind="coulomb", friction=0.3), Wall(0, 0.0, kind="no_slip"))
    codes, rows = coded(rough)
    assert rows[codes[0, 0] - 1] == WallRow(fixed=3)  # no free direction is left for friction
    edge = (
        Wall(0, 0.0, kind="coulomb", friction=0.2),
        Wall(1, 0.0, kind="coulomb", friction=0.4),
        Wall(2, 1.0, kind="free_slip"),
    )
    codes, rows = coded(edge, shape=(1, 1, 1))
    assert rows[codes[0, 0, 0] - 1] == WallRow(fixed=3, away=(1, 1, 0), friction=(0.2, 0.4, 0))
    assert rows[codes[1, 0, 0] - 1] == WallRow(fixed=7, away=(1, 1, 0), friction=(0.2, 0.4, 0))
    assert rows[codes[1, 1, 0] - 1] == WallRow(fixed=5, away=(1, 0, 0), friction=(0.2, 0, 0))


def test_walls_that_open_one_after_the_other_are_chained():
    walls = (
        Wall(1, 0.0, kind="no_slip", opens_at=2.0),
        Wall(0, 0.0, kind="free_slip"),
        Wall(0, 0.0, kind="free_slip", opens_at=1.0),
        Wall(1, 0.0, kind="coulomb", friction=0.5, opens_at=3.0),
    )
    codes, rows = coded(walls)

    def history(code):
        while code:
            row = rows[code - 1]
            yield row.fixed, row.friction[1], row.opens_at
            code = row.after

    # where nothing changes at an opening there is no additional row
    assert list(history(codes[0, 0])) == [(3, 0.0, 2.0), (3, 0.5, 3.0), (1, 0.0, math.inf)]
    assert list(history(codes[0, 1])) == [(3, 0.0, 2.0), (2, 0.5, 3.0)]
    assert list(history(codes[1, 0])) == [(1, 0.0, math.inf)]
    assert not codes[1, 1]


def test_periodic_axis():
    floor = (Wall(1, 0.0, kind="free_slip", span=((1.0, 3.0),)),)
    assert fixed(floor, periodic=(True, False))[0] == [2, 2, 2]  # x = 3 is node 0
    assert fixed((Wall(1, 0.0),), periodic=(True, False), basis="quadratic")[0] == [3, 3, 3]
    with pytest.raises(ValueError, match="periodic axis"):
        fixed(floor, periodic=(True, False), basis="quadratic")


def test_blocks_by_faces():
    block = (Solid((1.0, 0.0), (2.0, 1.0), kind="no_slip"),)
    assert fixed(block) == [[0, 3, 3, 0], [0, 3, 3, 0], [0, 0, 0, 0]]
    block = (Solid((1.0, 1.0), (4.0, 4.0), kind="free_slip"),)
    faces = np.pad([[3, 2, 2, 3], [1, 3, 3, 1], [1, 3, 3, 1], [3, 2, 2, 3]], 1)
    assert fixed(block, shape=(5, 5)) == faces.tolist()
    # quadratic splines, which let material slide along the faces: nodes at 0, 0.5, ..., 4.5, 5;
    # inside from 1.5; 0.5 deep at 1.5 and 3.5, 1.5 deep at 2.5
    inner = np.array(fixed(block, shape=(5, 5), basis="quadratic"))
    assert inner[2:5, 2:5].tolist() == [[3, 2, 3], [1, 3, 1], [3, 2, 3]]
    assert inner.sum() == inner[2:5, 2:5].sum()


def test_ends_of_the_grid_are_no_faces_of_a_block():
    block = (Solid((1.0, 0.0), (3.0, 1.0), kind="free_slip"),)
    assert fixed(block) == [[0, 1, 3, 3], [0, 3, 2, 2], [0, 0, 0, 0]]
    across = (Solid((0.0, 0.0), (3.0, 1.0), kind="free_slip"),)
    assert fixed(across, periodic=(True, False)) == [[3, 3, 3], [2, 2, 2], [0, 0, 0]]


def test_nested_blocks_make_a_staircase():
    blocks = tuple(Solid((line, 0.0), (4.0, line), kind="free_slip") for line in (1.0, 2.0, 3.0))
    codes = fixed(blocks, shape=(4, 4))
    assert codes[1][1] == 3 and codes[2][2] == 3 and codes[3][3] == 3  # edges of the steps
    assert codes[1][2] == 3 and codes[2][3] == 3  # feet of the steps
    assert codes[2][1] == codes[3][2] == 0  # above the steps
    assert codes[3][4] == 2  # tread


def endless_across(n_x, n_up, dim):
    """Shape and periodic axes of a grid that is in 3D endless along its middle axis."""
    if dim == 2:
        return {"shape": (n_x, n_up)}
    return {"shape": (n_x, 2, n_up), "periodic": (False, True, False)}


def rows_of_rock(reaches, dim, kind="free_slip"):
    """Rows of rock one cell thick; row j reaches from x = 0 to reaches[j]."""
    across = [(0.0, 2.0)] * (dim - 2)
    return [
        Solid(*zip((0.0, reach), *across, (j, j + 1.0), strict=True), kind=kind)
        for j, reach in enumerate(reaches)
        if reach
    ]


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("basis", BASES)
def test_rows_of_blocks_hold_what_the_columns_of_the_same_rock_hold(basis, dim):
    """The union counts, not how it is cut; an overhang, steps down and up, a notch."""
    reaches = [4.0, 5.0, 2.0, 2.0, 3.0, 1.0]
    across = [(0.0, 2.0)] * (dim - 2)
    columns = [
        Solid(*zip((x, x + 1.0), *across, (j, j + 1.0), strict=True), kind="free_slip")
        for x in range(5)
        for j, reach in enumerate(reaches)
        if x < reach
    ]
    options = endless_across(6, 7, dim) | {"basis": basis}
    assert fixed(rows_of_rock(reaches, dim), **options) == fixed(columns, **options)


@pytest.mark.parametrize("dim", [2, 3])
def test_rock_of_rows_is_held_within(dim):
    """By hand, for splines: nodes at 0, 0.5, 1.5, ... of rock with a step from 4 to 2 at y = 2."""
    options = {"periodic": (False, True, False)} if dim == 3 else {}
    shape = (6, 2, 5) if dim == 3 else (6, 5)
    got = np.array(
        fixed(rows_of_rock([4, 4, 2, 2], dim), shape=shape, basis="quadratic", **options)
    )
    if dim == 3:
        assert (got[:, 0] == got[:, 1]).all()
        got = got[:, 0]
    x, up, all_of = 1, 2 ** (dim - 1), 2**dim - 1
    edge = x | up
    # floor (0), 0.5, 1.5 (tread), 2.5, 3.5 (top)
    wanted = [
        [all_of, all_of, all_of, all_of, x],
        [all_of, all_of, all_of, all_of, x],
        [all_of, all_of, edge, up, edge],
        [all_of, all_of, x, 0, 0],
        [up, up, edge, 0, 0],
    ]
    assert got[:5, :5].tolist() == wanted


def test_more_rows_than_a_byte_holds_are_refused():
    walls = tuple(
        Wall(1, 0.0, kind="coulomb", friction=1e-3 * (i + 1), span=((i, i + 1.0),))
        for i in range(255)
    )
    codes, rows = coded(walls, shape=(255, 1))
    assert len(rows) == 255 and codes.max() == 255
    more = (*walls, Wall(1, 1.0, kind="no_slip"))
    with pytest.raises(ValueError, match="256 kinds of nodes, must be <= 255"):
        coded(more, shape=(255, 1))


def test_shape_of_codes_in_3d_is_z_y_x():
    codes, rows = coded((Wall(2, 0.0),), shape=(1, 2, 3))
    assert codes.shape == (4, 3, 2)
    assert (codes[0] == 1).all() and not codes[1:].any() and rows == (WallRow(fixed=7),)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_spans_in_3d_follow_the_order_of_the_other_axes(axis):
    wall = Wall(axis, 0.0, kind="free_slip", span=((0.0, 1.0), (2.0, 3.0)))
    codes, _ = coded((wall,), shape=(3, 3, 3))
    found = np.argwhere(codes.transpose(2, 1, 0))  # in the order x, y, z
    first, second = (a for a in range(3) if a != axis)
    assert len(found) == 4 and not found[:, axis].any()
    assert set(found[:, first]) == {0, 1} and set(found[:, second]) == {2, 3}


def test_a_shifted_grid_has_the_same_codes():
    walls = (Wall(1, -2.0), Wall(0, 6.0, kind="free_slip", span=((-1.0, 0.0),)))
    assert fixed(walls, lower=(5.0, -2.0)) == [[3, 3, 3, 3], [0, 1, 0, 0], [0, 1, 0, 0]]


# --- gravity and the parts themselves


def test_gravity_is_linear_between_and_held_outside():
    g = Gravity((0.0, 0.1, 0.2), ((0, 0), (0, -9.8), (2, -9.8)))
    assert g.at(0.05).tolist() == [0.0, -4.9]
    assert g.at(0.15) == pytest.approx([1.0, -9.8])
    assert g.at(-1.0).tolist() == [0, 0] and g.at(7.0).tolist() == [2, -9.8]
    assert Gravity().at(1.0).tolist() == [0.0, -9.8]
    assert Gravity((0.0,), ((0, 0, -9.8),)).dim == 3


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Wall(3, 0.0), ValueError, "axis = 3"),
        (lambda: Wall(2, 0.0, span=((0, 1),)), ValueError, "axis = 2"),
        (lambda: Wall(0.0, 0.0), TypeError, "axis = 0.0"),
        (lambda: Wall(0, math.nan), ValueError, "at = nan"),
        (lambda: Wall(0, 0.0, kind="smooth"), ValueError, "kind = 'smooth'"),
        (lambda: Wall(0, 0.0, friction=0.3), ValueError, 'must be 0 unless kind is "coulomb"'),
        (lambda: Wall(0, 0.0, kind="coulomb", friction=-1), ValueError, "friction = -1.0"),
        (lambda: Wall(0, 0.0, span=((1, 0),)), ValueError, "low end first"),
        (lambda: Wall(0, 0.0, span=(0, 1)), TypeError, "span"),
        (lambda: Wall(0, 0.0, span=()), ValueError, "span"),
        (lambda: Wall(0, 0.0, opens_at=-1.0), ValueError, "opens_at = -1.0"),
        (lambda: Solid((0, 0), (0, 1)), ValueError, r"upper\[0\] = 0.0 must exceed"),
        (lambda: Solid((0, 0), (1, 1), kind="coulomb"), ValueError, "kind = 'coulomb'"),
        (lambda: SpongeLayer(1, math.inf), ValueError, "above = inf"),
        (lambda: SpongeLayer(1, 0.5, 0.0), ValueError, "damping = "),
        (lambda: SpongeLayer(1, 0.5, -1.0), ValueError, "damping = "),
        (lambda: SpongeLayer(1, 0.5, math.nan), ValueError, "damping = "),
        (lambda: Gravity((0.0, 0.0), ((0, 0), (0, 1))), ValueError, "must ascend"),
        (lambda: Gravity((0.0,), ((0, 0), (0, 1))), ValueError, "as many as vectors"),
        (lambda: Gravity((), ()), ValueError, "at least one"),
        (lambda: Gravity((0.0, 1.0), ((0, 0), (0, 0, 1))), ValueError, r"vectors\[1\]"),
        (lambda: Gravity((0.0,), (-9.8,)), TypeError, r"vectors\[0\]"),
        (lambda: Gravity().at(math.nan), ValueError, "t = nan"),
    ],
)
def test_parts_refuse(make, error, message):
    with pytest.raises(error, match=message):
        make()


# ---- sponge layers ----


SCHEMES = [
    ("linear", "flip", "particle"),
    ("linear", "tpic", "cell_averaged"),
    ("quadratic", "apic", "particle"),
    ("quadratic", "tpic", "smoothed"),
]


def moved(velocity, sponge, combination, steps=10):
    """A cloud without weight that moves as a whole, in the middle of 8 m by 8 m."""
    basis, transfer, density = combination
    scene = scene_with(
        grid=Grid((0.0, 0.0), 1.0, (8, 8)),
        fills=(Fill(Box((2.0, 2.0), (6.0, 6.0)), 4, velocity=velocity),),
        material=gr.materials.MuI(E=1e5),
        scheme=scheme_of(basis, transfer, density, dt=1e-3),
        sponge_layers=(sponge,),
        gravity=0.0,
    )
    sim = gr.Simulation(scene, threads=1)
    sim.step(steps)
    return sim.state


@pytest.mark.parametrize("combination", SCHEMES, ids="-".join)
@pytest.mark.parametrize("axis", [0, 1])
def test_what_rises_slows_down_at_the_rate(combination, axis):
    """The whole cloud lies in the layer, so that each step removes the same fraction."""
    for sign in (1.0, -1.0):
        velocity = tuple(sign * (2.0 if d == axis else 0.5) for d in range(2))
        state = moved(velocity, SpongeLayer(axis, 1.0, damping=30.0), combination)
        left = math.exp(-30.0 * 0.01) if sign > 0 else 1.0
        assert state.v[:, axis] == pytest.approx(2.0 * sign * left, rel=1e-12)
        assert state.v[:, 1 - axis] == pytest.approx(0.5 * sign, rel=1e-12)


def test_at_once_by_default_and_only_above():
    state = moved((0.0, 1.0), SpongeLayer(1, 4.0), SCHEMES[0], steps=1)
    above = state.x[:, 1] >= 4.0
    assert above.any() and not above.all()
    np.testing.assert_array_equal(state.v[above, 1], 0.0)
    assert state.v[~above, 1] == pytest.approx(1.0, rel=1e-12)
