"""Arches over an opening, and the lines between static and flowing silos."""

from itertools import product

import numpy as np
import pytest
from matplotlib.figure import Figure
from refusals import refused
from synthetic import isotropic, regular_points, silo, state

from granular import theory
from granular.measure import Opening
from granular.papers.silo_clogging import arch_outline, flow_threshold, phase_diagram

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


def test_what_does_not_count_and_a_thin_arch():
    # points that fall do not count, even if they bear a little
    with_strays = arch_outline(jammed())
    points = jammed()
    assert (points.pressure == 10).sum() == 1
    assert points.x[points.pressure == 10, 1].max() < with_strays.y.max() - 2 * CELL
    # a thin arch is found in the void
    gap = parabola(points.x[:, 0])
    shell = (
        (points.x[:, 1] < gap + 2 * CELL) & (points.x[:, 0] < WIDTH / 2) & (points.pressure > 10)
    )
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
    refused(
        ("0 points", lambda: arch_outline(state(s, np.empty((0, 2))))),
        ("no dense point above", lambda: arch_outline(state(s, [[0.1, 0.1]]))),
        ("it has no arch", lambda: arch_outline(jammed(lambda x: np.full_like(x, 9.0)))),
        ("leave no column", lambda: arch_outline(jammed(), opening=Opening(0.001))),
        ("columns, all must have as many", lambda: arch_outline([jammed(), jammed(per_axis=2)])),
        ("different grids", lambda: arch_outline([jammed(), jammed(half=False)])),
        ("0 frames", lambda: arch_outline([])),
    )


# ---- lines that separate static from flowing cases ----


A, RATIO = np.array(list(product((0.1, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0), (1, 2, 3, 4, 5)))).T
"""Amplitudes and openings of the paper."""


def verdicts(static_below, flowing_above):
    slope = RATIO / A
    return np.where(
        slope < static_below, "static", np.where(slope > flowing_above, "flowing", "unsure")
    )


def test_lines_are_half_way_between_the_cases_they_part():
    found = flow_threshold(A, RATIO, verdicts(1.9, 2.2))
    slope = np.unique(RATIO / A)
    below, above = slope[slope < 1.9].max(), slope[slope > 2.2].min()
    assert found.static_bracket == pytest.approx((below, 2.0))
    assert found.flowing_bracket == pytest.approx((2.0, above))
    assert found.static_below == pytest.approx((below + 2) / 2)
    assert found.flowing_above == pytest.approx((above + 2) / 2)
    assert not found.overlap
    found_verdicts = verdicts(1.9, 2.2)
    assert np.all(found_verdicts[RATIO < found.static_below * A] == "static")
    assert np.all(found_verdicts[RATIO > found.flowing_above * A] == "flowing")
    # without unsure cases there is one line
    found = flow_threshold(A, RATIO, verdicts(1.9, 1.9))
    assert found.static_below == found.flowing_above
    assert found.static_bracket == found.flowing_bracket
    assert found.static_bracket[0] < 1.9 < found.static_bracket[1]


def test_a_flow_among_the_static_widens_the_band():
    odd = verdicts(1.9, 2.2)
    odd[(A == 2.0) & (RATIO == 2)] = "flowing"
    found = flow_threshold(A, RATIO, odd)
    assert found.overlap
    assert found.static_bracket[1] == 1.0
    assert found.static_bracket[0] == pytest.approx(0.8)
    # others of slope 1 are static, and those of slope 2 unsure
    assert found.flowing_bracket[0] == pytest.approx(2.0)


def test_what_is_not_bounded_has_no_line():
    """Cases of one slope are not parted by rounding."""
    found = flow_threshold([0.1, 0.3, 1.0], [0.3, 0.9, 5.0], ["static", "unsure", "flowing"])
    assert 0.9 / 0.3 != 0.3 / 0.1
    assert np.isnan(found.static_below)
    assert found.static_bracket[0] == 0.0
    assert not found.overlap
    found = flow_threshold([1.0, 1.0], [1.0, 2.0], ["static", "static"])
    assert np.isnan(found.static_below)
    assert np.isnan(found.flowing_above)
    assert found.static_bracket == (2.0, np.inf)
    assert found.flowing_bracket == (2.0, np.inf)
    found = flow_threshold([1.0, 1.0], [1.0, 2.0], ["flowing", "flowing"])
    assert found.flowing_bracket == (0.0, 1.0)
    assert np.isnan(found.flowing_above)


def test_bad_diagrams_are_refused():
    for message, *diagram in (
        ("A has shape", [1.0], [1.0, 2.0], ["static", "static"]),
        ("at least one", [], [], []),
        (r"verdicts\[1\] = 'stuck'", [1.0, 2.0], [1.0, 2.0], ["static", "stuck"]),
        ("A = ", [0.0], [1.0], ["static"]),
        ("ratio = ", [1.0], [np.nan], ["static"]),
    ):
        with pytest.raises(ValueError, match=message):
            flow_threshold(*diagram)


def test_the_picture_shows_every_case_and_both_lines():
    found = verdicts(1.9, 2.2)
    threshold = flow_threshold(A, RATIO, found)
    figure = phase_diagram(A, RATIO, found, threshold=threshold)
    ax = figure.axes[0]
    drawn = {line.get_label(): line for line in ax.lines}
    for verdict, marker in (("static", "s"), ("flowing", "o"), ("unsure", "^")):
        line = drawn[verdict]
        assert line.get_marker() == marker
        assert line.get_linestyle() == "None"
        expected = np.stack([A, RATIO], axis=1)[found == verdict]
        assert np.array_equal(line.get_xydata(), expected)
    slopes = [line.get_ydata()[1] / line.get_xdata()[1] for line in ax.lines[3:]]
    assert slopes == pytest.approx([threshold.static_below, threshold.flowing_above])
    assert all(line.get_xydata()[0].tolist() == [0.0, 0.0] for line in ax.lines[3:])
    assert ax.get_xlim()[0] == ax.get_ylim()[0] == 0.0
    assert ax.get_xlim()[1] > 3.0
    assert ax.get_ylabel() == "W/d"
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_the_picture_of_layers_has_the_curve_of_theory():
    numbers = {"A": 0.25, "d": 1.0, "mu_s": 0.3819, "mu_2": 1.5}
    angles, heights = np.array([[24.0, 27.0, 27.0], [3.0, 0.5, 4.0]])

    def boundary(angle):
        return np.array([theory.stopping_height(a, **numbers) for a in angle])

    ax = Figure().add_subplot()
    figure = phase_diagram(
        angles, heights, ["unsure", "static", "flowing"], labels=("angle [deg]", "H/d"),
        boundary=boundary, ax=ax,
    )  # fmt: skip
    assert figure is ax.figure
    curve = ax.lines[-1]
    assert curve.get_label() == "theory"
    assert np.interp(27.0, *curve.get_data()) == pytest.approx(
        theory.stopping_height(27.0, **numbers), rel=1e-3
    )
    # without lines through the origin it is not needed
    assert ax.get_xlim()[0] > 20
    with pytest.raises(ValueError, match="boundary gives shape"):
        phase_diagram(angles, heights, ["static"] * 3, boundary=lambda x: 1.0)
    with pytest.raises(ValueError, match="x has shape"):
        phase_diagram([1.0], heights, ["static"] * 3)
