"""The slug: rows of the verification table, and the accuracy of the discrete parabola."""

import numpy as np
import pytest

from granular import verify
from granular.mpm import schemes
from granular.verify.slug import fly, parabola


def test_table():
    assert verify.failures("slug_flight") == []


@pytest.mark.slow
def test_at_rest():
    assert verify.failures("slug_at_rest") == []


def test_the_discrete_parabola_is_not_the_exact_one():
    """The integrator is first order in time: its parabola is n dt^2 g/2 off the exact one."""
    start, now = fly(schemes.dunatunga_kamrin_2015, 1e5, 0.05)
    t, g = now.step * now.dt, 9.8
    exact = start.x[:, 1] + t * start.v[:, 1] - 0.5 * g * t**2
    assert now.x[:, 1] - exact == pytest.approx(-0.5 * now.step * now.dt**2 * g, rel=1e-8)
    assert np.abs(now.x - parabola(start, now)[0]).max() < 1e-13
