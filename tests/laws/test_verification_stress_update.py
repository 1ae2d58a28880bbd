"""The stress update by itself: errors that the rows of the verification table detect."""

import numpy as np
import pytest

from granular import materials
from granular.verify.constitutive import (
    STEPS,
    constitutive_path,
    path_errors,
    random_states,
    update,
    update_50_digits,
)

SOFT = materials.glass_beads.replace(E=1e4)


def test_random_states_flow_and_rest():
    material = materials.glass_beads
    gradient, log_density, stress = random_states(material, 500)
    _, rate = update(material, 1e-5, gradient, log_density, stress)
    assert 50 < np.count_nonzero(rate) < 450


def test_50_digits_see_a_wrong_parameter():
    material = materials.glass_beads
    gradient, log_density, stress = random_states(material, 50)
    found = update(material.replace(mu_2=0.644), 1e-5, gradient, log_density, stress)[0]
    exact = [update_50_digits(material, 1e-5, g, s) for g, s in zip(gradient, stress, strict=True)]
    scale = np.abs(stress).max(axis=1)
    assert (np.abs(found - exact).max(axis=1) / scale).max() > 1e-6


def test_path_of_pure_compression_is_the_closed_form():
    """p = K ln(rho/rho_c): exact in a hypoelastic law with the volume map of the scheme."""

    def squeeze(t):
        gradient = np.zeros((*np.shape(t), 2, 2))
        gradient[..., 0, 0] = gradient[..., 1, 1] = -1e-3
        return gradient

    steep = SOFT.replace(mu_s=10.0, mu_2=11.0)  # in-plane compression does not yield
    _, stress = constitutive_path(steep, 100.0, 1e-3, duration=0.5, velocity_gradient=squeeze)
    pressure = -stress[-1, :3].sum() / 3
    assert pressure == pytest.approx(100.0 + steep.K * 2e-3 * 0.5, rel=1e-12)


def test_appendix_b_sees_a_wrong_update():
    """With the trial pressure the disconnected start is off its order at some dt."""
    found = path_errors(SOFT, 0.0, STEPS[:2], log_density0=-500.0 / SOFT.K)
    right = path_errors(
        SOFT, 0.0, STEPS[:2], log_density0=-500.0 / SOFT.K, pressure_from_density=True
    )
    assert not np.allclose(found, right, rtol=0.05)
