"""Layers on a no-slip incline by the nonlocal law, against the one-dimensional equation.

Profiles, the height at which layers stop, steady states and their approach; also against the
discrete form of the equation on the same cells.
"""

from __future__ import annotations

import functools
import itertools
import math

import numpy as np
import pytest
from scipy.linalg import expm

from granular import Fluidity, scenes, schemes
from granular.theory import bagnold_profile, chute_profile, chute_transient
from granular.theory.stopping import fluidity_growth
from granular.verify.chute import (
    ANGLES,
    AT_REST,
    PROFILES,
    column,
    energy_at_end,
    exact_flow,
    growth_rate,
    kinetic_energy,
    profile_errors,
    still,
    stopping_ratio,
    velocity,
)

GRAINS = scenes.chute_ngf().material
CHUTE_SCHEME = scenes.chute_ngf().scheme


@functools.cache
def steady(until=0.6, ratio=None, **parameters):
    """State of a column at `until` [s], when it flows steadily; made once for all tests."""
    simulation = column(ratio, **parameters)
    simulation.run(until=until, monitor=False)
    return simulation.state


def top_speed(**parameters):
    return velocity(steady(**parameters))[1][-1]


def diffused(**changes):
    """The scheme of the chute with another `Fluidity`."""
    return CHUTE_SCHEME.replace(fluidity=Fluidity(**changes))


def laplacian(cells):
    """Laplacian of a uniform grid with g = 0 on the face below and dg/dz = 0 above, times dx^2."""
    matrix = np.diag(np.full(cells, -2.0)) + np.eye(cells, k=1) + np.eye(cells, k=-1)
    matrix[0, 0], matrix[-1, -1] = -3.0, -1.0
    return matrix


def seeding_speed(height, cells, spread=0.5, felt=None, m=GRAINS, angle_deg=27.0, gravity=9.81):
    """Surface speed of the steady flow over the cells of the engine, by Newton's method.

    The discrete equations alone, in balance: no points, no elasticity, no time step. Over a cell,
    p^-1/2 has its mean over the depths `spread` cells to either side of the middle. `felt` turns
    the matrix A^2 d^2 lap into the effective one when law and diffusion alternate.
    """
    angle, cell = math.radians(angle_deg), height / cells
    weight = m.rho_c * gravity * math.cos(angle)
    p, half = weight * (height - (np.arange(cells) + 0.5) * cell), spread * weight * cell
    root = 2 / (np.sqrt(p + half) + np.sqrt(np.maximum(p - half, 0)))
    growth = float(fluidity_growth(math.tan(angle), m.mu_s, m.mu_2))
    diffusion = (m.A * m.d / cell) ** 2 * laplacian(cells)
    linear = (felt(diffusion) if felt else diffusion) + growth * np.eye(cells)
    sink = m.b * m.d * math.sqrt(m.rho_s) * root * math.tan(angle)
    g = growth / sink
    for _ in range(50):
        g = g - np.linalg.solve(linear - np.diag(2 * sink * g), linear @ g - sink * g**2)
    return math.tan(angle) * cell * np.sum(g)


# Profiles


@pytest.mark.parametrize(
    "height",
    [pytest.param(h, marks=[pytest.mark.slow] * (h not in (0.01, 0.035))) for h in PROFILES],
)
def test_profiles_of_the_figure(height):
    speed, shape = profile_errors(steady(height=height, until=PROFILES[height]))
    assert abs(speed) < 5e-3
    assert shape < 5e-3


def test_profile_just_above_the_stopping_height():
    """The speed depends on the square of a small difference.

    H_stop is 0.03 % low with cells of H/20, which at H/H_stop = 1.03 alone makes the flow 1 %
    faster.
    """
    speed, shape = profile_errors(steady(until=2.0, ratio=1.03, cell=0.0005))
    assert abs(speed) < 0.02
    assert shape < 0.002


