"""The slope of a creeping flank, against stresses made from the same strain rate."""

import numpy as np
import pytest
from synthetic import isotropic, regular_points, scene, state

from granular.verify.hourglass import STEEPEST, creep_slope

CELL, FOOT, HEIGHT = 0.01, 0.75, 0.3
THETA = np.arctan(HEIGHT / FOOT)
SHEAR, PRESSURE = 0.4, 400.0
TURN = np.array([[np.cos(THETA), -np.sin(THETA)], [np.sin(THETA), np.cos(THETA)]])
"""Rotation to x down the slope and y normal to it."""


def creeping(compression, *, rate=SHEAR):
    """A triangle whose points move with D_xx = -D_yy = -compression, dv_x/dy = SHEAR."""
    s = scene((100, 40), CELL, parameters={"drop": 0.5, "orifice_radius": 0.02})
    x = regular_points(s, 2, lambda x: x[:, 1] < HEIGHT * (1 - x[:, 0] / FOOT))
    L = np.array([[-compression, SHEAR], [0.0, compression]])
    v = (x @ TURN.T) @ L.T @ TURN
    return state(s, x, v=v, shear_rate=rate, stress=isotropic(np.full(len(x), PRESSURE)))


def friction(material, rate):
    over = rate / (material.xi * np.sqrt(PRESSURE))
    return material.mu_s + (material.mu_2 - material.mu_s) * over / (1 + over)


@pytest.mark.parametrize("compression", [-0.05, 0.0, 0.03, 0.08])
def test_it_is_the_ratio_of_the_coaxial_stresses(compression):
    heap = creeping(compression)
    mu = friction(heap.scene.material, SHEAR)
    D = np.array([[-compression, SHEAR / 2], [SHEAR / 2, compression]])
    sigma = mu * PRESSURE * D / np.sqrt((D**2).sum() / 2) - PRESSURE * np.eye(2)
    slope, asked = creep_slope(heap)
    assert slope == pytest.approx(np.degrees(THETA), abs=0.1)
    assert asked == pytest.approx(np.degrees(np.arctan(-sigma[0, 1] / sigma[1, 1])), abs=0.05)


def test_no_compression_makes_it_steeper_than_the_steepest_at_rest():
    asked = [creep_slope(creeping(c, rate=0.0))[1] for c in np.linspace(0.0, 0.2, 41)]
    assert asked[0] == pytest.approx(20.9, abs=0.05)
    assert max(asked) == pytest.approx(STEEPEST, abs=0.02)
