"""Heaps whose slope, toe, mass and strain rate are known by construction."""

import numpy as np
import pytest
from refusals import refused
from synthetic import filled, isotropic, regular_points, scene, state

from granular.measure import repose_angle, runout, surface
from granular.verify.hourglass import STEEPEST, creep_slope

CELL = 0.01
HALF = 0.2


def triangle(*, height=0.2, foot=0.5, top_x=0.0, lower=(0.0, 0.0), shape=(80, 40), fine=4):
    """A heap whose height falls linearly from `height` at top_x to zero at distance `foot`."""
    s = scene(shape, CELL, lower=lower, parameters={"half_width": HALF})
    return filled(s, fine, lambda x: x[:, 1] < height * (1 - abs(x[:, 0] - top_x) / foot))


def test_slope_toe_and_quantile_of_a_triangle():
    heap = triangle()
    slope = repose_angle(heap)
    assert slope.mean_deg == pytest.approx(np.degrees(np.arctan(0.4)), abs=0.1)
    # 60 % of the height is 60 % of the 50 columns
    assert slope.columns == pytest.approx(30, abs=1)
    assert slope.mean_deg <= slope.largest_deg < slope.mean_deg + 1.5
    result = runout(triangle())
    assert result.toe == pytest.approx((0.5 - HALF) / HALF, abs=0.01)
    # the last thousandth of a triangle's mass lies within sqrt(0.001) of its length
    reach = 0.5 * (1 - np.sqrt(1e-3))
    assert result.quantile == pytest.approx((reach - HALF) / HALF, abs=0.02)
    # the height is dx/4 at 0.00625 m before the foot, in the column that ends at 0.50 or 0.49
    assert result.contiguous == pytest.approx((0.5 - HALF) / HALF, abs=CELL / HALF + 1e-9)


def test_the_steepest_piece_is_found():
    s = scene((80, 60), CELL)

    def top(x):
        # 45 degrees over six columns, atan(0.25) elsewhere
        return np.interp(x, [0, 0.2, 0.26, 0.66], [0.21, 0.16, 0.10, 0.0])

    slope = repose_angle(filled(s, 8, lambda x: x[:, 1] < top(x[:, 0])))
    assert slope.largest_deg == pytest.approx(45, abs=2)
    assert slope.mean_deg < 30


def test_full_heaps_and_sprays_change_the_run_out_little():
    half = runout(triangle())
    full = runout(triangle(top_x=0.0, lower=(-0.8, 0.0), shape=(160, 40)))
    assert full.toe == pytest.approx(half.toe, rel=1e-9)
    assert full.quantile == pytest.approx(half.quantile, abs=CELL / HALF / 4)
    assert full.contiguous == pytest.approx(half.contiguous, rel=1e-9)
    heap = triangle()
    x = np.vstack([heap.x, [[0.79, 0.2], [0.785, 0.3]]])
    sprayed = runout(state(heap.scene, x, per_cell=16))
    calm = runout(heap)
    assert sprayed.quantile == pytest.approx(calm.quantile, abs=0.03)
    assert sprayed.toe == calm.toe
    assert sprayed.contiguous == calm.contiguous


def test_a_heap_on_a_bed_runs_out_as_it_does_on_the_floor():
    """Its material is counted above the bed's surface; otherwise the end of the bed is told of."""
    s = scene((80, 40), CELL, parameters={"half_width": HALF})
    bed = filled(s, 4, lambda x: x[:, 1] < 0.1 + 0.2 * np.maximum(1 - x[:, 0] / 0.5, 0.0))
    assert runout(bed, above=0.1) == runout(triangle())
    with pytest.warns(UserWarning, match=r"side of the grid, 0\.8 m .* give above"):
        runout(bed)
    wide = scene((160, 40), CELL, lower=(-0.6, 0.0), parameters={"half_width": HALF})
    with pytest.warns(UserWarning, match=r"side of the grid, 0\.6 m"):
        runout(filled(wide, 4, lambda x: x[:, 1] < 0.1))
    round_one = scene((40, 30, 20), 0.02, parameters={"radius": HALF})
    with pytest.warns(UserWarning, match=r"side of the grid, 0\.6 m"):
        runout(filled(round_one, 2, lambda x: x[:, 2] < 0.1))


