"""Layers below the angle of repose come to rest, although slow flow of the law is ill posed."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.theory import short_wave_growth, viscous_growth

CELL = 0.01


def mean_speed(scene, until):
    state = gr.Simulation(scene, threads=1).run(until=until, monitor=False).state
    return float(np.average(state.v[:, 0], weights=state.mass))


@pytest.mark.parametrize(
    ("cell", "columns", "E", "seed", "until"),
    [
        (0.01, 16, 1e6, 1, 0.8),
        (0.01, 32, 1e7, 0, 0.4),
        (0.005, 16, 1e6, 23, 1.5),
        pytest.param(0.005, 16, 1e7, 21, 0.5, marks=pytest.mark.slow),
    ],
)
def test_a_layer_below_its_angle_of_repose_rests(cell, columns, E, seed, until):
    """atan(mu_s) = 20.9 deg. Without damping of flutter these layers flow at 8 to 15 mm/s, and in
    40 cells, with a damping that goes by the cell, at 10 to 35 mm/s."""
    grains = gr.materials.glass_beads.replace(E=E)
    options = {"angle_deg": 20.0, "cell": cell, "columns": columns, "jitter": 0.6, "seed": seed}
    assert abs(mean_speed(gr.scenes.incline(material=grains, **options), until)) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("seed", [22, 25])
def test_a_layer_of_80_cells_rests(seed):
    """Waves of five cells hardly move: with a memory of 5 depths of waves it flows at 30 mm/s."""
    grains = gr.materials.glass_beads.replace(E=1e6)
    options = {"angle_deg": 20.0, "cell": 0.0025, "columns": 32, "jitter": 0.6, "seed": seed}
    assert abs(mean_speed(gr.scenes.incline(material=grains, **options), 2.0)) < 1e-3


def test_noise_does_not_make_a_soft_layer_creep():
    """0.3 deg below yield, c_w/dx = 900/s. Where the velocities of the points of a cell scatter,
    flow feeds itself: without a least decay it goes at 4 mm/s after 20 s, and becomes faster."""
    soil = gr.materials.grc_1.replace(E=0.15e6, A=0.0, mu_s=0.3819)
    options = {"height": 0.1, "columns": 16, "cell": 0.0125, "jitter": 0.3, "duration": 20.0}
    scheme = gr.schemes.default.replace(tpic_least_decay=6.0)
    scene = gr.scenes.incline(angle_deg=20.6, material=soil, scheme=scheme, **options)
    assert 0 < mean_speed(scene, 20.0) < 1e-3


@pytest.mark.parametrize(("angle_deg", "error"), [(25.0, 0.0025), (21.5, 0.03)])
def test_the_damping_of_flutter_leaves_flow_alone(angle_deg, error):
    """Stiff grains, for which a damping by the speed of waves would do most, at 0.5 s."""
    grains = gr.materials.glass_beads.replace(E=1e8)
    scene = gr.scenes.incline(angle_deg=angle_deg, columns=1, cell=0.005, material=grains)
    expected = gr.theory.transient(angle_deg, 0.2, grains, [0.5], cells=200, rtol=1e-6).mean[-1]
    assert mean_speed(scene, 0.5) == pytest.approx(expected, rel=error)


@pytest.mark.parametrize("ends", [(0.0, 0.15, 0.3), (0.0, 0.14, 0.16, 0.3)])
@pytest.mark.parametrize("weight_correction", [0.7, 1.0])
def test_a_bed_rests_on_walls_that_meet_in_its_floor(ends, weight_correction):
    """Splines are only C0 on the grid line above the joint. Their slopes there are twice as large,
    and a correction of the weights that does not count with it drives jets of 0.07 m/s."""
    floor = tuple(
        gr.Wall(1, 0.0, kind="no_slip", span=(span,)) for span in itertools.pairwise(ends)
    )
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), CELL, (30, 24)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.3, 0.2)), 4, lithostatic=True),),
        walls=(*floor, gr.Wall(0, 0.0), gr.Wall(0, 0.3)),
        duration=0.15,
        scheme=gr.Scheme(density=gr.SmoothedDensity(weight_correction=weight_correction)),
    )
    sim = gr.Simulation(scene, threads=1).run(monitor=False)
    assert np.linalg.norm(sim.state.v, axis=1).max() < 2e-4


@pytest.mark.parametrize("law", [gr.MuI, gr.Elastic])
@pytest.mark.parametrize("elasticity", ["hypoelastic", "hencky"])
def test_a_lithostatic_bed_bears_its_weight_where_it_is_compressed_much(law, elasticity):
    """rho g h/K = 0.18, so that K c and K c exp(c) differ by 15 %; the bed stays as it is."""
    g, height = 9.8, 1.0
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), 0.05, (4, 24), periodic=(True, False)),
        fills=(gr.Fill(gr.Box((0.0, 0.0), (0.2, height)), 16, lithostatic=True),),
        material=law(E=1e5, elasticity=elasticity, restitution=0.1, contact_diameter=0.05),
        walls=(gr.Wall(1, 0.0),),
        gravity=g,
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


SANDY = gr.MuI(E=3e6, mu_s=0.6, mu_2=0.8)


@pytest.mark.parametrize(
    ("material", "K0", "expected"),
    [
        (SANDY, None, 3 / 7),  # nu/(1 - nu)
        (gr.MuI(E=3e6), None, 0.541),  # tau = mu_s p, as after a slow ramp of gravity
        (gr.Elastic(E=3e6), None, 3 / 7),
        (SANDY.replace(elasticity="hencky"), 0.6, 0.6),
        (SANDY, 2.0, 2.0),
    ],
)
def test_walls_bear_the_pressure_at_rest(material, K0, expected):
    """A wall beside a bed of two layers bears K0 times its weight, from the start on."""
    g, height, side = 9.8, 0.3, {"lithostatic": True, "K0": K0}
    split = gr.Polygon(((0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)))
    above = gr.Box((0.0, 0.1), (0.2, height))
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), 0.02, (10, 17)),
        fills=(gr.Fill(split, 16, **side), gr.Fill(above, 16, **side)),
        material=material,
        walls=(gr.Wall(1, 0.0), *(gr.Wall(0, x, kind="free_slip") for x in (0.0, 0.2))),
        gravity=g,
        duration=0.1,
    )
    sim = gr.Simulation(scene, threads=1, wall_forces=True).run(monitor=False)
    floor, _, wall = (wall.impulse / sim.time for wall in sim.walls)
    weight = material.rho_c * g * height
    assert wall[0] == pytest.approx(expected * weight * height / 2, rel=0.01)
    assert floor[1] == pytest.approx(-weight * 0.2, rel=0.01)
    assert np.abs(sim.state.v).max() < 1e-3


def sloping(dim, fills):
    return scene_with(
        grid=gr.Grid((0.0,) * dim, 0.05, (20, 12) if dim == 2 else (14, 14, 12)),
        fills=fills,
        material=SANDY.replace(E=1e6),
        walls=(gr.Wall(dim - 1, 0.0),),
        duration=0.1,
        scheme=gr.Scheme(density=gr.ParticleDensity()),
    )


def descent(x, y):
    """Height of a surface that falls by 0.15 along x and 0.1 along y."""
    return 0.4 - 0.15 * x - 0.1 * y


SLOPES = {
    "polygon": (2, (gr.Polygon(((0.0, 0.0), (1.0, 0.0), (1.0, 0.25), (0.0, 0.4))),)),
    "layer": (3, (gr.Layer(0.0, descent, (0.0, 0.0), (0.7, 0.7), spacing=0.025),)),
    # The surface between two layers falls with the top.
    "two layers": (
        2,
        (
            gr.Polygon(((0.0, 0.0), (1.0, 0.0), (1.0, 0.1), (0.0, 0.25))),
            gr.Polygon(((0.0, 0.25), (1.0, 0.1), (1.0, 0.25), (0.0, 0.4))),
        ),
    ),
}


@pytest.mark.parametrize(("name", "K0"), [*((name, None) for name in SLOPES), ("two layers", 1.0)])
def test_a_slope_begins_in_balance(name, K0):
    """Away from its ends, by 2 % of g; without the shear stress of the slope it were 15 K0 %."""
    dim, regions = SLOPES[name]
    fills = tuple(gr.Fill(r, 2**dim, lithostatic=True, K0=K0) for r in regions)
    sim = gr.Simulation(sloping(dim, fills), threads=1)
    sim.step(8)  # waves from the ends come 0.2 m far
    state = sim.state
    inner = (state.x[:, :-1] > 0.3).all(axis=1) & (
        state.x[:, :-1] < sim.scene.grid.upper[0] - 0.3
    ).all(axis=1)
    v = np.average(state.v[inner], axis=0, weights=state.mass[inner])
    assert np.linalg.norm(v) < 0.02 * 9.8 * sim.time


def test_the_edge_of_a_load_is_a_jump_and_no_slope():
    """Below a load on half of a bed nothing is sheared or pressed by more than the weight above."""
    box = {"bed": gr.Box((0.0, 0.0), (1.0, 0.2)), "load": gr.Box((0.5, 0.2), (1.0, 0.4))}
    fills = tuple(gr.Fill(region, 4, lithostatic=True) for region in box.values())
    state = gr.Simulation(sloping(2, fills), threads=1).state
    assert -state.stress[:, 1].min() < 0.4 * 9.8 * state.density.max()
    assert not state.stress[:, 3].any()


def test_a_ratio_beyond_yield_is_refused():
    box = gr.Box((0.0, 0.0), (1.0, 0.2))
    low, high = SANDY.yield_ratios
    assert (low, high) == pytest.approx((0.386, 4.383), abs=1e-3)
    for bad in (0.99 * low, 1.01 * high):
        with pytest.raises(ValueError, match=r"fills\[0\].K0 = .* must be from 0.386"):
            sloping(2, (gr.Fill(box, 4, lithostatic=True, K0=bad),))
    sloping(2, (gr.Fill(box, 4, lithostatic=True, K0=high),))
    with pytest.raises(ValueError, match=r"K0 = 0\.5 must be None"):
        gr.Fill(box, 4, K0=0.5)
    with pytest.raises(ValueError, match="K0 = -1"):
        gr.Fill(box, 4, lithostatic=True, K0=-1.0)


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