@pytest.mark.parametrize(("spread", "order"), [(0.5, 2.0), (0.0, 0.6)])
def test_convergence_in_the_cell(spread, order):
    """Error of the mean velocity.

    With one pressure for a cell p^-1/2 is too small at the surface; this part of the error falls
    only as the square root of the cell size.
    """
    error = []
    for cell in (0.002, 0.001, 0.0005):
        state = steady(cell=cell, scheme=diffused(pressure_averaging=spread))
        y, v = velocity(state)
        error.append(abs(np.trapezoid(v, y) / 0.01 / exact_flow(state).mean - 1))
    found = np.log2(np.divide(error[:-1], error[1:]))
    assert np.all(found > order - 0.1), (error, found)
    assert np.all(found < order + 0.5), (error, found)


@pytest.mark.parametrize("spread", [0.5, 0.0])
@pytest.mark.parametrize("cells", [5, 10, 20])
def test_the_discrete_equations_are_those_that_flow(cells, spread):
    """Agreement to a few 1e-4, the effect of E = 1 MPa; all other errors are those of the cells."""
    speed = top_speed(cell=0.01 / cells, scheme=diffused(pressure_averaging=spread))
    assert speed == pytest.approx(seeding_speed(0.01, cells, spread), rel=3e-4)


def test_without_the_mean_of_the_pressure_thin_layers_are_too_fast():
    exact = chute_profile(27.0, 0.01, GRAINS).v[-1]
    assert top_speed(scheme=diffused(pressure_averaging=0.0)) / exact == pytest.approx(
        1.097, abs=0.01
    )
    assert top_speed() / exact == pytest.approx(1.0, abs=0.002)


@pytest.mark.parametrize(("height", "bound"), [(0.01, 0.04), (0.025, 0.015)])
def test_profiles_with_the_default_scheme(height, bound):
    """Splines spread g over cells: the flow is too slow, by less in thicker layers."""
    speed, shape = profile_errors(steady(height=height, scheme=schemes.default))
    assert -bound < speed < 0
    assert shape < 0.01


def test_a_vanishing_nonlocality_is_the_local_law():
    """A d = dx/51."""
    height, cell = 0.025, 0.001
    grains = GRAINS.replace(A=cell / (51 * GRAINS.d))
    assert grains.law == "ngf"
    local = GRAINS.replace(A=0.0)
    assert local.law == "mu_I"
    nearly, without = (velocity(steady(height=height, material=m)) for m in (grains, local))
    exact = bagnold_profile(nearly[0], 27.0, height, local, 9.81)
    assert np.max(np.abs(nearly[1] - exact)) < 0.01 * exact[-1]
    assert np.max(np.abs(nearly[1] - without[1])) < 0.01 * exact[-1]


# The height at which layers stop


@pytest.mark.parametrize("angle_deg", ANGLES)
def test_stopping_height(angle_deg):
    assert stopping_ratio(angle_deg=angle_deg) == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize(
    "angle_deg", [pytest.param(a, marks=[pytest.mark.slow] * (a != 24.0)) for a in ANGLES]
)
def test_layers_stop_below_and_flow_above(angle_deg):
    """The measure of the paper also takes the creep just above H_stop for rest.

    The check `chute_quick` has 27 degrees.
    """
    assert energy_at_end(0.98, 3.0, angle_deg=angle_deg) < AT_REST
    assert energy_at_end(1.02, 3.0, angle_deg=angle_deg) > AT_REST


@pytest.mark.parametrize("cells", [5, 10])
def test_growth_is_that_of_the_slowest_mode_on_the_grid(cells):
    """1.05 H_stop, after a flow long enough to be independent of its initial stress."""
    rate = growth_rate(1.05, cell=0.01 / cells)
    growth = float(fluidity_growth(math.tan(math.radians(27.0)), GRAINS.mu_s, GRAINS.mu_2))
    mode = np.linalg.eigvalsh(laplacian(cells)).max() * (2 * cells / math.pi / 1.05) ** 2
    assert rate == pytest.approx(growth * (1 + mode) / GRAINS.t0, rel=0.01)
    assert rate != pytest.approx(growth * (1 - 1.05**-2) / GRAINS.t0, rel=0.01)


