"""Silos: rows of the verification table."""

import pytest

from granular import verify


def test_table():
    assert verify.failures("silo_quick") == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["silo_beverloo", "silo_default"])
def test_long_table(name):
    assert verify.failures(name) == []
