"""Grid, regions and seeding, against areas, counts and positions known by hand."""

import math

import numpy as np
import pytest

from granular import Box, Cylinder, Difference, Fill, Grid, Intersection, Sphere, Union
from granular.model.seeding import SeededPoints, joined

UNIT = Grid((0.0, 0.0), 0.1, (10, 10))
UNIT_BOX = Box((0, 0), (1, 1))


def seeded(grid, fills, seed, rho_c):
    return joined(SeededPoints(grid, fills, seed, [rho_c] * len(fills)), grid.dim)


def test_grid_derives_dimension_upper_corner_and_lines():
    grid = Grid((-1.0, 2.0, 0.0), 0.25, [4, 8, 1], (True, False, False), {"z+"})
    assert grid.dim == 3
    assert grid.upper == (0.0, 4.0, 0.25)
    assert grid.line("at", 1, 2.75) == 3
    assert grid.open_sides == frozenset({"z+"})
    assert Grid((0.0, 0.0), 1, (1, 1)).periodic == (False, False)
    with pytest.raises(ValueError, match=r"at = 2.8 must lie on a grid line of y"):
        grid.line("at", 1, 2.8)
    with pytest.raises(ValueError, match=r"at = 4.25"):
        grid.line("at", 1, 4.25)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ((0.0, 0.1, (1, 1)), TypeError, "lower"),
        (((0.0,), 0.1, (1,)), ValueError, "lower"),
        (((0.0, 0.0), 0.0, (1, 1)), ValueError, "cell = 0.0"),
        (((0.0, 0.0), 0.1, (1, 0)), ValueError, r"shape\[1\] = 0"),
        (((0.0, 0.0), 0.1, (1.0, 1)), TypeError, r"shape\[0\]"),
        (((0.0, 0.0), 0.1, (1, 1, 1)), ValueError, "shape"),
        (((0.0, 0.0), 0.1, (10**6, 10**6)), ValueError, "at most 2147483647 cells"),
        (((0.0, 0.0), 0.1, (1, 1), (True,)), ValueError, "periodic"),
        (((0.0, 0.0), 0.1, (1, 1), (1, 0)), TypeError, "periodic"),
        (((0.0, 0.0), 0.1, (1, 1), (), {"z+"}), ValueError, "'z\\+' must be one of"),
        (((0.0, 0.0), 0.1, (1, 1), (), "x+"), TypeError, "open_sides"),
        (((0.0, 0.0), 0.1, (1, 1), (True, False), {"x-"}), ValueError, "periodic axis"),
    ],
)
def test_grid_refuses(arguments, error, message):
    with pytest.raises(error, match=message):
        Grid(*arguments)


def test_regions_contain_what_they_should():
    x = [(0.5, 0.5), (0.0, 0.0), (1.0, 0.5), (2.0, 2.0)]
    box, disc = Box((0, 0), (1, 1)), Sphere(0.6, center=(1, 0.5))
    assert box.contains(x).tolist() == [True, True, False, False]
    assert disc.contains(x).tolist() == [True, False, True, False]
    assert Union((box, disc)).contains(x).tolist() == [True, True, True, False]
    assert Intersection((box, disc)).contains(x).tolist() == [True, False, False, False]
    assert Difference(box, disc).contains(x).tolist() == [False, True, False, False]
    assert Union((box, disc)).bounds == ((0, -0.09999999999999998), (1.6, 1.1))
    assert Intersection((box, disc)).bounds == ((0.4, 0), (1, 1))


