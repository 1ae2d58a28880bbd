"""One column on the incline against the one-dimensional PDE and the Bagnold profile."""

import numpy as np
import pytest

from granular import theory, verify
from granular.verify.incline import profile_error, states


def test_table():
    assert verify.failures("incline_quick") == []


@pytest.mark.slow
def test_steady_profile():
    assert verify.failures("incline_steady") == []


def test_profile_error_sees_the_profile():
    """Zero for the Bagnold profile, and one for points that have just started to move."""
    (state,) = states(25.0, 1e7, (0.02,))
    assert profile_error(state) == pytest.approx(1.0, abs=0.05)
    x, material = state.x[:, 1], state.scene.material
    fields = state.fields | {"v": state.v.copy()}
    fields["v"][:, 0] = 1.01 * theory.bagnold_profile(x, 25.0, 0.2, material)
    moved = type(state)(scene=state.scene, time=0.0, step=0, dt=1.0, fields=fields)
    assert profile_error(moved) == pytest.approx(0.01, rel=1e-9)
    assert np.isfinite(moved.v).all()
