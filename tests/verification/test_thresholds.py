"""Threshold of flow on the incline, and all its angles."""

import pytest

from granular import verify


def test_table():
    assert verify.failures("incline_thresholds_quick") == []


@pytest.mark.slow
def test_all_angles():
    assert verify.failures("incline_angles") == []
