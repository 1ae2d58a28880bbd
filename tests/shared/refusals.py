"""Calls that must be refused."""

import pytest


def refused(*cases, error=ValueError):
    """Each case is the pattern of a message and a call that raises an error with this message."""
    for message, call in cases:
        with pytest.raises(error, match=message):
            call()
