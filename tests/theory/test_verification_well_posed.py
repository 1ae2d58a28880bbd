"""The criterion of ill-posedness against the growth rates of the linearised equations."""

import math

import numpy as np
import pytest

import granular as gr
from granular import theory

BEADS = gr.materials.glass_beads


def stress(D, p, material):
    """Deviator mu(I) p A of the law, with xi in place of d and rho_s."""
    shear_rate = math.sqrt(2 * np.sum(D * D))
    x = shear_rate / (material.xi * math.sqrt(p))
    mu = material.mu_s + (material.mu_2 - material.mu_s) * x / (1 + x)
    return 2 * mu * p * D / shear_rate


def response(angle, D, p, material, h=1e-6):
    """Shear stress by which the law resists the motion of a short wave, per unit gradient.

    Computed by differences of the law; the momentum along the wave, 0 = -p' + k.s'.k, gives p'. If
    negative, the stress drives the wave, at a rate proportional to |k|^2.
    """
    k = np.array([math.cos(angle), math.sin(angle)])
    t = np.array([-k[1], k[0]])
    E = h * math.sqrt(2 * np.sum(D * D)) * (np.outer(t, k) + np.outer(k, t)) / 2
    step = np.linalg.norm(E) * math.sqrt(2)
    by_rate = (stress(D + E, p, material) - stress(D - E, p, material)) / (2 * step)
    by_pressure = (stress(D, p * (1 + h), material) - stress(D, p * (1 - h), material)) / (
        2 * h * p
    )
    pressure = (k @ by_rate @ k) / (1 - k @ by_pressure @ k)
    return t @ by_rate @ k + pressure * (t @ by_pressure @ k)


@pytest.mark.parametrize("mu_2", [0.45, 0.6435, 0.9])
def test_waves_grow_where_the_criterion_says_so(mu_2):
    """A wave grows in at least one direction, for 40 inertial numbers."""
    material = BEADS.replace(mu_2=mu_2)
    D = np.array([[0.3, 0.8], [0.8, -0.3]])
    shear_rate = math.sqrt(2 * np.sum(D * D))
    seen = set()
    for x in np.logspace(-3, 2, 16):
        p = (shear_rate / (x * material.xi)) ** 2
        worst = min(response(angle, D, p, material) for angle in np.linspace(0, math.pi, 181))
        C = theory.ill_posedness(x, material)
        assert abs(C) > 1e-3  # the number of directions is finite
        assert (worst < 0) == (C > 0), (x, C, worst)
        seen.add(bool(C > 0))
    assert seen == ({True, False} if theory.well_posed_range(material) else {True})


def test_ends_of_the_range():
    """Table 1 of Dunatunga & Kamrin 2015: 0.0193 < I < 0.849, slopes of 21.7 to 30.1 deg."""
    low, high = theory.well_posed_range(BEADS)
    assert 0.278 * low == pytest.approx(0.0193, abs=1e-4)
    assert 0.278 * high == pytest.approx(0.849, abs=1e-3)
    assert theory.well_posed_slopes(BEADS) == pytest.approx((21.75, 30.07), abs=0.01)
    for end, sign in ((low, 1), (high, -1)):
        assert sign * theory.ill_posedness(end * 0.999, BEADS) > 0
        assert sign * theory.ill_posedness(end * 1.001, BEADS) < 0
    for slope, x in zip(theory.well_posed_slopes(BEADS), (low, high), strict=True):
        assert theory.scaled_inertial_number_of_slope(slope, BEADS) == pytest.approx(x)


def test_ends_of_the_range_of_other_laws():
    """With mu_2 far above mu_s only (mu_2 - mu_s)/I0 counts, however large mu_2 is."""
    ends = [np.array(theory.well_posed_range(BEADS.replace(mu_2=mu_2))) for mu_2 in (1e4, 1e6)]
    np.testing.assert_allclose(1e4 * ends[0], 1e6 * ends[1], rtol=2e-4)
    # without dependence on the rate it is never well posed
    nearly = BEADS.replace(mu_2=0.40)
    assert theory.well_posed_range(nearly) is None
    assert theory.well_posed_slopes(nearly) is None


@pytest.mark.parametrize("mu_s", [1e-2, 1e-3, 1e-5])
def test_ends_of_the_range_with_little_friction(mu_s):
    """Then C = mu^2 - 4 r, and the range is from mu_s^3/4(mu_2 - mu_s) to 4(mu_2 - mu_s)/mu_2^3."""
    low, high = theory.well_posed_range(BEADS.replace(mu_s=mu_s, mu_2=2 * mu_s))
    assert low == pytest.approx(mu_s**2 / 4, rel=10 * mu_s**2 + 1e-5)
    assert high == pytest.approx(1 / (2 * mu_s**2), rel=10 * mu_s + 1e-5)


def test_slopes_outside_of_the_law():
    assert theory.scaled_inertial_number_of_slope(20.0, BEADS) == 0.0
    assert theory.scaled_inertial_number_of_slope(33.0, BEADS) == math.inf
    with pytest.raises(ValueError, match="angle_deg = 90"):
        theory.scaled_inertial_number_of_slope(90.0, BEADS)