# What a steady flow must not depend on


@pytest.fixture(scope="module")
def reference():
    """Speed by the explicit method, at dt/t0 = 0.017."""
    return top_speed()


METHODS = list(itertools.product(("explicit", "implicit"), (0.017, 0.17, 0.83), (1, 5)))
QUICK_METHODS = (
    *(("explicit", 0.17, 1), ("explicit", 0.83, 1), ("explicit", 0.83, 5)),
    *(("implicit", 0.17, 5), ("implicit", 0.83, 1)),
)
"""Large and small steps, with substeps and without them, of both methods."""


@pytest.mark.parametrize(
    ("method", "step", "substeps"),
    [pytest.param(*m, marks=[pytest.mark.slow] * (m not in QUICK_METHODS)) for m in METHODS],
)
def test_steady_flow_of_any_method_and_step(reference, method, step, substeps):
    """dt/t0 is changed through t0, on which a steady flow does not depend either."""
    grains = GRAINS.replace(t0=GRAINS.t0 * 0.017 / step)
    scheme = diffused(method=method, substeps=substeps)
    if (method, step, substeps) == ("explicit", 0.83, 1):
        with pytest.raises(ValueError, match="explicit"):
            column(material=grains, scheme=scheme)
        return
    assert top_speed(material=grains, scheme=scheme) == pytest.approx(reference, rel=1e-4)


@pytest.mark.parametrize(("step", "substeps"), [(0.17, 1), (0.17, 4), (0.83, 4)])
def test_steady_flow_of_rkl2_is_that_of_taking_turns(reference, step, substeps):
    """g exp(-k L) after each substep of the law: the flow is too fast, of first order in it."""
    grains = GRAINS.replace(t0=GRAINS.t0 * 0.017 / step)
    scheme = diffused(method="rkl2", substeps=substeps)
    state = steady(material=grains, scheme=scheme)
    k = state.dt / grains.t0 / substeps
    expected = seeding_speed(0.01, 10, felt=lambda L: (expm(k * L) - np.eye(10)) / k)
    excess = expected / seeding_speed(0.01, 10) - 1
    assert excess > 0.002
    assert velocity(state)[1][-1] / reference - 1 == pytest.approx(excess, rel=0.05)


def test_steady_flow_of_any_start(reference):
    """Starts from the local phase and from uniform fluidities.

    The latter need points under pressure, and so gravity from the start.
    """
    for seed in (None, 1e-6, 100.0):
        found = top_speed(ramp=0.0, scheme=diffused(initial=seed))
        assert found == pytest.approx(reference, rel=1e-5)


# The approach to it


@pytest.mark.parametrize("factor", [0.05, 2.0])
def test_transient(factor):
    """t0 = 10 ms keeps the layer nearly in balance, so that the speed follows the fluidity.

    The fluidity starts below and above its final value.
    """
    grains = GRAINS.replace(t0=0.01)
    simulation = column(material=grains)
    simulation.run(until=1.5, monitor=False)
    begin, start = simulation.time, factor * float(np.max(simulation.state.g))
    still(simulation, start)
    times, speeds = [], []
    for after in (0.05, 0.1, 0.15, 0.2, 0.3, 0.5):
        simulation.run(until=begin + after, monitor=False)
        times.append(simulation.time - begin)
        speeds.append(velocity(simulation.state)[1][-1])
    exact = chute_transient(27.0, 0.01, grains, times, start).v[:, -1]
    assert exact[0] < 0.5 * exact[-1] or exact[0] > 1.05 * exact[-1]
    np.testing.assert_allclose(speeds, exact, rtol=0.02)


def test_kinetic_energy_is_that_of_a_kilogram():
    simulation = column()
    simulation.buffers["v"][:] = 3.0
    assert kinetic_energy(simulation.state) == pytest.approx(9.0)
