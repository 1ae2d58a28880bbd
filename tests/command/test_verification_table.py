"""The verification table: every row of it passes, and its rows and exit status can fail."""

import io
import math

import numpy as np
import pytest

from granular import schemes, theory, verify
from granular.verify.incline import profile_error, states
from granular.verify.rows import at_least, at_most, checks, holds, report, within
from granular.verify.slug import fly, parabola

REPEATED = ("chute_quick", "economy_quick")
"""Quick checks whose runs other tests make as well: of stopping heights, and of cheaper scenes."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(c.name, marks=[pytest.mark.slow] * (c.slow or c.name in REPEATED))
        for c in checks.values()
    ],
)
def test_table(name):
    """All rows of the table; tests of what its measures detect are report those of each subject."""
    assert verify.failures(name) == []


def test_rows_pass_and_fail():
    assert at_most("q", 1.0, 1.0).passed
    assert not at_most("q", 1.1, 1.0).passed
    assert not at_least("q", 0.9, 1.0).passed
    assert within("q", 1.5, 1.0, 0.5).passed
    assert not within("q", 1.6, 1.0, 0.5).passed
    assert not holds("q", False).passed
    assert report("q", "1", "2").passed is None


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


def test_names_are_known_and_every_check_says_what_it_is():
    with pytest.raises(ValueError, match="only"):
        verify.main(only=["no_such_check"], out=io.StringIO())
    assert len(checks) > 40
    assert all(check.doc for check in checks.values())


# ---- errors that the measures of its rows detect ----


def test_profile_error_sees_the_profile():
    """Zero for the Bagnold profile, and one for points that have just started to move."""
    (state,) = states(25.0, 1e7, (0.02,))
    assert profile_error(state) == pytest.approx(1.0, abs=0.05)
    x, material = state.x[:, 1], state.scene.material
    fields = state.fields | {"v": state.v.copy()}
    fields["v"][:, 0] = 1.01 * theory.bagnold_profile(x, 25.0, 0.2, material, 9.8)
    moved = type(state)(scene=state.scene, time=0.0, step=0, dt=1.0, fields=fields)
    assert profile_error(moved) == pytest.approx(0.01, rel=1e-9)
    assert np.isfinite(moved.v).all()


def test_the_discrete_parabola_is_not_the_exact_one():
    """The integrator is first order in time: its parabola is n dt^2 g/2 off the exact one."""
    start, now = fly(schemes.dunatunga_kamrin_2015, 1e5, 0.05)
    t, g = now.step * now.dt, 9.8
    exact = start.x[:, 1] + t * start.v[:, 1] - 0.5 * g * t**2
    assert now.x[:, 1] - exact == pytest.approx(-0.5 * now.step * now.dt**2 * g, rel=1e-8)
    assert np.abs(now.x - parabola(start, now)[0]).max() < 1e-13
