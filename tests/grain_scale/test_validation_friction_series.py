"""The stored series of shear flows: the law, the scalings of the thesis, a collapse."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from granular import calibrate
from granular.grain_scale import dem, friction_law
from granular.grain_scale.friction_law import SteadyShear

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
TABLE = json.loads((BENCHMARKS / "results" / "friction_law.json").read_text())


def series(name):
    found = [SteadyShear(**row["flow"]) for row in TABLE["rows"] if row["set"] == name]
    return sorted(found, key=lambda flow: flow.inertial_number)


def test_law_within_two_per_cent_from_one_thousandth_to_one():
    flows = series("low")
    inertial = [flow.inertial_number for flow in flows]
    assert len(flows) >= 6
    assert min(inertial) < 1.1e-3
    assert max(inertial) > 0.95
    for flow in flows + series("high") + series("walls"):
        assert flow.friction_by_law == pytest.approx(flow.friction, rel=0.02)
        # With the work of dilation the energy is balanced, within the error of the samples.
        assert flow.balance == pytest.approx(1.0, abs=max(0.01, 3 * flow.law_error))
        assert flow.normal_stress == pytest.approx(1e3, rel=0.06)


def test_scalings_are_those_of_the_thesis():
    """Gamma_n ~ I^2.4, Gamma_s ~ I^1.87, phi = 0.59 - 0.135 I, Z = 4 at rest (other grains)."""
    flows = series("low")
    inertial = np.array([flow.inertial_number for flow in flows])
    for kind, exponent in (("viscoelastic", 2.4), ("sliding", 1.87)):
        fit = friction_law.fit_dissipation(flows, kind)
        assert fit.exponent == pytest.approx(exponent, abs=0.2)
        slow = [flow for flow in flows if flow.inertial_number < 0.02]
        assert friction_law.fit_dissipation(slow, kind, slowest=0.0).exponent < fit.exponent - 0.5
    packing = calibrate.fit_packing(inertial, [flow.packing_fraction for flow in flows])
    assert packing.phi_max == pytest.approx(0.595, abs=0.015)
    assert packing.m == pytest.approx(0.135, abs=0.015)
    number = friction_law.fit_coordination(inertial, [flow.coordination for flow in flows])
    assert number.quasi_static == pytest.approx(4.0, abs=0.3)


def test_the_constants_that_are_kept_are_those_of_the_flows():
    fit = friction_law.fit_rheology(series("low"))
    kept = TABLE["fits"]["low"]["rheology"]
    assert (fit.mu_s, fit.mu_2, fit.I0) == pytest.approx((kept["mu_s"], kept["mu_2"], kept["I0"]))
    grains = dem.Grains(**TABLE["grains"]["low"])
    material = fit.material(d=grains.d_volume, rho_s=grains.rho_s)
    kept = TABLE["fits"]["low"]["material"]
    assert {name: material.arguments()[name] for name in kept} == pytest.approx(kept)


@pytest.mark.slow
def test_the_collapse_is_drawn(module, tmp_path):
    module("friction_collapse").main(["--quick", "--out", str(tmp_path)])
    with Image.open(tmp_path / "friction_collapse.png") as picture:
        assert min(picture.size) > 500
