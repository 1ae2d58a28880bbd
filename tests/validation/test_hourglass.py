"""Hourglasses: rows of the verification table."""

import pytest

from granular import verify


def test_table():
    assert verify.failures("hourglass_quick") == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hourglass_published", "hourglass_default"])
def test_long_table(name):
    assert verify.failures(name) == []