def test_an_undisturbed_column_has_not_run_out():
    s = scene((60, 30), CELL, parameters={"half_width": HALF})
    result = runout(filled(s, 4, lambda x: (x[:, 0] < HALF) & (x[:, 1] < 0.1)))
    assert abs(result.quantile) < CELL / 4 / HALF
    assert result.contiguous == pytest.approx(0, abs=1e-12)
    assert np.isnan(result.toe)
    # a surface by points and by mass
    layer = filled(scene((4, 6), CELL), 2, lambda x: (x[:, 0] < 0.03) & (x[:, 1] < 0.02))
    top = surface(layer)
    assert np.allclose(top.x, [0.005, 0.015, 0.025, 0.035])
    assert np.allclose(top.top[:3], 0.02)
    assert np.isnan(top.top[3])
    assert np.allclose(top.height, [0.02, 0.02, 0.02, 0.0])
    twice = surface(state(layer.scene, layer.x, mass=2 * layer.mass))
    assert np.allclose(twice.height, 2 * top.height)


def test_a_cone_has_the_height_of_its_mass_and_runs_out_alike_in_a_quarter():
    def cone(lower, shape):
        s = scene(shape, 0.05, lower=lower, parameters={"radius": 0.5})
        return filled(s, 2, lambda x: x[:, 2] < 0.5 * (1 - np.hypot(x[:, 0], x[:, 1]) / 1.0))

    quarter = runout(cone((0.0, 0.0, 0.0), (22, 22, 10)))
    whole = runout(cone((-1.1, -1.1, 0.0), (44, 44, 10)))
    assert quarter.toe == pytest.approx(1.0, abs=0.08)
    assert whole.toe == pytest.approx(quarter.toe, rel=1e-6)
    assert whole.quantile == pytest.approx(quarter.quantile, rel=1e-6)
    s = scene((22, 22, 10), 0.05, parameters={"radius": 0.5})
    disc = filled(s, 2, lambda x: (np.hypot(x[:, 0], x[:, 1]) < 1.0) & (x[:, 2] < 0.3))
    top = surface(disc)
    assert np.allclose(top.height[2:18], 0.3, rtol=0.15)
    assert np.allclose(top.top[1:18], 0.3)


def test_both_sides_of_a_lopsided_heap():
    s = scene((100, 40), CELL)

    def keep(x):
        left = 0.3 * x[:, 0] / 0.5
        right = 0.3 * (1 - (x[:, 0] - 0.5) / 0.4)
        return x[:, 1] < np.minimum(left, right)

    heap = filled(s, 4, keep)
    left, right = np.degrees(np.arctan([0.6, 0.75]))
    assert repose_angle(heap, side="left").mean_deg == pytest.approx(left, abs=0.2)
    assert repose_angle(heap, side="right").mean_deg == pytest.approx(right, abs=0.2)
    both = repose_angle(heap, side="both")
    assert both.mean_deg == pytest.approx((left + right) / 2, abs=0.2)
    assert repose_angle(heap).mean_deg == repose_angle(heap, side="left").mean_deg


def test_the_two_heaps_of_an_hourglass():
    s = scene((50, 80), CELL)

    def keep(x):
        lower = x[:, 1] < 0.15 * (1 - x[:, 0] / 0.4)
        upper = (x[:, 1] >= 0.5) & (x[:, 1] < 0.5 + 0.3 * x[:, 0])
        return lower | upper

    glass = filled(s, 4, keep)
    crater = repose_angle(glass, above=0.5)
    heap = repose_angle(glass, below=0.4)
    assert crater.mean_deg == pytest.approx(np.degrees(np.arctan(0.3)), abs=0.2)
    assert heap.mean_deg == pytest.approx(np.degrees(np.arctan(0.375)), abs=0.2)
    cut = repose_angle(glass, below=0.4, region=(0.0, 0.2))
    assert cut.columns < heap.columns
    assert cut.mean_deg == pytest.approx(heap.mean_deg, abs=0.5)


