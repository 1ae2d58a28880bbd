"""Numbers that give a measured result: exact data, and intervals that hold as often as said."""

import numpy as np
import pytest

import granular as gr

NUMBERS = np.repeat([0.3, 0.4, 0.5], 3)


def test_exact_data_give_the_number():
    found = gr.calibrate.invert(NUMBERS, 10.0 + 40.0 * NUMBERS + 20.0 * NUMBERS**2, 27.0)
    exact = (-40.0 + np.sqrt(1600.0 + 80.0 * 17.0)) / 40.0
    assert found.value == pytest.approx(exact, rel=1e-12)
    assert found.slope == pytest.approx(40.0 + 40.0 * exact)
    assert found.interval == pytest.approx((exact, exact), rel=1e-9)
    assert found(exact) == pytest.approx(27.0)
    off = gr.calibrate.invert(NUMBERS, 30.0 * NUMBERS, 12.0, error=0.6, degree=1)
    # An error that is known: the normal distribution.
    assert off.interval == pytest.approx((0.4 - 1.96 * 0.02, 0.4 + 1.96 * 0.02), rel=1e-4)


@pytest.mark.parametrize("error", [0.0, 0.4])
def test_intervals_contain_the_number_as_often_as_they_say(error):
    rng = np.random.default_rng(4)
    hits, runs = 0, 2000
    for _ in range(runs):
        results = 10.0 + 40.0 * NUMBERS + rng.normal(0.0, 0.3, NUMBERS.size)
        target = 26.0 + error * rng.normal()
        low, high = gr.calibrate.invert(NUMBERS, results, target, error=error).interval
        hits += low <= 0.4 <= high
    assert hits / runs == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target": 40.0}, r"target = 40 must be passed once .* 12 to 20 .* they pass it 0 times"),
        ({"results": (NUMBERS - 0.4) ** 2, "target": 0.005}, "they pass it 2 times"),
        ({"results": [1.0]}, "results"),
        ({"degree": 3}, "more than 3 different ones, for degree = 3"),
        ({"degree": 0}, "degree = 0"),
        ({"error": -1.0}, "error = -1.0"),
        ({"confidence": 1.0}, "confidence = 1.0"),
        ({"target": np.nan}, "target = nan"),
    ],
)
def test_bad_arguments_are_named(changes, message):
    given = {"numbers": NUMBERS, "results": 40.0 * NUMBERS, "target": 16.0}
    with pytest.raises(ValueError, match=message):
        gr.calibrate.invert(**given | changes)
