"""Short waves in uniform shear: mu(I) lets them grow, the regularised law does not."""

import functools
import math

import numpy as np
import pytest
from dilatant_point import rates
from stability import short_waves
from stability.short_waves import FAST, PLAIN, REGULARISED, SLOW

import granular as gr
from granular.theory import shear_wave_growth, shear_waves

growth = functools.cache(short_waves.growth)  # runs that two tests make


def barker(material, inertial_number, pressure, angle, k):
    """Growth rate of incompressible flow (Barker et al. 2015, equations of `theory.well_posed`)."""
    x, gain = inertial_number / material.I0, material.mu_2 - material.mu_s
    mu = material.mu_s + gain * x / (1 + x)
    r = gain * x / (1 + x) ** 2 / mu
    a, b = math.cos(2 * angle), math.sin(2 * angle)
    rate = inertial_number / material.d * math.sqrt(pressure / material.rho_s)
    bracket = 1 + (r - 1) * a**2 / (1 - mu * (1 - r / 2) * b)
    return -(k**2) * mu * pressure / (material.rho_c * rate) * bracket


@pytest.mark.parametrize("number", [0.005, 0.01, 1.5, 4.0])
def test_stiff_material_has_the_rates_of_incompressible_flow(number):
    """In the directions in which waves grow; the elastic waves are then far faster."""
    stiff, k = PLAIN.replace(E=1e16), 2e3
    for degrees in (77.0, 80.0, 84.0, 87.0):
        angle = math.radians(degrees)
        expected = barker(stiff, number, 1000.0, angle, k)
        found = shear_wave_growth(
            material=stiff,
            inertial_number=number,
            pressure=1000.0,
            wave_vector=(k * math.cos(angle), k * math.sin(angle)),
        )
        if expected > 0:
            assert found == pytest.approx(expected, rel=0.02)
        else:
            assert found < 1e-3 * k**2


def test_waves_of_mu_I_grow_the_faster_the_shorter_they_are():
    """With 8 cells a wave; the regularised law damps the same waves, the faster the shorter."""
    plain = [growth(PLAIN, length, 8) for length in (1.0, 0.5, 0.25)]
    rates = [run.measured for run in plain]
    assert rates[0] > 1.0 and rates[1] > 2.0 * rates[0] and rates[2] > 1.5 * rates[1]
    for run in plain:
        assert 0.7 * run.theory < run.measured < run.theory
        assert run.amplitudes[-1] > 5.0
    regular = [growth(REGULARISED, length, 8).measured for length in (1.0, 0.5)]
    assert 0.0 > regular[0] > regular[1]


def test_the_rate_converges_to_that_of_theory():
    """The error falls with the square of the cell: 26, 8 and 3 % with 8, 16 and 32 cells."""
    errors = [
        abs(run.measured / run.theory - 1) for run in (growth(PLAIN, 1.0, n) for n in (8, 16))
    ]
    assert errors[1] < 0.1
    assert errors[1] < 0.4 * errors[0]


def test_fast_flow_is_ill_posed_too():
    for material, sign in ((PLAIN, 1.0), (REGULARISED, -1.0)):
        runs = [growth(material, length, 8, number=FAST) for length in (0.125, 0.0625)]
        rates = [sign * run.measured for run in runs]
        assert rates[0] > 0 and rates[1] > 2.0 * rates[0]
        assert all(run.measured * run.theory > 0 for run in runs)


def test_bad_input_is_refused():
    given = {"inertial_number": SLOW, "pressure": 1e3, "wave_vector": (1.0, 2.0)}
    for change, error, message in (
        ({"material": gr.Elastic()}, TypeError, "must be a MuI, RegularisedMuI or"),
        ({"material": PLAIN.replace(cohesion=1.0)}, ValueError, "cohesion = 1.0"),
        ({"material": gr.MuI()}, ValueError, "grain diameter"),
        ({"inertial_number": 0.0}, ValueError, "inertial_number = 0.0"),
        ({"pressure": math.nan}, ValueError, "pressure = nan"),
        ({"wave_vector": (1.0,)}, ValueError, "wave_vector"),
    ):
        with pytest.raises(error, match=message):
            shear_waves(**{"material": PLAIN} | given | change)


