"""Appendix A for states: packing fraction, neglected pressures, balance of the rebuilt density."""

import numpy as np
import pytest
from refusals import refused
from synthetic import RHO_C, RHO_S, filled, isotropic, material, regular_points, scene, state

from granular.measure import (
    inertial_number,
    mass_balance_error,
    packing_fraction,
    stress_free_error,
)

D = 0.005
CELL = 0.05


def flow(*, shape=(6, 6), p=2000.0, rate=4.0, v=None, periodic=None):
    s = scene(shape, CELL, grains=material(d=D, I0=0.278), periodic=periodic)
    stress = isotropic(np.full(len(regular_points(s)), p))
    return filled(s, stress=stress, shear_rate=rate, **({} if v is None else {"v": v}))


def test_the_packing_fraction_solves_the_quadratic():
    points = flow(rate=np.linspace(0.1, 30, 144))
    e = 0.7
    phi = packing_fraction(points, restitution=e)
    number = inertial_number(points)
    lam = (1 + e) / 2
    # (A5) with (A6): Phi (4 lam G + 1) = 9/I, G = 0.63 Phi/(0.6 - Phi)
    assert np.all(phi > 0.49)
    assert np.allclose(phi * (2.52 * lam * phi / (0.6 - phi) + 1), 9 / number, rtol=1e-9)
    assert np.all(np.diff(phi) < 0)


def test_stress_free_points_keep_their_density():
    points = flow()
    stress = np.where(np.arange(points.n)[:, None] < 10, 0.0, points.stress)
    mixed = state(points.scene, points.x, stress=stress, rho=1200.0, shear_rate=4.0)
    phi = packing_fraction(mixed, restitution=0.7)
    assert np.allclose(phi[:10], 1200 / RHO_S)
    assert np.all(phi[10:] > 0.55)


def test_the_two_estimates_are_the_papers_formulas():
    e, margin = 0.6, 0.02
    points = flow(v=lambda x: np.tile([0.03, 0.04], (len(x), 1)))
    result = stress_free_error(points, restitution=e, margin=margin)
    lam, phi, rate = (1 + e) / 2, 0.6 - margin, 0.05 / D
    G = 0.63 * phi / (0.6 - phi)
    shear = RHO_S * phi**2 / 81 * (4 * lam * G + 1) ** 2 * (rate * D) ** 2
    bound = np.pi / (144 * (lam - 1) ** 2) * (1 + 1 / (4 * G * lam)) ** 2 * (rate * D) ** 2
    volumetric = RHO_S * phi * (4 * G * lam + 1) * bound
    assert result.rate == pytest.approx(rate)
    assert result.reference == pytest.approx(2000)
    assert result.shear == pytest.approx(shear / 2000, rel=1e-12)
    assert result.volumetric == pytest.approx(volumetric / 2000, rel=1e-12)
    assert 0 < result.coupled_shear < np.inf


def test_estimates_scale_with_the_rate_and_with_the_reference():
    points = flow()
    one, two = (stress_free_error(points, restitution=0.6, rate=r) for r in (1.0, 2.0))
    assert two.shear == pytest.approx(4 * one.shear)
    assert two.volumetric == pytest.approx(4 * one.volumetric)
    half = stress_free_error(points, restitution=0.6, rate=1.0, reference=4000.0)
    assert half.shear == pytest.approx(one.shear / 2)
    assert stress_free_error(points, restitution=0.6, rate=0.0).shear == 0
    # which is the mean pressure by mass
    heavy = np.arange(points.n) % 2 == 0
    stress = np.where(heavy, 3.0, 1.0)[:, None] * points.stress
    given = {"mass": np.full(points.n, 0.5), "rho": np.where(heavy, 2000.0, 1000.0)}
    mixed = state(points.scene, points.x, stress=stress, shear_rate=4.0, v=points.v, **given)
    assert stress_free_error(mixed, restitution=0.7).reference == pytest.approx(4000)


def test_the_balance_of_a_density_that_varies():
    # shear conserves it
    points = flow(v=lambda x: np.stack([3 * x[:, 1], 0 * x[:, 0]], axis=1))
    balance = mass_balance_error(points, density=1000 + 500 * points.x[:, 1])
    assert balance.relative < 1e-12
    assert len(balance.cells) == 16
    uniform = mass_balance_error(points, restitution=0.7)
    assert uniform.relative < 1e-12
    # expansion does not conserve a uniform one
    points = flow(v=lambda x: np.stack([3 * x[:, 0], 0 * x[:, 0]], axis=1))
    balance = mass_balance_error(points, density=np.full(points.n, 1400.0))
    assert np.allclose(balance.residual, 1400 * 3)
    assert balance.relative == pytest.approx(1)
    incompressible = flow(v=lambda x: np.stack([3 * x[:, 0], -3 * x[:, 1]], axis=1))
    assert mass_balance_error(incompressible, density="density").relative < 1e-12
    # flow up a gradient
    points = flow(v=lambda x: np.stack([2 + x[:, 1], 0 * x[:, 0]], axis=1))
    balance = mass_balance_error(points, density=1000 + 100 * points.x[:, 0])
    y = (balance.cells[:, 1] + 0.5) * CELL
    assert np.allclose(balance.residual, 100 * (2 + y))


def test_the_balance_closes_over_a_periodic_axis_and_in_three_dimensions():
    wave = flow(periodic=(True, False), v=lambda x: np.stack([3 * x[:, 1], 0 * x[:, 0]], axis=1))
    assert len(mass_balance_error(wave, density="density").cells) == 24
    assert mass_balance_error(wave, density="density").relative < 1e-12
    squeezed = filled(scene((4, 4, 4), CELL), v=lambda x: x * [2.0, -1.0, -0.5])
    block = mass_balance_error(squeezed, density="density")
    assert np.allclose(block.residual, 0.5 * RHO_C)


def test_bad_estimates_are_refused():
    s = scene((3, 3), CELL)
    bare = state(s, regular_points(s), stress=isotropic(np.full(36, 10.0)))
    refused(
        ("d = None", lambda: packing_fraction(bare, restitution=0.7)),
        ("d = None", lambda: stress_free_error(bare, restitution=0.7)),
        ("restitution", lambda: packing_fraction(flow(), restitution=1.5)),
        ("restitution = None", lambda: mass_balance_error(bare)),
        ("surrounded", lambda: mass_balance_error(state(s, [[0.01, 0.01]]), density=[1.0])),
        ("reference = None", lambda: stress_free_error(flow(p=0.0), restitution=0.7)),
        ("margin", lambda: stress_free_error(flow(), restitution=0.7, margin=0.7)),
    )
    with pytest.raises(ValueError, match="0 points"):
        stress_free_error(state(flow().scene, np.empty((0, 2))), restitution=0.7)
