"""Appendix A: each closed form against the equation that it solves."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from granular.theory import (
    compression_pressure,
    compression_temperature,
    coupled_shear,
    gas_pressure,
    granular_temperature,
    packing_fraction_of_inertial_number,
    radial_function,
    shear_pressure,
    shear_temperature,
    temperature_coefficients,
)

GRAINS = SimpleNamespace(rho_s=2450.0, rho_c=1500.0, K=1e9 / 1.2)
GAS = {"diameter": 0.005, "restitution": 0.7}
SHEAR = GAS | {"material": GRAINS}


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.9, 1.0])
def test_packing_fraction_solves_the_dense_quadratic(restitution):
    number = np.array([1e-6, 1e-3, 0.1, 0.5])
    phi = packing_fraction_of_inertial_number(number, restitution)
    lam = (1 + restitution) / 2
    left = (0.6 - phi) * 9 / number
    np.testing.assert_allclose(left, (2.52 * lam - 1) * phi**2 + 0.6 * phi, rtol=1e-8)
    assert np.all(phi > 0.49)


def test_packing_fraction_over_all_inertial_numbers():
    number = np.concatenate([[0.0], np.geomspace(1e-6, 1e3, 400)])
    phi = packing_fraction_of_inertial_number(number, 0.7)
    assert phi[0] == 0.6
    assert np.all(np.diff(phi) <= 0)
    assert phi[-1] < 0.01
    loose = (phi > 0) & (phi < 0.489)
    factor = phi * (4 * 0.85 * phi * (1 - phi / 2) / (1 - phi) ** 3 + 1)
    np.testing.assert_allclose(factor[loose], 9 / number[loose], rtol=1e-10)


@pytest.mark.parametrize("phi", [0.2, 0.45, 0.5, 0.55, 0.599])
def test_shear_pressure_inverts_the_packing_fraction(phi):
    rate = 12.0
    p = shear_pressure(phi, rate, **SHEAR)
    number = rate * GAS["diameter"] * math.sqrt(GRAINS.rho_s / p)
    back = packing_fraction_of_inertial_number(number, GAS["restitution"])
    assert back == pytest.approx(phi, rel=1e-12)
    # and is the equation of state at the temperature of the shear
    temperature = shear_temperature(rate, number, GAS["diameter"])
    assert gas_pressure(phi, temperature, GAS["restitution"], GRAINS) == pytest.approx(p, rel=1e-12)


def test_shear_and_compression_pressure_as_printed():
    phi, rate, lam = 0.56, 3.0, 0.85
    printed = GRAINS.rho_s * phi**2 / 81 * (2.52 * lam * phi / (0.6 - phi) + 1) ** 2
    expected = printed * (rate * GAS["diameter"]) ** 2
    assert shear_pressure(phi, rate, **SHEAR) == pytest.approx(expected, rel=1e-12)
    phi, rate, lam = 0.55, 6.0, 0.85
    g = 0.63 * phi / (0.6 - phi)
    printed = math.pi * GRAINS.rho_s * phi * (4 * g * lam + 1) / (144 * (lam - 1) ** 2)
    printed *= (1 + 1 / (4 * g * lam)) ** 2 * (rate * GAS["diameter"]) ** 2
    assert compression_pressure(phi, rate, **SHEAR) == pytest.approx(printed, rel=1e-12)


def test_radial_function_branches_nearly_meet():
    below, at = radial_function([np.nextafter(0.49, 0), 0.49])
    assert at == pytest.approx(0.63 * 0.49 / 0.11, rel=1e-12)
    assert below == pytest.approx(at, rel=7e-3)
    assert below != at


@pytest.mark.parametrize("compression_rate", [4.0, -4.0, 1e-9, 0.0])
def test_temperature_solves_its_differential_equation(compression_rate):
    phi, start, times = 0.55, 2e-5, np.linspace(0, 0.3, 7)
    # The balance of fluctuation energy (A14, A15) itself, without the coefficients A and B.
    lam, g = 0.85, 0.63 * phi / (0.6 - phi)
    rho = GRAINS.rho_s * phi

    def rate(t, temperature):
        work = 4 * rho * g * (lam + 1 / (4 * g)) * temperature * compression_rate
        loss = 12 / math.sqrt(math.pi) * rho * g / GAS["diameter"] * (1 - 0.7**2)
        return (work - loss * np.abs(temperature) ** 1.5) / (1.5 * rho)

    exact = solve_ivp(rate, (0, 0.3), [start], "DOP853", times, rtol=1e-11, atol=1e-20).y[0]
    solution = granular_temperature(times, start, phi, compression_rate, **GAS)
    np.testing.assert_allclose(solution, exact, rtol=1e-8)


def test_temperature_as_printed_and_its_limits():
    """(A21) with its constant C from the initial value."""
    phi, start, times = 0.52, 1e-4, np.array([0.0, 0.01, 0.2])
    A, B = temperature_coefficients(phi, 4.0, **GAS)
    u0 = math.sqrt(start)
    AC = 2 * math.log(u0 / (A - B * u0))
    printed = A**2 * np.exp(A * times + AC) / (1 + B * np.exp((A * times + AC) / 2)) ** 2
    np.testing.assert_allclose(granular_temperature(times, start, phi, 4.0, **GAS), printed)
    assert np.all(granular_temperature([0.0, 1.0, 10.0], 0.0, 0.5, 6.0, **GAS) == 0)
    assert granular_temperature([1e6], 1.0, 0.5, -6.0, **GAS)[0] == 0
    assert compression_temperature(0.5, -6.0, **GAS) == 0
    elastic = granular_temperature([0.1], 1e-4, 0.5, 6.0, diameter=0.005, restitution=1.0)
    A, _ = temperature_coefficients(0.5, 6.0, diameter=0.005, restitution=1.0)
    assert elastic[0] == pytest.approx(1e-4 * math.exp(0.1 * A), rel=1e-12)


@pytest.mark.parametrize("start", [1e-9, 1.0])
def test_the_bound_is_where_the_temperature_ends(start):
    phi, rate = 0.5, 6.0
    late = granular_temperature([1e6], start, phi, rate, **GAS)[0]
    bound = compression_temperature(phi, rate, **GAS)
    assert late == pytest.approx(bound, rel=1e-12)
    A, B = temperature_coefficients(phi, rate, **GAS)
    assert A * bound == pytest.approx(B * bound**1.5, rel=1e-12)


@pytest.mark.parametrize("phi", [0.3, 0.5, 0.59, 0.6, 0.61, 0.65])
@pytest.mark.parametrize("rate", [1e-3, 1.0, 100.0])
def test_coupled_system_is_satisfied(phi, rate):
    result = coupled_shear(phi, rate, **SHEAR)
    assert result.p > 0
    assert result.inverse_elastic < 0
    assert 1 / result.packing_fraction_flow + result.inverse_elastic == pytest.approx(1 / phi)
    critical = GRAINS.rho_c / GRAINS.rho_s
    assert result.p == pytest.approx(-critical * GRAINS.K * result.inverse_elastic, rel=1e-12)
    if result.packing_fraction_flow < 0.5999:
        flow = shear_pressure(result.packing_fraction_flow, rate, **SHEAR)
        assert result.p == pytest.approx(flow, rel=1e-6)


def test_limits_of_the_coupled_system():
    # Rigid grains: the elastic volume vanishes and the shear pressure (A10) is left.
    rigid = SimpleNamespace(rho_s=2450.0, rho_c=1500.0, K=1e20)
    alone = shear_pressure(0.55, 5.0, **SHEAR)
    assert coupled_shear(0.55, 5.0, **(SHEAR | {"material": rigid})).p == pytest.approx(alone)
    # No shear, grains that jam at Phi_c: the equation of state (2.7).
    jamming = SimpleNamespace(rho_s=2500.0, rho_c=1500.0, K=1e8)
    for phi in (0.55, 0.6, 0.62):
        state = max(1e8 * (1 - 0.6 / phi), 0.0)
        static, slow = (
            coupled_shear(phi, rate, **(SHEAR | {"material": jamming})).p for rate in (0.0, 1e-7)
        )
        assert static == pytest.approx(state, abs=1e-6)
        assert slow == pytest.approx(state, rel=1e-6, abs=1e-8 * jamming.K)
    # The laws of the package bear K ln(rho/rho_c), which is more by the share p/2K.
    c, law = 0.02, 0.02 * jamming.K
    static = coupled_shear(0.6 * math.exp(c), 0.0, **(SHEAR | {"material": jamming})).p
    assert law / static - 1 == pytest.approx(static / (2 * jamming.K), rel=0.02)
    # With the offset, the flowing volume of table 1 jams at its own Phi_c.
    critical = GRAINS.rho_c / GRAINS.rho_s
    assert coupled_shear(critical, 0.0, offset=0.6 - critical, **SHEAR).p == pytest.approx(
        0, abs=1e-6
    )