def test_bad_heaps_are_refused():
    heap = triangle()
    flat = filled(scene((80, 40), CELL), 2, lambda x: x[:, 1] < 0.1)
    refused(
        ("0 points", lambda: runout(state(heap.scene, np.empty((0, 2))))),
        ("half_width = None", lambda: runout(flat)),
        (r"half_width = -1\.0 must", lambda: runout(heap, half_width=-1.0)),
        ("at least 3", lambda: repose_angle(flat)),
        ("no point within region", lambda: surface(heap, region=(0.7, 0.8))),
        ("empty range", lambda: surface(heap, region=(0.3, 0.1))),
        ("side = 'up'", lambda: repose_angle(heap, side="up")),
        ("window", lambda: repose_angle(heap, window=2)),
    )
    with pytest.raises(TypeError, match="window"):
        repose_angle(heap, window=5.0)


def test_a_wider_window_sees_less_of_where_the_points_lie():
    rng = np.random.default_rng(5)
    s = scene((80, 40), CELL)
    x = rng.uniform((0, 0), (0.8, 0.4), (12800, 2))  # 4 in a cell, at random
    heap = state(s, x[x[:, 1] < 0.3 - 0.4 * x[:, 0]])
    narrow, wide = (repose_angle(heap, window=w) for w in (5, 15))
    assert narrow.mean_deg == wide.mean_deg == pytest.approx(np.degrees(np.arctan(0.4)), abs=0.7)
    assert narrow.largest_deg > wide.largest_deg + 2
    assert wide.largest_deg < wide.mean_deg + 3


# ---- the slope of a creeping flank ----


FOOT, HEIGHT = 0.75, 0.3
THETA = np.arctan(HEIGHT / FOOT)
SHEAR, PRESSURE = 0.4, 400.0
TURN = np.array([[np.cos(THETA), -np.sin(THETA)], [np.sin(THETA), np.cos(THETA)]])
"""Rotation to x down the slope and y normal to it."""


def creeping(compression, *, rate=SHEAR):
    """A triangle whose points move with D_xx = -D_yy = -compression, dv_x/dy = SHEAR."""
    s = scene((100, 40), CELL, parameters={"drop": 0.5, "orifice_radius": 0.02})
    x = regular_points(s, 2, lambda x: x[:, 1] < HEIGHT * (1 - x[:, 0] / FOOT))
    L = np.array([[-compression, SHEAR], [0.0, compression]])
    v = (x @ TURN.T) @ L.T @ TURN
    return state(s, x, v=v, shear_rate=rate, stress=isotropic(np.full(len(x), PRESSURE)))


def friction(material, rate):
    over = rate / (material.xi * np.sqrt(PRESSURE))
    return material.mu_s + (material.mu_2 - material.mu_s) * over / (1 + over)


@pytest.mark.parametrize("compression", [-0.05, 0.0, 0.03, 0.08])
def test_it_is_the_ratio_of_the_coaxial_stresses(compression):
    heap = creeping(compression)
    mu = friction(heap.scene.material, SHEAR)
    D = np.array([[-compression, SHEAR / 2], [SHEAR / 2, compression]])
    sigma = mu * PRESSURE * D / np.sqrt((D**2).sum() / 2) - PRESSURE * np.eye(2)
    slope, asked = creep_slope(heap)
    assert slope == pytest.approx(np.degrees(THETA), abs=0.1)
    assert asked == pytest.approx(np.degrees(np.arctan(-sigma[0, 1] / sigma[1, 1])), abs=0.05)


def test_no_compression_makes_it_steeper_than_the_steepest_at_rest():
    asked = [creep_slope(creeping(c, rate=0.0))[1] for c in np.linspace(0.0, 0.2, 41)]
    assert asked[0] == pytest.approx(20.9, abs=0.05)
    assert max(asked) == pytest.approx(STEEPEST, abs=0.02)
