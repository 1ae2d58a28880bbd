"""Collapse of columns: rows of the verification table."""

import pytest

from granular import verify


@pytest.mark.parametrize("name", ["collapse_quick", "collapse_slope_quick"])
def test_table(name):
    assert verify.failures(name) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["collapse_runout", "collapse_causes", "collapse_slopes"])
def test_long_table(name):
    assert verify.failures(name) == []
