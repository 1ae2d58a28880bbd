"""Lines that separate static from flowing cases, for diagrams made with known slopes."""

from itertools import product

import numpy as np
import pytest
from matplotlib.figure import Figure

from granular import plot, theory
from granular.measure.silo_clogging import flow_threshold

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


def test_without_unsure_cases_there_is_one_line():
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


def test_cases_of_one_slope_are_not_parted_by_rounding():
    found = flow_threshold([0.1, 0.3, 1.0], [0.3, 0.9, 5.0], ["static", "unsure", "flowing"])
    assert 0.9 / 0.3 != 0.3 / 0.1
    assert np.isnan(found.static_below)
    assert found.static_bracket[0] == 0.0
    assert not found.overlap


def test_what_is_not_bounded_has_no_line():
    found = flow_threshold([1.0, 1.0], [1.0, 2.0], ["static", "static"])
    assert np.isnan(found.static_below)
    assert np.isnan(found.flowing_above)
    assert found.static_bracket == (2.0, np.inf)
    assert found.flowing_bracket == (2.0, np.inf)
    found = flow_threshold([1.0, 1.0], [1.0, 2.0], ["flowing", "flowing"])
    assert found.flowing_bracket == (0.0, 1.0)
    assert np.isnan(found.flowing_above)


def test_bad_diagrams_are_refused():
    with pytest.raises(ValueError, match="A has shape"):
        flow_threshold([1.0], [1.0, 2.0], ["static", "static"])
    with pytest.raises(ValueError, match="at least one"):
        flow_threshold([], [], [])
    with pytest.raises(ValueError, match=r"verdicts\[1\] = 'stuck'"):
        flow_threshold([1.0, 2.0], [1.0, 2.0], ["static", "stuck"])
    with pytest.raises(ValueError, match="A = "):
        flow_threshold([0.0], [1.0], ["static"])
    with pytest.raises(ValueError, match="ratio = "):
        flow_threshold([1.0], [np.nan], ["static"])


def test_the_picture_shows_every_case_and_both_lines():
    found = verdicts(1.9, 2.2)
    threshold = flow_threshold(A, RATIO, found)
    figure = plot.silo_clogging.phase_diagram(A, RATIO, found, threshold=threshold)
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
    figure = plot.silo_clogging.phase_diagram(
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
        plot.silo_clogging.phase_diagram(angles, heights, ["static"] * 3, boundary=lambda x: 1.0)
    with pytest.raises(ValueError, match="x has shape"):
        plot.silo_clogging.phase_diagram([1.0], heights, ["static"] * 3)
