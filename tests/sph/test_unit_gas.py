"""The gas of SPH against a plain evaluation of its equations, and its conservation properties."""

import math

import numpy as np
import pytest
from oracle_fluidity import available
from oracle_sph_gas import drag_coefficient, evaluate
from same_bits import fields

from granular import Box, Fill, Gravity, Grid, scenes, sph

DX = 0.01


def small_scene(dim, *, walls=True, permeable=False, **gas):
    """Solid particles on a floor with gas between and above them, disordered."""
    shape = (7, 6, 9)[-dim:] if dim == 3 else (7, 9)
    ends = tuple(n * DX for n in shape)
    still = (0.0,) * dim
    floor = sph.ParticleWall(dim - 1, 0.0, 1, layers=3, permeable=permeable)
    soil = Fill(Box(still, (*ends[:-1], 5 * DX)), 1, jitter=0.4)
    return sph.Scene(
        name="small",
        grid=Grid(still, DX, shape, periodic=(*(True for _ in shape[1:]), not walls)),
        fills=(soil,),
        material=sph.Viscoplastic(rho0=1600.0, cohesion=30.0),
        numerics=sph.Numerics(smoothing=1.25),
        walls=(floor,) * walls,
        gas=sph.Gas(fills=(Fill(Box(still, ends), 1, jitter=0.4),), **gas),
        gravity=Gravity((0.0,), ((0.3,) + (0.0,) * (dim - 2) + (-9.81 * walls,),)),
        duration=1.0,
        seed=4,
    )


def stirred(scene, speed=3.0, **options):
    """Simulation with random velocities of solid and gas, and random densities of the gas."""
    simulation = sph.Simulation(scene, **options)
    rng, rows, buffers = np.random.default_rng(2), simulation._rows, simulation.buffers
    ids = buffers["id"]
    known = rng.normal(0, 1.0, (ids.max() + 1, scene.dim))
    for first, n, size in ((0, rows.grains, 0.2), (rows.gas_first, rows.gas, speed)):
        part = slice(first, first + n)
        buffers["v"][:, part] = size * known[ids[part]].T
        if first:
            buffers["rho"][0, part] *= 1 + 0.02 * known[ids[part], 0]
    return simulation


def by_id(simulation, name, first, n):
    ids = simulation.buffers["id"][first : first + n]
    values = simulation.buffers[name][:, first : first + n][:, ids.argsort()]
    return values[0] if len(values) == 1 else values.T


@pytest.mark.parametrize("permeable", [False, True])
def test_evaluation_agrees_with_the_plain_one(dim, permeable):
    scene = small_scene(dim, permeable=permeable, permeability=1e-8, blend=0.2)
    simulations = [stirred(scene, isa=isa) for isa in available()]
    simulation = simulations[0]
    rows = simulation._rows
    dry = sph.Simulation(scene.replace(gas=None))
    dry.buffers["v"][:, : rows.grains] = simulation.buffers["v"][:, : rows.grains]
    dt = simulation.dt
    dry._engine.restore(dry._engine.scalars() | {"dt": dt})
    parts = {}
    for kind, first, n, names in (
        ("grains", 0, rows.grains, ("x", "v")),
        ("walls", rows.wall_first, rows.walls, ("x", "porosity", "normal", "depth")),
        ("points", rows.gas_first, rows.gas, ("x", "v", "rho")),
    ):
        parts[kind] = {name: by_id(simulation, name, first, n) for name in names}
    dry.step(0)
    parts["grains"]["rho"] = dry.state.density
    gravity = np.array(scene.gravity.vectors[0])
    mass, e, _, a, _, a_grains = evaluate(scene, *parts.values(), dry.state.a, dt, gravity)
    assert e.min() < 0.4 and e.max() == 1.0
    for simulation in simulations:
        simulation.step(0)
        gas, after = simulation.gas, simulation.state
        assert np.allclose(gas.porosity, e, rtol=1e-12)
        assert np.allclose(gas.mass, mass, rtol=1e-12)
        assert np.allclose(gas.pressure, scene.gas.sound_speed**2 * gas.density, rtol=1e-14)
        assert np.allclose(gas.a, a, atol=1e-9 * np.abs(a).max())
        assert np.allclose(after.a, a_grains, atol=1e-9 * np.abs(a_grains).max())


def test_mass_is_exchanged_as_in_the_plain_evaluation():
    # damping would need the velocities of half a step
    scene = small_scene(2, walls=False, damping=0.0)
    simulation = stirred(scene)
    simulation.step(0)
    before = simulation.gas
    simulation.step(1)
    grains = simulation.state
    points = {"x": simulation.gas.x, "v": simulation.gas.v, "rho": simulation.gas.density}
    none = {name: np.zeros((0, 2)) for name in ("x", "normal")}
    none |= {name: np.zeros(0) for name in ("porosity", "depth")}
    still = {"x": grains.x, "v": grains.v, "rho": grains.density}
    gain = evaluate(
        scene, still, none, points, np.zeros_like(grains.a), simulation.dt, np.zeros(2)
    )[4]
    found = (simulation.gas.mass - before.mass) / simulation.dt
    # densities are those before the exchange, as far as it changes them
    assert np.allclose(found, gain, rtol=1e-3, atol=1e-3 * np.abs(gain).max())
    assert abs(found.sum()) < 1e-12 * np.abs(found).sum()


