"""Layers below the angle of repose come to rest, although slow flow of the law is ill posed."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

import granular as gr
from granular.mpm.damping import kept_by_transfer
from granular.theory import short_wave_growth, viscous_growth

CELL = 0.01


@pytest.fixture
def slides(module):
    """Way down the slope of a layer, as the tables of docs/reports/stability.md have it."""
    return module("stability_tables").slides


@pytest.mark.parametrize(
    ("angle_deg", "E", "columns", "seed", "until"),
    [(20.0, 1e7, 32, 0, 0.4), (20.0, 1e7, 16, 0, 0.4), (20.0, 1e6, 16, 1, 0.8)],
)
def test_a_layer_below_its_angle_of_repose_rests(slides, angle_deg, E, columns, seed, until):
    """atan(mu_s) = 20.9 deg. Without damped waves these layers flow at 8 to 15 mm/s."""
    assert abs(slides(angle_deg, E, columns, seed, until)) < 0.01 * CELL


@pytest.mark.parametrize("ends", [(0.0, 0.15, 0.3), (0.0, 0.14, 0.16, 0.3)])
@pytest.mark.parametrize("weight_correction", [0.7, 1.0])
def test_a_bed_rests_on_walls_that_meet_in_its_floor(ends, weight_correction):
    """Splines are only C0 on the grid line above the joint. Their slopes there are twice as large,
    and a correction of the weights that does not count with it drives jets of 0.07 m/s."""
    floor = tuple(
        gr.Wall(1, 0.0, kind="no_slip", span=(span,)) for span in itertools.pairwise(ends)
    )
    scene = gr.Scene(
        name="bed",
        grid=gr.Grid((0.0, 0.0), CELL, (30, 24)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.3, 0.2)), 4, lithostatic=True),),
        material=gr.MuI(E=1e6),
        walls=(*floor, gr.Wall(0, 0.0), gr.Wall(0, 0.3)),
        gravity=gr.Gravity((0.0,), ((0.0, -9.8),)),
        duration=0.15,
        scheme=gr.Scheme(density=gr.SmoothedDensity(weight_correction=weight_correction)),
    )
    sim = gr.Simulation(scene, threads=1).run()
    assert np.linalg.norm(sim.state.v, axis=1).max() < 2e-4


@pytest.mark.parametrize("law", [gr.MuI, gr.Elastic])
@pytest.mark.parametrize("elasticity", ["hypoelastic", "hencky"])
def test_a_lithostatic_bed_bears_its_weight_where_it_is_compressed_much(law, elasticity):
    """rho g h/K = 0.18, so that K c and K c exp(c) differ by 15 %; the bed stays as it is."""
    g, height = 9.8, 1.0
    scene = gr.Scene(
        name="bed",
        grid=gr.Grid((0.0, 0.0), 0.05, (4, 24), periodic=(True, False)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.2, height)), 16, lithostatic=True),),
        material=law(E=1e5, elasticity=elasticity, restitution=0.1, contact_diameter=0.05),
        walls=(gr.Wall(1, 0.0),),
        gravity=gr.Gravity((0.0,), ((0.0, -g),)),
        duration=0.2,
    )
    sim = gr.Simulation(scene, threads=1)
    for cells, tolerance in ((slice(20), 2e-4), (slice(4, 18), 5e-4)):
        state = sim.state
        row = np.round((height - state.x[:, 1]) / 0.0125 - 0.5).astype(int)
        mass = np.bincount(row, weights=state.mass)
        above = (np.cumsum(mass) - 0.5 * mass) * g / 0.2
        pressed = np.bincount(row, weights=-state.mass * state.stress[:, 1]) / mass
        # Mean over cells, as the nodes balance no shorter waves; in the end without those near the
        # surface and the floor, where the stress is not that of the points alone.
        pressed, above = pressed.reshape(20, 4).mean(axis=1), above.reshape(20, 4).mean(axis=1)
        assert pressed[cells] == pytest.approx(above[cells], rel=tolerance)
        sim.run(monitor=False)


@pytest.mark.slow
@pytest.mark.parametrize("angle_deg", [19.0, 20.0])
@pytest.mark.parametrize("columns", [16, 32])
def test_most_layers_rest_whatever_the_seed(slides, angle_deg, columns):
    """Of ten seeds; a wave as long as the layer is resolved, and may keep it in motion."""
    soft = [abs(slides(angle_deg, 1e6, columns, seed, 2.0)) for seed in range(10)]
    stiff = [abs(slides(angle_deg, 1e7, columns, seed, 0.6)) for seed in range(10)]
    assert max(soft) < 0.01 * CELL
    assert sum(way < 0.01 * CELL for way in stiff) >= (10 if angle_deg < 20 else 7)


def test_growth_of_short_waves_is_that_of_the_acoustic_tensor():
    """The smallest eigenvalue of Q over all directions, from the tensor itself."""
    nu, mu = 0.3, 0.3819
    K, G = 1 / (3 * (1 - 2 * nu)), 1 / (2 * (1 + nu))
    N = np.array([[0.0, 1.0], [1.0, 0.0]])
    smallest = 0.0
    for angle in np.linspace(0, math.pi, 20001):
        n = np.array([math.cos(angle), math.sin(angle)])
        a = N @ n
        Q = (K + G / 3) * np.outer(n, n) + G * np.eye(2) - G * np.outer(a, a + mu * K / G * n)
        smallest = min(smallest, np.linalg.eigvals(Q).real.min())
    growth = math.sqrt(-smallest / (K + 4 * G / 3))
    assert short_wave_growth(mu, nu) == pytest.approx(growth, rel=1e-6)


def test_growth_of_viscous_waves_is_that_of_barker():
    mu, b = 0.3819, np.linspace(-1, 1, 20001)
    assert viscous_growth(mu) == pytest.approx(((1 - b**2) / (1 - mu * b)).max() - 1, rel=1e-6)
    assert viscous_growth(1e-9) == pytest.approx(0.25e-18)


def test_a_transfer_keeps_waves_as_derived():
    """The transfer of many points to the nodes and back, with the gradient of what comes back."""
    per_cell, cells = 200, 60
    x = (np.arange(cells * per_cell) + 0.5) / per_cell
    nodes = np.arange(cells) + 0.5
    away = (x[:, None] - nodes + cells / 2) % cells - cells / 2
    near = np.abs(away)
    S = np.where(near < 0.5, 0.75 - near**2, np.where(near < 1.5, 0.5 * (1.5 - near) ** 2, 0))
    slope = np.where(near < 0.5, -2 * away, np.where(near < 1.5, -np.sign(away) * (1.5 - near), 0))
    for length in (4, 6, 12):
        k = 2 * math.pi / length
        wave, C = np.exp(1j * k * x), np.zeros(len(x), dtype=complex)
        for _ in range(40):  # until the gradient is that of the nodes
            u = (S * (wave[:, None] - C[:, None] * away)).sum(axis=0) / S.sum(axis=0)
            C = slope @ u
            C = (C * np.exp(-1j * k * x)).mean() * wave
        kept = abs(((S @ u) * np.exp(-1j * k * x)).mean())
        assert kept_by_transfer(length) == pytest.approx(kept, rel=1e-3)