def test_an_upright_cylinder_contains_what_it_should():
    c = Cylinder(1.0, center=(0, 0, 2), axis=(0, 0, 1), length=2.0)
    x = [(0, 0, 1.01), (0.9, 0, 2.9), (0.8, 0.8, 2), (0, 0, 0.9), (0, 0, 3.01)]
    assert c.contains(x).tolist() == [True, True, False, False, False]
    assert c.bounds == ((-1, -1, 1), (1, 1, 3))


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Box((0, 0), (1, 0)), ValueError, r"upper\[1\] = 0.0 must exceed"),
        (lambda: Box((0, 0), (1, 1, 1)), ValueError, "upper"),
        (lambda: Sphere(-1, center=(0, 0)), ValueError, "radius = -1.0"),
        (lambda: Cylinder(1, center=(0, 0), length=1), ValueError, "length = 1.0 must be"),
        (lambda: Union(()), ValueError, "at least one"),
        (lambda: Union((UNIT_BOX, 1)), TypeError, r"^parts\[1\] = 1 must be a Region"),
        (
            lambda: Union((Box((0, 0), (1, 1)), Sphere(1, center=(0, 0, 0)))),
            ValueError,
            "dimension",
        ),
        (lambda: Difference(1, UNIT_BOX), TypeError, "^shape = 1 must be a shape"),
        (lambda: Difference(UNIT_BOX, 1), TypeError, "^without = 1 must be a shape"),
        (
            lambda: Difference(UNIT_BOX, Sphere(1, center=(0, 0, 0))),
            ValueError,
            "^without = .* must have dimension 2",
        ),
        (lambda: Box((0, 0)), TypeError, "two corners, or a size"),
        (lambda: Box((0, 0), (1, 1), size=(1, 1)), TypeError, "two corners, or a size"),
        (lambda: Box((0, 0), (1, 1), rotation_deg=3.0), ValueError, "give size and center"),
        (lambda: Box((0, 0), (1, 1)).contains([0.5, 0.5]), ValueError, r"\(n, 2\)"),
        (lambda: Fill(Box((0, 0), (1, 1)), 5), ValueError, "square of an integer"),
        (lambda: Fill(Sphere(1, center=(0, 0, 0)), 4), ValueError, "cube of an integer"),
        (lambda: Fill(Box((0, 0), (1, 1)), 4, jitter=1.5), ValueError, "jitter = 1.5"),
        (lambda: Fill(Box((0, 0), (1, 1)), 4, stagger=1), TypeError, "stagger = 1"),
        (lambda: Fill(Box((0, 0), (1, 1)), 4, density=0.0), ValueError, "density = 0.0"),
        (lambda: Fill(Box((0, 0), (1, 1)), 4, velocity=(1, 2, 3)), ValueError, "velocity"),
        (lambda: Fill("box", 4), TypeError, "region = 'box'"),
    ],
)
def test_parts_refuse(make, error, message):
    with pytest.raises(error, match=message):
        make()


def test_seeding_lattice_of_a_cell_by_hand():
    fill = Fill(Box((1, 2), (1.5, 2.5)), 4)
    points = seeded(Grid((1.0, 2.0), 0.5, (2, 2)), [fill], 0, 1000.0)
    expected = [(1.125, 2.125), (1.375, 2.125), (1.125, 2.375), (1.375, 2.375)]
    assert np.allclose(points.x, expected, atol=1e-15)
    assert np.allclose(points.volume, 0.25**2)
    assert points.density.tolist() == [1000.0] * 4
    assert not points.v.any()


def test_mass_velocity_and_order_of_several_fills():
    fills = [
        Fill(Box((0, 0), (0.5, 1.0)), 9),
        Fill(Box((0.5, 0), (1.0, 0.5)), 4, density=1200.0, velocity=(1.2, 3.0)),
    ]
    points = seeded(UNIT, fills, 0, 1500.0)
    assert len(points.x) == 450 + 100
    assert np.sum(points.volume * points.density) == pytest.approx(0.5 * 1500 + 0.25 * 1200)
    assert (points.x[:450, 0] < 0.5).all() and (points.x[450:, 0] > 0.5).all()
    assert (points.v[450:] == (1.2, 3.0)).all() and not points.v[:450].any()
    assert not points.x.flags.writeable


