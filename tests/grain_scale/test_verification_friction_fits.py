"""Fits of the friction law and the mu(I) rheology, to data with known constants."""

import math
from dataclasses import replace

import numpy as np
import pytest

import granular as gr
from granular import calibrate
from granular.grain_scale import friction_law
from granular.grain_scale.friction_law import SteadyShear

INERTIAL = np.geomspace(1e-3, 1.5, 12)
TRUE = {"mu_s": 0.38, "mu_2": 0.75, "I0": 0.35}


def law(inertial):
    return TRUE["mu_s"] + (TRUE["mu_2"] - TRUE["mu_s"]) / (TRUE["I0"] / inertial + 1)


def test_exact_data_give_their_constants_and_errors_weigh_the_points():
    fit = calibrate.fit_mu_I(INERTIAL, law(INERTIAL))
    assert (fit.mu_s, fit.mu_2, fit.I0) == pytest.approx(tuple(TRUE.values()), rel=1e-6)
    assert np.abs(fit.residuals).max() < 1e-8
    assert fit(INERTIAL) == pytest.approx(law(INERTIAL))
    # a wrong point that is known to be uncertain does not change them
    friction, error = law(INERTIAL), np.full(len(INERTIAL), 1e-4)
    friction[5] += 0.05
    error[5] = 1.0
    fit = calibrate.fit_mu_I(INERTIAL, friction, error)
    assert (fit.mu_s, fit.mu_2, fit.I0) == pytest.approx(tuple(TRUE.values()), rel=1e-4)
    assert calibrate.fit_mu_I(INERTIAL, friction).I0 != pytest.approx(TRUE["I0"], rel=0.02)


@pytest.mark.parametrize("confidence", [0.95, 0.6])
def test_intervals_hold_the_constants_as_often_as_they_say(confidence):
    # Fast flows: mu_2 is known much better than the increase to it from mu_s.
    rng, inertial = np.random.default_rng(11), np.geomspace(0.1, 30.0, 12)
    hits, runs = dict.fromkeys(TRUE, 0), 300
    for _ in range(runs):
        noisy = law(inertial) + rng.normal(0.0, 0.002, len(inertial))
        found = calibrate.fit_mu_I(inertial, noisy, confidence=confidence).intervals
        for name, value in TRUE.items():
            hits[name] += found[name][0] <= value <= found[name][1]
    # Four standard deviations of a binomial count, and 0.015 for nonlinearity.
    allowed = 4 * math.sqrt(confidence * (1 - confidence) / runs) + 0.015
    for name, count in hits.items():
        assert abs(count / runs - confidence) < allowed, (name, count / runs)


def test_laws_of_the_thesis_give_their_constants():
    coordination = friction_law.fit_coordination(INERTIAL, -0.3 + 1.2 / (0.28 + INERTIAL) + 0.5)
    assert (coordination.Z1, coordination.Z2, coordination.b) == pytest.approx((0.2, 1.2, 0.28))
    assert coordination.quasi_static == pytest.approx(0.2 + 1.2 / 0.28)
    packing = calibrate.fit_packing(INERTIAL, 0.595 - 0.135 * INERTIAL)
    assert (packing.phi_max, packing.m) == pytest.approx((0.595, 0.135))
    power = friction_law.fit_power(INERTIAL, 1.7 * INERTIAL**2.4)
    assert (power.coefficient, power.exponent) == pytest.approx((1.7, 2.4))
    assert power(0.1) == pytest.approx(1.7 * 0.1**2.4)
    points = [replace(flow(i, 0.4, 0.5), sliding=3.0 * max(i, 0.06) ** 1.8) for i in INERTIAL]
    fit = friction_law.fit_dissipation(points, "sliding", slowest=0.06)
    assert (fit.coefficient, fit.exponent) == pytest.approx((3.0, 1.8))
    with pytest.raises(ValueError, match="kind = 'rolling'"):
        friction_law.fit_dissipation(points, "rolling")


def flow(inertial, friction, packing):
    """A flow with equal normal stresses, in which friction and inertial number are invariant."""
    return SteadyShear(
        inertial_number=inertial,
        shear_rate=1.0,
        normal_stress=100.0,
        stress=(-100.0, 100 * friction, 0.0, 100 * friction, -100.0, 0.0, 0.0, 0.0, -100.0),
        coordination=3.0,
        packing_fraction=packing,
        viscoelastic=1.0,
        sliding=1.0,
        dissipation_unit=1.0,
        dilation=0.0,
        slipping=0.1,
        kinetic=0.0,
    )


def test_from_flows_to_the_material_of_a_scene():
    points = [flow(i, law(i), 0.6 - 0.13 * i) for i in INERTIAL]
    fit = friction_law.fit_rheology(points)
    grains = fit.material(d=1e-3, rho_s=2500.0, E=1e6)
    assert isinstance(grains, gr.materials.MuI)
    assert grains.rho_c == pytest.approx(1500.0)
    assert (grains.mu_s, grains.mu_2, grains.I0) == pytest.approx(tuple(TRUE.values()), rel=1e-6)
    assert grains.xi == pytest.approx(0.35 / (1e-3 * 50.0))
    scene = gr.scenes.column_collapse(aspect=1.0, cell=0.05, material=grains)
    simulation = gr.Simulation(scene, threads=1)
    simulation.step(20)
    assert simulation.state.n == scene.n_points
    assert fit.material(d=1e-3, rho_s=2500.0, rho_c=1400.0).rho_c == 1400.0
    with pytest.raises(ValueError, match="no packing fractions"):
        calibrate.fit_mu_I(INERTIAL, law(INERTIAL)).material(d=1e-3, rho_s=2500.0)


NOT_DETERMINED = r"do not determine|mu_s < mu_2"


@pytest.mark.parametrize(
    ("fit", "data", "options", "words"),
    [
        (calibrate.fit_mu_I, (INERTIAL, np.full(12, 0.4)), {}, NOT_DETERMINED),
        (calibrate.fit_mu_I, (INERTIAL, law(INERTIAL)[::-1]), {}, NOT_DETERMINED),
        (calibrate.fit_mu_I, ([0.1, 0.2, 0.2, 0.3], [0.4, 0.5, 0.5, 0.6]), {}, "at least 4"),
        (calibrate.fit_mu_I, (INERTIAL, law(INERTIAL)), {"confidence": 1.0}, "confidence = 1"),
        (friction_law.fit_power, ([0.1, 0.2, -0.3], [1.0, 2.0, 3.0]), {}, "finite and > 0"),
        (calibrate.fit_packing, ([0.1, 0.2], [0.5]), {}, "equal length"),
        (friction_law.fit_rheology, ([flow(0.1, 0.4, 0.5)] * 3,), {}, "3 flows"),
    ],
)
def test_data_that_do_not_determine_the_constants_are_refused(fit, data, options, words):
    with pytest.raises(ValueError, match=words):
        fit(*data, **options)
