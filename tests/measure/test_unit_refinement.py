"""Richardson extrapolation against exact powers, hand-made numbers and scattered samples."""

import numpy as np
import pytest

from granular.measure import richardson

CELLS = np.array([0.02, 0.01, 0.005, 0.0025])


@pytest.mark.parametrize("order", [0.7, 1.0, 1.7, 2.0, 3.3])
def test_the_order_and_the_limit_of_an_exact_power(order):
    found = richardson(CELLS, 2.0 + 30.0 * CELLS**order)
    assert found.order == pytest.approx(order, abs=1e-3)
    assert found.limit == pytest.approx(2.0, abs=1e-4)
    assert found.slope == pytest.approx(30.0, rel=1e-2)
    assert found.uncertainty < 1e-3
    assumed = richardson(CELLS, 2.0 + 30.0 * CELLS**order, order=order)
    assert assumed.limit == pytest.approx(2.0, rel=1e-12)
    assert assumed.slope == pytest.approx(30.0, rel=1e-10)


def test_two_and_three_sizes_have_the_grid_convergence_index():
    """In halved cells of second order the rest is a third of the last change."""
    two = richardson([0.5, 1.0], [10.3, 11.5], order=2.0)
    assert two.limit == pytest.approx(9.9)
    assert two.uncertainty == pytest.approx(3 * 0.4)
    three = richardson([1.0, 2.0, 4.0], [10.1, 10.4, 11.6])  # changes of 1.2 and 0.3
    assert three.order == pytest.approx(2.0, abs=1e-4)
    assert three.limit == pytest.approx(10.0, abs=1e-4)
    assert three.uncertainty == pytest.approx(1.25 * 0.1, rel=1e-3)


@pytest.mark.parametrize("order", [1.0, None])
def test_the_interval_holds_the_limit_in_19_of_20_samples(order):
    """Of samples with normal scatter; with a fitted order the interval is linear about it."""
    rng = np.random.default_rng(5)
    cells = np.repeat([1.0, 2.0, 4.0, 8.0], 3)
    exact, trials = 1.0 + 0.1 * cells, 400 if order else 100
    inside = 0
    for _ in range(trials):
        found = richardson(cells, exact + 0.005 * rng.normal(size=12), order=order)
        inside += abs(found.limit - 1.0) < found.uncertainty
    assert inside / trials == pytest.approx(0.95, abs=0.035 if order else 0.05)


@pytest.mark.parametrize(
    ("cells", "values", "order", "said"),
    [
        ([1.0, 2.0], [1.0, 2.0], None, "2 different sizes must be at least 3"),
        ([1.0, 1.0], [1.0, 2.0], 2.0, "1 different sizes must be at least 2"),
        ([1.0, 0.0, 2.0], [1.0, 2.0, 3.0], None, "cells = 0.0 must be > 0"),
        ([1.0, 2.0, 4.0], [1.0, 2.0], None, "values of shape"),
        ([1.0, 2.0, 4.0], [1.0, np.nan, 2.0], None, r"values\[1\] must be a finite number"),
        ([1.0, 2.0, 4.0], [1.0, 2.0, 3.0], 5.0, "order = 5.0 must be in"),
    ],
)
def test_what_it_refuses(cells, values, order, said):
    with pytest.raises(ValueError, match=said):
        richardson(cells, values, order=order)


def test_an_order_at_the_end_of_its_range_is_warned_of():
    """Values that jump and then stay have none: the larger, the nearer they come to it."""
    with pytest.warns(UserWarning, match="order that fits best is 4, the end of its range"):
        richardson([1.0, 2.0, 4.0], [1.0, 1.0, 2.0])