# ---- material that dilates ----

BEADS = gr.DilatantMuI(E=1e9, d=0.005)


def fastest(material, number, length):
    """Largest growth of waves of a length [m] in all directions, over the shear rate."""
    k = 2 * math.pi / length
    return max(
        shear_wave_growth(
            material=material,
            inertial_number=number,
            pressure=1e3,
            wave_vector=(k * math.cos(angle), k * math.sin(angle)),
        )
        for angle in np.linspace(0, math.pi, 61)
    ) / (number / material.d * math.sqrt(1e3 / material.rho_s))


def test_dilation_bounds_the_growth_of_short_waves_in_slow_flow():
    """Where mu(I) is ill posed they grow with 1/length^2; slower than I = 0.005 so do both."""
    plain = gr.MuI(E=1e9, I0=BEADS.I0, d=BEADS.d, rho_s=BEADS.rho_s, rho_c=BEADS.rho_c)
    assert fastest(plain, 0.01, 1e-2) > 1e3 and fastest(plain, 0.01, 1e-3) > 5e4
    assert all(fastest(BEADS, 0.01, length) < 8.0 for length in (1.0, 0.1, 1e-2, 1e-3))
    assert all(fastest(BEADS, number, 1e-3) < 1e-6 for number in (0.1, 0.5))
    assert fastest(BEADS, 1e-3, 1e-3) > 1e5


def test_the_waves_of_a_law_that_hardly_dilates_are_those_of_mu_I():
    flat = BEADS.replace(dilatancy=0.0, phi_fast=BEADS.phi_c)
    plain = gr.MuI(E=1e9, I0=flat.I0, d=flat.d, rho_s=flat.rho_s, rho_c=flat.rho_c)
    given = {"inertial_number": 0.05, "pressure": 1e3, "wave_vector": (30.0, 70.0)}
    ours, _ = shear_waves(material=flat, **given)
    theirs, _ = shear_waves(material=plain, **given)
    ours = np.delete(ours, np.argmin(abs(ours)))  # that of the packing
    assert sorted(ours, key=lambda z: (z.real, z.imag)) == pytest.approx(
        sorted(theirs, key=lambda z: (z.real, z.imag)), rel=1e-9
    )


ON_LINE = BEADS.replace(csl_slope=0.05)


@pytest.mark.parametrize(("m", "p"), [(BEADS, 1e3), (ON_LINE, 3e5)], ids=["constant", "line"])
@pytest.mark.parametrize("number", [0.01, 0.1, 1.0])
def test_long_waves_have_the_rates_of_the_law_by_differences(m, p, number):
    """The linearised law is that of the rate equations at a point, in a homogeneous flow."""
    g = number / m.d * math.sqrt(p / m.rho_s)
    packing = m.packing(number, p)

    def change(y):
        xx, yy, xy, c, log_packing = y
        tau = math.sqrt((xx * xx + yy * yy + (xx + yy) ** 2) / 2 + xy * xy)
        plastic, psi = rates(m, packing * math.exp(log_packing), p + m.K * c, tau)
        flow = m.G * plastic / tau
        return np.array([
            g * xy - flow * xx, -g * xy - flow * yy, m.G * g - flow * xy + g * (yy - xx) / 2,
            psi * plastic, -psi * plastic,
        ])  # fmt: skip

    base, steps = (
        np.array([0.0, 0.0, m.friction(number) * p, 0.0, 0.0]),
        (1e-3, 1e-3, 1e-3, 1e-12, 1e-9),
    )
    jacobian = np.array(
        [
            (change(base + h * e) - change(base - h * e)) / (2 * h)
            for h, e in zip(steps, np.eye(5), strict=True)
        ]
    ).T
    assert abs(change(base)[2:]).max() < 1e-6 * m.G * g
    expected = np.linalg.eigvals(jacobian)
    found, _ = shear_waves(material=m, inertial_number=number, pressure=p, wave_vector=(1e-9, 1e-9))
    scale = abs(expected).max()
    for rate in expected:
        assert abs(found - rate).min() < 1e-4 * max(abs(rate), 1e-6 * scale)
