"""The verification table itself: its rows, its exit status, and rows that must hold bit by bit."""

import io
import math

import pytest

from granular import verify
from granular.verify.rows import at_least, at_most, beside, checks, holds, within


@pytest.mark.parametrize("name", ["threads_and_restart", "conservation", "energy"])
def test_table(name):
    assert verify.failures(name) == []


def test_rows_pass_and_fail():
    assert at_most("q", 1.0, 1.0).passed
    assert not at_most("q", 1.1, 1.0).passed
    assert not at_least("q", 0.9, 1.0).passed
    assert within("q", 1.5, 1.0, 0.5).passed
    assert not within("q", 1.6, 1.0, 0.5).passed
    assert not holds("q", False).passed
    assert beside("q", "1", "2").passed is None


@pytest.mark.parametrize("row", [at_most, at_least])
def test_nan_never_passes(row):
    assert not row("q", math.nan, 1.0).passed
    assert not within("q", math.nan, 0.0, 1.0).passed


@pytest.fixture
def registered(monkeypatch):
    """An empty register of checks, which a test fills."""
    monkeypatch.setattr("granular.verify.rows.checks", (table := {}))
    monkeypatch.setattr("granular.verify.table.checks", table)
    return table


def test_exit_status_and_selection(registered):
    @verify.check()
    def good():
        """Fine."""
        yield holds("true", True)

    @verify.check(slow=True)
    def bad():
        """Not fine."""
        yield at_most("large", 2.0, 1.0)

    assert registered["good"].doc == "Fine."
    quick, whole = io.StringIO(), io.StringIO()
    assert verify.main(out=quick) == 0
    assert "bad" not in quick.getvalue()
    assert verify.main(slow=True, out=whole) == 1
    assert "FAIL" in whole.getvalue()
    assert "1 passed, 1 failed, 0 reported; 2 checks" in whole.getvalue()
    assert verify.main(out=io.StringIO(), only=["bad"]) == 1
    assert verify.failures("bad") == ["large: 2, expected <= 1"]


def test_a_check_that_raises_fails_and_the_others_run(registered):
    @verify.check()
    def broken():
        yield holds("first", True)
        raise RuntimeError("went wrong")

    @verify.check()
    def other():
        yield holds("second", True)

    out = io.StringIO()
    assert verify.main(out=out) == 1
    assert "RuntimeError: went wrong" in out.getvalue()
    assert "second" in out.getvalue()


def test_unknown_name():
    with pytest.raises(ValueError, match="only"):
        verify.main(only=["no_such_check"], out=io.StringIO())


def test_every_check_says_what_it_is():
    assert all(check.doc for check in checks.values())
