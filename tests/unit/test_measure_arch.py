"""Outlines of arches that were cut out of regular points."""

import numpy as np
import pytest
from synthetic import isotropic, regular_points, silo, state

from granular.measure import Opening
from granular.measure.silo_clogging import arch_outline

WIDTH, CELL = 0.14, 0.0175
SPACING = CELL / 4


def parabola(x, crown=0.1):
    return crown * (1 - (2 * x / WIDTH) ** 2)


def jammed(outline=parabola, *, half=True, cell=CELL, left=None, axis=0.0, shift=0.0, per_axis=4):
    """Points under 2 kPa above an outline; some fall below it without stress, strays are dense."""
    s = silo(half=half, cell=cell, rows=round(0.63 / cell), left=left)
    x = regular_points(s, per_axis, lambda x: x[:, 1] < 0.5)
    # the points see an outline as the lowest point; a shift moves the cut within one spacing
    gap = outline(x[:, 0] - axis) + shift
    solid = (x[:, 1] - cell / per_axis / 2 >= gap) | (np.abs(x[:, 0] - axis) > WIDTH / 2)
    free = ~solid & (np.arange(len(x)) % 5 == 0) & (x[:, 1] < gap - 3 * cell)
    p = np.where(solid, 2000.0, 0.0)
    stray = np.flatnonzero(free)[:1]
    p[stray] = 10.0
    keep = solid | free
    return state(s, x[keep], stress=isotropic(p[keep]), per_cell=per_axis**2)


@pytest.mark.parametrize("half", [True, False])
def test_a_parabola_is_found_within_a_spacing(half):
    arch = arch_outline(jammed(half=half))
    # columns two spacings wide over the opening
    assert len(arch.x) == (8 if half else 16)
    assert np.all(np.diff(arch.x) > 0)
    off = arch.y - parabola(arch.x)
    # the first row of points above the outline is up to one spacing too high
    assert off.min() >= -1e-12
    assert off.max() <= SPACING + 1e-12
    assert arch.crown == arch.y.max()
    assert arch.relative_crown == pytest.approx(arch.crown / WIDTH)
    assert arch.crown == pytest.approx(0.1, abs=SPACING)
    assert np.all(arch.spread == 0)


def test_the_error_falls_with_the_spacing():
    errors = []
    for cell in (CELL, CELL / 2, CELL / 4):
        arch = arch_outline(jammed(cell=cell))
        errors.append(np.mean(arch.y - parabola(arch.x)))
    # half a spacing on average
    assert errors == pytest.approx(np.array([CELL, CELL / 2, CELL / 4]) / 8, rel=0.35)
    assert errors[0] > 1.5 * errors[1] > 2.25 * errors[2]


def test_points_that_fall_do_not_count_even_if_they_bear_a_little():
    with_strays = arch_outline(jammed())
    points = jammed()
    assert (points.p == 10).sum() == 1
    assert points.x[points.p == 10, 1].max() < with_strays.y.max() - 2 * CELL


def test_a_thin_arch_is_found_in_the_void():
    points = jammed()
    gap = parabola(points.x[:, 0])
    shell = (points.x[:, 1] < gap + 2 * CELL) & (points.x[:, 0] < WIDTH / 2) & (points.p > 10)
    thin = state(points.scene, points.x[shell], stress=points.stress[shell], per_cell=16)
    assert np.allclose(arch_outline(thin).y, arch_outline(points).y)


def test_both_halves_and_either_side_give_the_same():
    def lopsided(x):
        return 0.06 * (1 - 2 * np.abs(x) / WIDTH) + 0.0213

    whole = arch_outline(jammed(lopsided, half=False))
    right = arch_outline(jammed(lopsided))
    assert np.allclose(whole.x[8:], right.x)
    assert np.allclose(whole.y[8:], right.y)
    assert np.allclose(whole.x, -whole.x[::-1])
    # the left half, whose axis is the right side of the grid
    left = jammed(lopsided, left=-0.2975)
    found = arch_outline(left, opening=Opening(WIDTH, axis=0.0, half=True))
    assert np.allclose(found.x, whole.x[:8])
    assert np.allclose(found.y, whole.y[:8])


def test_frames_are_averaged_and_their_scatter_told():
    frames = [jammed(shift=k * SPACING) for k in (0, 1, 2)]
    each = [arch_outline(frame) for frame in frames]
    arch = arch_outline(frames)
    assert arch.frames == 3
    assert np.allclose(arch.y, np.mean([a.y for a in each], axis=0))
    middle = slice(0, 5)
    assert np.allclose(arch.y[middle], each[1].y[middle])
    assert np.allclose(arch.spread[middle], SPACING * np.sqrt(2 / 3))


def test_the_floor_may_be_higher_and_points_coarser():
    four = arch_outline(jammed(per_axis=2))
    assert len(four.x) == 4
    assert four.crown == pytest.approx(0.1, abs=CELL / 2)
    raised = jammed()
    raised.x = raised.x + np.array([0.0, 0.0175])
    found = arch_outline(raised, opening=Opening(WIDTH, floor=0.0175, half=True))
    assert np.allclose(found.y, arch_outline(jammed()).y)


def test_what_is_no_arch_is_refused():
    s = silo(half=True)
    with pytest.raises(ValueError, match="0 points"):
        arch_outline(state(s, np.empty((0, 2))))
    with pytest.raises(ValueError, match="no dense point above"):
        arch_outline(state(s, [[0.1, 0.1]]))
    with pytest.raises(ValueError, match="it has no arch"):
        arch_outline(jammed(lambda x: np.full_like(x, 9.0)))
    with pytest.raises(ValueError, match="leave no column"):
        arch_outline(jammed(), opening=Opening(0.001))
    with pytest.raises(ValueError, match="columns, all must have as many"):
        arch_outline([jammed(), jammed(per_axis=2)])
    with pytest.raises(ValueError, match="different grids"):
        arch_outline([jammed(), jammed(half=False)])
    with pytest.raises(ValueError, match="0 frames"):
        arch_outline([])
