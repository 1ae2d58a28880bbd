"""Closed forms of Hencky's elasticity against quadrature, ODEs and a chain of masses."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh_tridiagonal
from scipy.optimize import brentq

from granular import theory

SOFT = SimpleNamespace(K=1e5, G=6e4, rho_c=1600.0)
MODULUS = SOFT.K + 4 * SOFT.G / 3


def test_column_against_an_integration_of_its_balance():
    """A tall soft column with a strain of 6.5 %."""
    height, gravity = 0.8, 9.81
    Y = np.linspace(0.0, height, 41)
    column = theory.hencky_column(Y, height, SOFT, gravity)

    def strain(y):
        load = SOFT.rho_c * gravity * (height - y)
        return brentq(lambda e: MODULUS * e * math.exp(-e) + load, -1.0, 1e-12, xtol=1e-16)

    np.testing.assert_allclose(column.log_stretch, [strain(y) for y in Y], atol=1e-14)
    found = solve_ivp(
        lambda y, _: [math.exp(strain(y))], (0, height), [0.0], "DOP853", Y, rtol=1e-11, atol=1e-13
    )
    np.testing.assert_allclose(column.y, found.y[0], atol=1e-11)
    assert column.height == pytest.approx(column.y[-1], rel=1e-14)
    load = SOFT.rho_c * gravity * height / MODULUS
    series = -load + load**2 - 1.5 * load**3 + 8 / 3 * load**4
    assert column.log_stretch[0] == pytest.approx(series, abs=10 * load**5)
    assert column.stress[-1] == pytest.approx([0.0] * 4, abs=1e-9)


def test_column_is_in_balance_and_has_the_stress_of_its_strain():
    Y = np.linspace(0.0, 0.8, 2001)
    column = theory.hencky_column(Y, 0.8, SOFT)
    density = SOFT.rho_c * np.exp(-column.log_stretch)
    slope = np.gradient(column.stress[:, 1], column.y, edge_order=2)
    np.testing.assert_allclose(slope, 9.81 * density, rtol=1e-6)
    e = column.log_stretch[:, None, None] * np.diag([0.0, 1.0, 0.0])
    trace = column.log_stretch[:, None, None] * np.eye(3)
    kirchhoff = SOFT.K * trace + 2 * SOFT.G * (e - trace / 3)
    cauchy = kirchhoff * np.exp(-column.log_stretch)[:, None, None]
    for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1))):
        np.testing.assert_allclose(column.stress[:, k], cauchy[:, i, j], atol=1e-9)
    p = -column.stress[:-1, :3].mean(axis=1)
    s = column.stress[:-1, :3] + p[:, None]
    np.testing.assert_allclose(np.sqrt((s**2).sum(axis=1) / 2) / p, column.friction, rtol=1e-12)


@pytest.mark.parametrize("ends", ["fixed-free", "fixed-fixed"])
@pytest.mark.parametrize("mode", [1, 2, 3])
def test_frequency_of_a_compressed_bar_is_that_of_a_chain(ends, mode):
    """Masses and springs with P = M e exp(-e), linearised about a stretch by differences."""
    e, length, n = -0.1, 0.5, 2000
    wave = theory.standing_wave(0.1, 0.0, length, 1e-6, SOFT, ends=ends, mode=mode, log_stretch=e)
    stretch = math.exp(e)

    def force(stretch):
        return MODULUS * math.log(stretch) / stretch

    spring = (force(stretch * (1 + 1e-5)) - force(stretch * (1 - 1e-5))) / (2e-5 * stretch)
    spacing = length / stretch / n  # undeformed
    free = ends == "fixed-free"
    masses = n if free else n - 1
    diagonal = np.full(masses, 2.0)
    diagonal[-1] -= free
    mass = np.full(masses, SOFT.rho_c * spacing)
    mass[-1] *= 0.5 if free else 1.0
    off = -spring / spacing / np.sqrt(mass[:-1] * mass[1:])
    values = eigh_tridiagonal(
        diagonal * spring / spacing / mass, off, select="i", select_range=(mode - 1, mode - 1),
        eigvals_only=True,
    )  # fmt: skip
    assert wave.frequency == pytest.approx(math.sqrt(values[0]) / (2 * math.pi), rel=1e-5)


def test_wave_solves_its_equation_and_keeps_its_ends():
    x, t = np.linspace(0, 0.5, 801), 0.0123
    for ends in ("fixed-free", "fixed-fixed"):
        wave = theory.standing_wave(x, t, 0.5, 1e-5, SOFT, ends=ends, mode=2)
        np.testing.assert_allclose(
            np.gradient(wave.displacement, x, edge_order=2), wave.strain, atol=2e-9
        )
        later, sooner = (
            theory.standing_wave(x, t + dt, 0.5, 1e-5, SOFT, ends=ends, mode=2)
            for dt in (1e-6, -1e-6)
        )
        np.testing.assert_allclose(
            (later.displacement - sooner.displacement) / 2e-6, wave.velocity, atol=1e-9
        )
        acceleration = (later.velocity - sooner.velocity) / 2e-6
        bent = wave.wave_speed**2 * np.gradient(wave.strain, x, edge_order=2)
        np.testing.assert_allclose(acceleration, bent, atol=1e-4 * np.abs(bent).max())
        assert wave.displacement[0] == 0
        end = wave.strain if ends == "fixed-free" else wave.displacement
        assert abs(end[-1]) < 1e-13
    assert wave.wave_speed == pytest.approx(math.sqrt(MODULUS / SOFT.rho_c))
