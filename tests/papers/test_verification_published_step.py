"""The published step of Haeri & Skonieczny (2021): F and F^p, of which the volume drifts."""

import numpy as np
import pytest

import granular as gr
from granular import _core
from granular.papers.haeri2021.published_step import DT, P0, predicted_pressure, sheared

BEADS = gr.materials.couette_beads


def test_it_loses_pressure_in_shear():
    """p falls by K dt gdot^2 t/4, as much as ln det F^p does."""
    for rate, until in ((1.0, 0.2), (5.0, 0.1)):
        path = sheared(BEADS, rate, until)
        lost = P0 - predicted_pressure(BEADS, rate, path.times[-1])
        assert P0 - path.pressure[-1] == pytest.approx(lost, rel=0.02)
        fallen = -BEADS.K * np.log(path.plastic_volume[-1])
        assert P0 - path.pressure[-1] == pytest.approx(fallen, rel=2e-3)  # of the step before
    end = sheared(BEADS, 5.0, 0.2)
    assert end.pressure[-1] == 0 and end.times[-1] < 0.13


def test_the_law_of_the_package_keeps_the_pressure():
    """The same beads, step and shear; the stress is kept as rows of components."""
    parameters = {
        name: getattr(BEADS, name) for name in ("K", "G", "mu_s", "mu_2", "I0", "rho_s", "d", "t0")
    } | {"p_averaging": 0.0, "reconnect_fluidity": 1.0}
    L = np.zeros((9, 1))
    L[1] = 5.0 * DT
    stress = np.zeros((6, 1))
    stress[:3] = -P0
    c, g, rate = np.array([P0 / BEADS.K]), np.array([1.0]), np.zeros(1)
    for _ in range(1300):
        _core.hencky_update("linear_ngf", parameters, DT, L, c, stress, g, rate, "")
    assert -stress[:3].mean() == pytest.approx(P0, rel=1e-14)
    assert np.abs(stress[3]).max() > 0.3 * P0


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "until", "left"), [(0.3, 3.0, 732.5), (1.0, 2.0, 300.0)])
def test_it_over_seconds(rate, until, left):
    assert sheared(BEADS, rate, until).pressure[-1] == pytest.approx(left, abs=0.5)
