"""Layers on inclines and beds at rest by SPH, against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from granular import scenes, sph

G = 9.81


def shear_rate(state, low=0.03, high=0.12):
    """Slope of the velocity profile away from wall and surface [1/s]."""
    y = state.x[:, -1]
    inside = (y > low) & (y < high)
    return np.polyfit(y[inside], state.v[inside, 0], 1)[0]


def mean_rate(simulation, seconds=1.0, samples=20):
    rates = []
    simulation.run(
        simulation.time + seconds,
        every=seconds / samples,
        hooks=(lambda s: rates.append(shear_rate(s.state)),),
        monitor=False,
    )
    return np.mean(rates)


def uniform_rate(material, angle):
    t = math.tan(math.radians(angle))
    return material.D_star * (t - material.mu_l) / (material.mu_h - t)


def misfit(state, power):
    """Residual of v_x = a + b profile(y) over the spread of v_x; power 1.5 is Bagnold's profile."""
    y, v = state.x[:, -1], state.v[:, 0]
    height = y.max() + 0.005
    basis = np.stack([height**power - (height - y) ** power, np.ones_like(y)], axis=1)
    return (v - basis @ np.linalg.lstsq(basis, v, rcond=None)[0]).std() / v.std()


@pytest.mark.parametrize(
    ("angle", "seconds", "rate"),
    [pytest.param(18, 8.0, 4.5, marks=pytest.mark.slow), (21, 9.0, 12.0)],
)
def test_steady_shear_is_uniform(angle, seconds, rate):
    """Friction depends on |D| alone, so that the law gives one shear rate at all depths."""
    simulation = sph.Simulation(scenes.incline_sph(angle_deg=angle, columns=6))
    material = simulation.scene.material
    assert uniform_rate(material, angle) == pytest.approx(rate, rel=0.01)
    simulation.run(seconds, monitor=False)
    assert mean_rate(simulation) == pytest.approx(rate, rel=0.1)
    assert simulation.counts["dropped"] == 0
    assert misfit(simulation.state, 1.0) < misfit(simulation.state, 1.5)


@pytest.mark.slow
def test_layers_come_nearer_to_the_law_with_finer_points():
    """At 24 deg, a fifth of 26.9 1/s is lost by layers that slip: in proportion to the spacing."""
    lost, slip = [], []
    for spacing in (0.01, 0.005):
        scene = scenes.incline_sph(angle_deg=24, spacing=spacing, columns=6)
        simulation = sph.Simulation(scene)
        simulation.run(10.0, monitor=False)  # until then it still accelerates
        lost.append(uniform_rate(scene.material, 24) - mean_rate(simulation))
        state = simulation.state
        slip.append(state.v[state.x[:, 1] < spacing, 0].mean())
    assert 3.0 < lost[0] < 7.0
    assert np.log2(lost[0] / lost[1]) == pytest.approx(1.0, abs=0.3)
    assert np.log2(slip[0] / slip[1]) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(("angle", "seconds", "rate"), [(12, 4.0, 1e-6), (15, 8.0, 0.1)])
def test_below_the_friction_nothing_moves(angle, seconds, rate):
    """At 15 deg the slope is mu_l to 1e-4; half a per cent less friction makes 0.1 1/s."""
    simulation = sph.Simulation(scenes.incline_sph(angle_deg=angle, columns=6))
    simulation.run(seconds, monitor=False)
    assert abs(mean_rate(simulation, 0.5)) < rate


def test_without_a_spring_slopes_creep():
    """The viscosity is the largest, k rho h^2/dt: the creep rate halves with the step."""
    rates = []
    for cfl in (1.0, 0.5):
        numerics = sph.Numerics(cfl=cfl)
        scene = scenes.incline_sph(
            angle_deg=12.0, columns=6, numerics=numerics, material=sph.Viscoplastic(nu=0.5)
        )
        simulation = sph.Simulation(scene)
        simulation.run(1.5, monitor=False)
        rates.append(mean_rate(simulation, 0.5))
        a = math.radians(12.0)
        # tau/eta at half the depth, by the weight of the layer
        creep = G * math.sin(a) * 0.075 * simulation.dt / (numerics.regularisation * scene.h**2)
        assert rates[-1] == pytest.approx(creep, rel=0.1)
    assert rates[1] == pytest.approx(0.5 * rates[0], rel=0.05)
    assert rates[0] < 1.0


def test_too_steep_a_layer_accelerates():
    """Above atan(mu_h) the acceleration falls from above towards g (sin - mu_h cos)."""
    a = math.radians(33)
    limit = G * (math.sin(a) - 0.577 * math.cos(a))
    assert limit == pytest.approx(0.60, abs=0.005)
    simulation = sph.Simulation(scenes.incline_sph(angle_deg=33, columns=6, headroom=20))
    speeds = []
    simulation.run(
        8.5, every=1.0, hooks=(lambda s: speeds.append(s.state.v[:, 0].mean()),), monitor=False
    )
    accelerations = np.diff(speeds[1:])[[0, 1, 3, 6]]
    assert (np.diff(accelerations) < 0).all()
    assert limit < accelerations[-1] < 1.8 * limit


