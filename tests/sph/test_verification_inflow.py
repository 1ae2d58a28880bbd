"""Inflows of SPH: filling fraction, mass, momentum, a free jet, a chute, the fed gas jet."""

import numpy as np
import pytest

import granular as gr
from granular import Gravity, sph

DX, G = 0.01, 9.81


def jet(*, dim=2, gravity=0.0, speed=1.0, duration=0.4, deep=60, **more):
    """A jet of eight columns that falls from a nozzle of ten layers."""
    across = ((0.04, 0.12),) * (dim - 2)
    low = (0.06, *(a for a, _ in across), (deep - 10) * DX)
    high = (0.14, *(b for _, b in across), deep * DX)
    down = (0.0,) * (dim - 1)
    return sph.Scene(
        **{
            "name": "jet",
            "grid": gr.Grid((0.0,) * dim, DX, (20, *(16,) * (dim - 2), deep)),
            "fills": (),
            "inflows": (gr.Inflow(gr.Box(low, high), (*down, -speed), 1, driven=True),),
            "gravity": Gravity((0.0,), ((*down, -gravity),)),
            "duration": duration,
        }
        | more
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_the_stream_is_as_full_as_it_should_be(dim):
    """Without forces every window of 4 spacings holds rho0 V, and the kernel finds rho0."""
    sim = sph.Simulation(jet(dim=dim, duration=0.3), threads=1).run(monitor=False)
    state = sim.state
    x, rho0 = state.x, sim.scene.material.rho0
    middle = np.all(np.abs(x[:, :-1] - [0.1, 0.08][: dim - 1]) < 0.02, axis=1)
    weight = sph.scene.seeding_weight(dim, 1.2)
    for top in np.arange(0.35, 0.59, 0.03):
        within = middle & (x[:, -1] > top - 4 * DX) & (x[:, -1] <= top)
        mass = state.mass[within].sum() * weight
        assert mass == pytest.approx(rho0 * (4 * DX) ** dim, rel=0.02)
    inner = middle & (x[:, -1] > 0.35) & (x[:, -1] < 0.57)
    np.testing.assert_allclose(rho0 * np.exp(state.log_density[inner]), rho0, rtol=0.02)


def test_mass_is_exact_to_a_particle_and_ids_are_new():
    sim = sph.Simulation(jet(), threads=1)
    first, mass = sim.n_points, sim.scene.point_mass
    rate = 8 / DX  # particles per second at 1 m/s
    for until in (0.05, 0.1, 0.2, 0.4):
        sim.run(until=until, monitor=False)
        (entered,) = sim.inflows
        assert 0 <= rate * sim.time - entered.points < 1 + 1e-9
        assert sim.n_points == first + entered.points - sim.counts["dropped"]
        assert entered.mass == pytest.approx(entered.points * mass, rel=1e-12)
        assert len(np.unique(sim.state.id)) == sim.n_points
    assert sim.counts["dropped"] == 0 and sim.state.id.max() == first + entered.points - 1


def test_a_free_jet_falls_as_a_stone():
    """v^2 = v0^2 + 2 g s below the nozzle, and no pressure acts back on it."""
    sim = sph.Simulation(jet(gravity=G), threads=1).run(monitor=False)
    y, v = sim.state.x[:, 1], -sim.state.v[:, 1]
    below = (y < 0.5 - 1e-9) & (y > 0.1)
    fallen = np.sqrt(1.0 + 2 * G * (0.5 - y[below]))
    np.testing.assert_allclose(v[below], fallen, rtol=0.01)
    np.testing.assert_array_equal(v[y > 0.5 + 1e-9], 1.0)


def test_momentum_is_that_of_what_entered_gravity_and_the_nozzle():
    """A jet that hits a bed in free fall: exact, while particles enter and are pushed."""
    bed = gr.Fill(gr.Box((0.0, 0.2), (0.2, 0.28)), 1)
    grid = gr.Grid((0.0, 0.0), DX, (20, 40), periodic=(True, False))
    scene = jet(gravity=G, deep=40, fills=(bed,), grid=grid, duration=0.12)
    sim = sph.Simulation(scene, threads=1)
    sim.step(0)
    state = sim.state
    there, before = state.mass.sum(), state.mass @ state.v
    entered, impulse = sim.inflows[0].momentum, sim.inflows[0].impulse
    weight = np.zeros(2)
    g = np.array(scene.gravity.vectors[-1])
    while sim.time < scene.duration:
        mass = there + sim.inflows[0].mass
        sim.step()
        now = there + sim.inflows[0].mass
        # half of a step with the forces at its begin, half with those at its end
        weight += 0.5 * sim.dt * (mass + now) * g
    (account,) = sim.inflows
    change = sim.state.mass @ sim.state.v - before - (account.momentum - entered)
    assert abs(change).max() > 1.0 and sim.counts["dropped"] == 0
    np.testing.assert_allclose(change, weight + account.impulse - impulse, rtol=0, atol=1e-9)


def test_a_layer_that_is_fed_flows_steadily():
    """A piston pushes a layer over a smooth floor: it keeps its height, and rho0 at the plane."""
    high = 8
    floor = sph.ParticleWall(1, 0.0, 1)
    region = gr.Box((0.0, 0.0), (0.1, high * DX))
    scene = sph.Scene(
        name="pushed",
        grid=gr.Grid((0.0, 0.0), DX, (50, 14)),
        fills=(),
        inflows=(gr.Inflow(region, (0.5, 0.0), 1, driven=True),),
        material=sph.Viscoplastic(mu_l=0.05, mu_h=0.05, mu_wall=0.0),
        walls=(floor,),
        gravity=Gravity((0.0,), ((0.0, -G),)),
        duration=1.0,
    )
    sim = sph.Simulation(scene, threads=1).run(monitor=False)
    x = sim.state.x
    counts = [np.sum((x[:, 0] > a) & (x[:, 0] <= a + 5 * DX)) for a in (0.05, 0.1, 0.15)]
    assert counts[0] == pytest.approx(5 * high, abs=1)
    assert counts[1] == pytest.approx(5 * high, rel=0.1)
    near = (x[:, 0] > 0.08) & (x[:, 0] < 0.12) & (x[:, 1] > 0.02) & (x[:, 1] < 0.06)
    density = np.exp(sim.state.log_density[near])
    np.testing.assert_allclose(density, 1.0, atol=0.03)


def test_the_gas_of_a_fed_nozzle_keeps_its_density():
    """Gas that enters has the density and velocity of the nozzle; what enters leaves in the end."""
    scene = gr.scenes.jet_on_bed(
        speed=50.0, width=0.3, depth=0.1, headroom=0.16, nozzle=0.16, spacing=0.02, duration=0.02
    )
    sim = sph.Simulation(scene, threads=1).run(monitor=False)
    gas, (jet_,) = sim.gas, scene.gas.jets
    low, high = (np.array(end) for end in jet_.region.bounds)
    within = ((gas.x > low) & (gas.x < high)).all(axis=1)
    full = jet_.density * np.prod(high - low)
    assert gas.mass[within].sum() == pytest.approx(full, rel=0.07)  # 5 1/3 rows of 8 particles
    np.testing.assert_allclose(gas.v[within], [[0.0, -50.0]] * within.sum())
    inner = (np.abs(gas.x[:, 0] - 0.15) < 0.04) & (np.abs(gas.x[:, 1] - low[1] - 0.05) < 0.03)
    np.testing.assert_allclose(gas.density[inner], jet_.density, rtol=0.05)
    counts = sim.counts
    assert 0 <= 50.0 / 0.02 * 8 * sim.time - counts["gas_entered"] < 1 + 1e-6
    assert counts["gas_dropped"] > 0.8 * counts["gas_entered"]