def test_disc_and_ball_have_their_volume():
    disc = seeded(UNIT, [Fill(Sphere(0.4, center=(0.5, 0.5)), 100)], 0, 1.0)
    assert disc.volume.sum() == pytest.approx(math.pi * 0.16, rel=2e-3)
    grid = Grid((0.0,) * 3, 0.1, (10,) * 3)
    ball = seeded(grid, [Fill(Sphere(0.4, center=(0.5,) * 3), 27)], 0, 1.0)
    assert ball.volume.sum() == pytest.approx(4 / 3 * math.pi * 0.064, rel=1e-2)


def test_jitter_is_bounded_reproducible_and_uniform():
    def jittered(jitter, seed):
        return seeded(UNIT, [Fill(Box((0, 0), (1, 1)), 16, jitter=jitter)], seed, 1.0).x

    regular, moved = jittered(0.0, 3), jittered(0.5, 3)
    shift = (moved - regular) / 0.025
    assert abs(shift).max() <= 0.25 and abs(shift).max() > 0.24
    assert shift.std() == pytest.approx(0.5 / math.sqrt(12), rel=0.05)
    assert (jittered(0.5, 3) == moved).all() and (jittered(0.5, 4) != moved).all()
    full = jittered(1.0, 0)
    assert (full >= 0).all() and (full < 1.0).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_columns_of_a_staggered_fill_have_heights_of_their_own(dim):
    """Points stay in the region, and those of neighbouring columns are far apart in height."""
    grid = Grid((0.0,) * dim, 0.1, (10,) * dim)
    box = Box((0.1,) * dim, (0.9,) * dim)
    plain, staggered = (
        seeded(grid, [Fill(box, 2**dim, stagger=stagger)], 0, 1.0) for stagger in (False, True)
    )
    assert box.contains(staggered.x).all()
    assert staggered.volume.tolist() == plain.volume.tolist()
    assert np.allclose(staggered.x[:, :-1], plain.x[:, :-1], atol=0)
    raised = ((staggered.x - plain.x)[:, -1] / 0.05).reshape((16,) * dim)
    assert np.ptp(raised, axis=0).max() < 1e-9
    heights = raised[0]
    assert np.unique(heights.round(9)).size == heights.size
    assert heights.min() >= -0.5 and heights.max() < 0.5 and abs(heights.mean()) < 0.05
    for axis in range(dim - 1):
        apart = np.abs(np.diff(heights, axis=axis))
        assert np.minimum(apart, 1.0 - apart).min() > 0.2


@pytest.mark.parametrize(
    ("fills", "message"),
    [
        ([], "at least one Fill"),
        ([Fill(Box((0, 0), (1, 1.2)), 4)], "fills.0. reaches from 0.0 to 1.2 along y"),
        ([Fill(Sphere(0.2, center=(0.1, 0.5)), 4)], "along x"),
        ([Fill(Sphere(0.2, center=(0.5, 0.5, 0.5)), 8)], "dimension 3"),
        ([Fill(Box((0.51, 0.51), (0.52, 0.52)), 1)], "at least one material point"),
        (
            [Fill(Intersection((Box((0, 0), (0.3, 1)), Box((0.6, 0), (1, 1)))), 4)],
            "at least one material point",
        ),
        ([Fill(Cylinder(0.2, center=(0.5, 0.5), inside=True), 4)], "reaches from -inf"),
        (
            [Fill(Box((0, 0), (0.5, 1)), 4), Fill(Box((0.4, 0), (1, 1)), 4)],
            r"fills\[0\] and fills\[1\] must not overlap",
        ),
        # the second region lies between the sites of the first, and is found by its own sites
        (
            [Fill(Box((0, 0), (1, 1)), 1), Fill(Box((0.3, 0.3), (0.33, 0.33)), 100)],
            r"fills\[1\] and fills\[0\] must not overlap",
        ),
    ],
)
def test_seeding_refuses(fills, message):
    with pytest.raises(ValueError, match=message):
        seeded(UNIT, fills, 0, 1500.0)