@pytest.mark.parametrize(
    ("angle", "mu", "mu_wall", "smoothing"), [(25.0, 0.74, 0.335, 1.2), (18.0, 0.8, 0.2, 1.5)]
)
def test_a_layer_slides_down_a_wall_with_the_friction_of_the_wall(angle, mu, mu_wall, smoothing):
    """As a block, with g (sin - mu_wall cos)."""
    scene = scenes.incline_sph(
        angle_deg=angle, height=0.1, columns=8, settle=0.3, duration=0.6, mu_wall=mu_wall,
        mu_l=mu, mu_h=mu, numerics=sph.Numerics(smoothing=smoothing),
    )  # fmt: skip
    simulation = sph.Simulation(scene, threads=1)
    mean, times = [], []
    for until in (0.5, 0.9):
        state = simulation.run(until, monitor=False).state
        times.append(simulation.time)
        mean.append(state.v[:, 0].mean())
    a = math.radians(angle)
    gained = (mean[1] - mean[0]) / (times[1] - times[0])
    friction = (G * math.sin(a) - gained) / (G * math.cos(a))
    assert friction == pytest.approx(mu_wall, rel=0.01)
    lowest = state.v[state.x[:, 1] < 0.01, 0].mean()
    assert lowest == pytest.approx(mean[-1], rel=0.1)


@pytest.mark.parametrize("smoothing", [1.2, 1.5])
def test_a_layer_goes_on_over_a_wall_without_friction(smoothing):
    """It keeps its velocity: the particles of the wall take 0.2 % of it in 0.5 s."""
    material = sph.Viscoplastic(mu_l=0.577, mu_h=0.577, mu_wall=0.0)
    scene = scenes.incline_sph(
        angle_deg=0.0, height=0.1, columns=8, material=material,
        numerics=sph.Numerics(smoothing=smoothing),
    )  # fmt: skip
    moving = tuple(replace(fill, velocity=(1.0, 0.0)) for fill in scene.fills)
    state = sph.Simulation(scene.replace(fills=moving), threads=1).run(0.5, monitor=False).state
    assert state.v[:, 0].mean() == pytest.approx(1.0, abs=2e-3)
    assert np.sum(state.v**2, axis=1).mean() == pytest.approx(1.0, abs=5e-3)
    assert state.v[:, 0] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("nu", [0.5, 0.45])
def test_pressure_of_a_bed_is_its_overburden(nu):
    """Without a spring there is no shear stress at rest, and p equals the overburden.

    With a spring the vertical stress does; p is less, as the horizontal stress is less than the
    vertical one.
    """
    scene = scenes.incline_sph(
        angle_deg=0.0, height=0.2, columns=6, material=sph.Viscoplastic(nu=nu)
    )
    simulation = sph.Simulation(scene)
    simulation.run(1.5, monitor=False)
    state = simulation.state
    y = state.x[:, 1]
    rows = [np.abs(y - (k + 0.5) * 0.01) < 0.005 for k in range(20)]
    ratio, sideways = [], []
    for row in rows[:16]:
        above = state.mass[y > y[row].mean() + 0.004].sum() + 0.5 * state.mass[row].sum()
        xx, yy = -state.stress[row, :2].mean(axis=0) / (G * above / 0.06)
        ratio.append(yy)
        sideways.append(xx / yy)
    bulk, wall = np.array(ratio[4:]), np.array(ratio[:3])
    if nu < 0.5:  # a spring keeps differences between rows, of 10 % near the surface
        bulk = 0.5 * (bulk[1:] + bulk[:-1])
    assert np.abs(bulk - 1).max() < 0.05
    # the rho0 of the wall is reduced: the first row bears less and the second more
    assert wall[0] == pytest.approx(0.75, abs=0.05) and wall[1] == pytest.approx(1.15, abs=0.05)
    elastic = nu / (1 - nu)  # for a layer without lateral strain
    assert elastic - 0.01 < np.mean(sideways[3:]) < elastic + (0.1 if nu < 0.5 else 0.01)
    assert np.abs(state.v).max() < 0.03


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "seconds", "rate"), [(18, 8.0, 4.5), (21, 9.0, 12.0)])
def test_steady_shear_in_3d(angle, seconds, rate):
    scene = scenes.incline_sph(angle_deg=angle, columns=6, columns_across=5)
    simulation = sph.Simulation(scene, threads=2)
    simulation.run(seconds, monitor=False)
    assert mean_rate(simulation) == pytest.approx(rate, rel=0.1)
