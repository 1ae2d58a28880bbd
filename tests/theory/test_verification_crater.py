"""The depth of craters against the equation that it solves, and where that can be solved."""

import numpy as np
import pytest
from scipy.optimize import brentq

from granular import theory

BALL = {"D": 0.0254, "mu": 0.4, "density_ratio": 1.46}


def test_it_solves_the_law_with_the_total_fall_and_has_its_limits():
    def excess(depth, drop):
        fall = 0.14 / 0.4 * np.sqrt(1.46) * 0.0254 ** (2 / 3) * (drop + depth) ** (1 / 3)
        return depth - fall

    drops = np.array([[0.0, 1e-6, 1e-3], [0.1, 1.0, 100.0]])
    roots = [
        [brentq(excess, 1e-6, 10.0, args=(drop,), xtol=1e-15) for drop in row] for row in drops
    ]
    assert theory.crater_depth(drops, **BALL) == pytest.approx(np.array(roots), rel=1e-11)
    # without a fall d = k^(3/2); from high above d = k drop^(1/3)
    k = 0.14 / 0.4 * 1.46**0.5 * 0.0254 ** (2 / 3)
    assert theory.crater_depth(0.0, **BALL) == pytest.approx(k**1.5, rel=1e-13)
    assert theory.crater_depth(1e9, **BALL) == pytest.approx(k * 1e3, rel=1e-6)
