"""Argument checks: accepted values, refused values, and messages that are specific."""

import math

import numpy as np
import pytest

from granular.tools import checks


def test_numbers_come_back_as_floats_and_ints():
    assert checks.positive("a", np.float32(2)) == 2.0
    assert type(checks.finite("a", 3)) is float
    assert type(checks.integer("n", np.int64(3))) is int
    assert checks.positive("a", math.inf, allow_inf=True) == math.inf
    assert checks.in_range("a", 0, 0, 1) == 0.0
    assert checks.one_of("a", None, ("x", None)) is None
    assert checks.vector("a", np.array([1, 2])) == (1.0, 2.0)
    for value in (1.0, True, "1", np.float64(2)):
        with pytest.raises(TypeError, match=r"n = .* must be an integer"):
            checks.integer("n", value)
    with pytest.raises(TypeError):
        checks.one_of("a", True, (1, 2))
    assert checks.in_range("q", 1.0, 0.0, 1.0, open_low=True) == 1.0
    with pytest.raises(ValueError, match=r"q = 0.0 must be in \(0.0, 1.0\]"):
        checks.in_range("q", 0.0, 0.0, 1.0, open_low=True)
    with pytest.raises(ValueError, match=r"in \[0.0, 1.0\)"):
        checks.in_range("q", 1.0, 0.0, 1.0, open_high=True)


@pytest.mark.parametrize(
    ("check", "value", "rest"),
    [
        (checks.positive, 0.0, ()),
        (checks.positive, -1e-300, ()),
        (checks.positive, math.inf, ()),
        (checks.positive, 1e-31, ()),
        (checks.non_negative, 1e31, ()),
        (checks.finite, -1e31, ()),
        (checks.array, [0.0, 1e31], ((None,),)),
        (checks.non_negative, -1, ()),
        (checks.non_negative, math.inf, ()),
        (checks.finite, -math.inf, ()),
        (checks.finite, 10**400, ()),
        (checks.in_range, 1.0000001, (0, 1)),
        (checks.integer, 0, (1,)),
        (checks.integer, 5, (1, 4)),
        (checks.one_of, "c", ("ab",)),
        (checks.vector, (1.0,), ()),
        (checks.vector, (1.0, 2.0), (3,)),
        (checks.vector, ((1.0, 2.0), (3.0, 4.0)), ()),
        (checks.vector, (1.0, math.nan), ()),
    ],
)
def test_values_out_of_range(check, value, rest):
    with pytest.raises(ValueError, match=r"the_name.* must be|the_name.* finite"):
        check("the_name", value, *rest)


@pytest.mark.parametrize(
    "check",
    [checks.positive, checks.non_negative, checks.finite, lambda n, v: checks.in_range(n, v, 0, 1)],
)
def test_nan_is_a_value_error_and_bool_and_text_are_type_errors(check):
    with pytest.raises(ValueError, match="q = nan"):
        check("q", math.nan)
    for value in (True, np.True_, "1", None, [1.0], 1j):
        with pytest.raises(TypeError, match=r"q = .* not \w+"):
            check("q", value)