def test_drag_is_continuous_and_that_of_its_ends():
    gas = sph.Gas(fills=(Fill(Box((0.0, 0.0), (1.0, 1.0)), 1),))
    d = gas.grain_diameter(1600.0)
    assert d == pytest.approx(5.1e-4, rel=0.01)
    e = np.array([0.36, 0.38, 0.38 + 1e-9, 0.42 - 1e-9, 0.42, 0.9])
    B = drag_coefficient(gas, d, e, 1.1, 0.1)
    assert B[:2] == pytest.approx(e[:2] ** 2 * 1e-5 / 2e-10)
    assert B[1] == pytest.approx(B[2]) and B[3] == pytest.approx(B[4])
    stokes = 18 * 0.1 * 1e-5 / d**2 * 0.9**-2.65
    assert drag_coefficient(gas, d, 0.9, 1.1, 1e-9) == pytest.approx(stokes, rel=1e-4)


def test_momentum_and_mass_of_a_closed_system(dim):
    """Without walls the forces between all particles sum to zero, at any strength of the drag."""
    for permeability in (1e-9, 1e-13):
        scene = small_scene(dim, walls=False, permeability=permeability)
        scene = scene.replace(gravity=Gravity((0.0,), ((0.0,) * dim,)))
        simulation = stirred(scene, speed=10.0)
        simulation.step(0)

        def sums(simulation=simulation):
            gas, state = simulation.gas, simulation.state
            gas_p, p = gas.mass[:, None] * gas.v, state.mass[:, None] * state.v
            return gas.mass.sum(), gas_p.sum(0) + p.sum(0), np.abs(gas_p).sum() + np.abs(p).sum()

        before = sums()
        simulation.step(40)
        after = sums()
        assert after[0] == pytest.approx(before[0], rel=1e-13)
        assert np.abs(after[1] - before[1]).max() < 1e-12 * before[2]


def test_bits_do_not_depend_on_threads_or_a_restart(dim):
    jet = sph.Jet(
        Box((0.02,) * (dim - 1) + (0.07,), (0.05,) * (dim - 1) + (0.09,)),
        (0.0,) * (dim - 1) + (-40.0,),
    )
    scene = small_scene(dim, jets=(jet,))
    one, three = (stirred(scene, threads=threads) for threads in (1, 3))
    one.step(11)
    resumed = sph.Simulation.from_checkpoint(scene, one.checkpoint(), threads=1)
    one.step(19)
    resumed.step(19)
    three.step(30)
    assert one.counts["rebuilds"] > 2
    assert resumed.counts == one.counts and resumed.checkpoint().digest == one.checkpoint().digest
    for other in (three, resumed):
        assert fields(one.gas) == fields(other.gas)
        assert fields(one.state) == fields(other.state)


def test_jet_has_its_velocity_and_leaving_gas_is_counted():
    jet = sph.Jet(Box((0.02, 0.06), (0.05, 0.09)), (0.0, 60.0))
    scene = small_scene(2, jets=(jet,))
    simulation = sph.Simulation(scene)
    simulation.step(1)
    gas = simulation.gas
    inside = ((gas.x > (0.02, 0.06)) & (gas.x < (0.05, 0.09))).all(axis=1)
    assert inside.any() and (gas.v[inside] == (0.0, 60.0)).all()
    n = gas.n
    simulation.step(60)  # out of the open top
    assert simulation.counts["gas_dropped"] == n - simulation.gas.n > 0
    assert simulation.counts["dropped"] == 0


def test_gas_at_rest_stays():
    """A uniform pressure moves neither the gas nor the particles in it, whatever their order."""
    scene = small_scene(2).replace(gravity=Gravity((0.0,), ((0.0, 0.0),)))
    with_gas, without = sph.Simulation(scene), sph.Simulation(scene.replace(gas=None))
    for simulation in (with_gas, without):
        simulation.step(0)
    assert np.allclose(with_gas.gas.pressure, 1e5, rtol=1e-13)
    # but the solid is accelerated by its own pressure, which the gas resists
    assert np.abs(with_gas.state.a).max() <= np.abs(without.state.a).max() * (1 + 1e-6)


def test_snapshot_is_read_only_and_absent_without_gas():
    simulation = sph.Simulation(small_scene(2))
    with pytest.raises(ValueError, match="read-only"):
        simulation.gas.pressure[0] = 1.0
    assert math.isclose(simulation.gas.mass.sum(), simulation.gas.mass[::-1].sum())
    with pytest.raises(AttributeError, match="has no gas"):
        _ = sph.Simulation(scenes.incline_sph(height=0.03, columns=6)).gas
