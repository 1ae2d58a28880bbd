"""The gas of SPH against closed forms: drag, Darcy, diffusion, fluidisation."""

import math
from dataclasses import replace

import numpy as np
import pytest
from oracle_sph import images, kernel

from granular import Box, Fill, Gravity, Grid, scenes, sph

DX = 0.01
HEAVY = 1e6
"""Factor on the densities with which the solid particles do not move."""


def porous_box(shape, *, heavy=1.0, rho0=1600.0, wind=None, jitter=0.0, dt=None, **gas):
    """Solid particles and gas everywhere in a periodic box without gravity."""
    dim = len(shape)
    grid = Grid((0.0,) * dim, DX, shape, periodic=(True,) * dim)
    box = Box((0.0,) * dim, grid.upper)
    grain_density = gas.pop("grain_density", 2500.0)
    return sph.Scene(
        name="porous box",
        grid=grid,
        fills=(Fill(box, 1, jitter=jitter),),
        material=sph.Viscoplastic(rho0=heavy * rho0, kappa=1e5 if rho0 > 100 else 10.0),
        numerics=sph.Numerics(smoothing=1.5, regularisation=0.5, dt=dt),
        gas=sph.Gas(
            fills=(Fill(box, 1, velocity=wind, jitter=jitter),),
            grain_density=heavy * grain_density,
            **gas,
        ),
        gravity=Gravity((0.0,), ((0.0,) * dim,)),
        duration=1.0,
    )


# ---- drag ----


def slip(simulation):
    return simulation.gas.v[:, 0].mean() - simulation.state.v[:, 0].mean()


@pytest.mark.parametrize(("rho0", "grain_density"), [(1600.0, 2500.0), (1.3, 2.0)])
@pytest.mark.parametrize("dim", [2, 3])
def test_two_box_drag_decays(dim, rho0, grain_density):
    """The slip of a uniform gas decays as exp(-t/t_s), 1/t_s = B (1/(e rho_g) + 1/rho).

    A solid as light as the gas takes up its momentum.
    """
    wind = (1.0,) + (0.0,) * (dim - 1)
    scene = porous_box((8,) * dim, rho0=rho0, grain_density=grain_density, wind=wind)
    gas, e = scene.gas, 1 - rho0 / grain_density
    per_mass = 1 / (e * gas.density) + 1 / rho0
    t_s = gas.permeability / (e**2 * gas.viscosity * per_mass)
    scene = scene.replace(numerics=replace(scene.numerics, dt=min(0.05 * t_s, scene.longest_dt)))
    simulation = sph.Simulation(scene)
    simulation.step(0)
    start = simulation.gas.mass.sum() / (simulation.gas.mass.sum() + simulation.state.mass.sum())
    for _ in range(3):
        simulation.step(math.ceil(0.5 * t_s / scene.numerics.dt))
        assert slip(simulation) == pytest.approx(math.exp(-simulation.time / t_s), rel=0.01)
    assert simulation.gas.v[:, 0].mean() == pytest.approx(
        start + (1 - start) * slip(simulation), rel=0.01
    )


@pytest.mark.parametrize(("rho0", "grain_density"), [(1600.0, 2500.0), (1.3, 2.0)])
def test_drag_far_beyond_the_explicit_limit(rho0, grain_density):
    """Steps of a thousand times t_s: no overshoot, and the momentum is kept."""
    scene = porous_box(
        (8, 8),
        rho0=rho0,
        grain_density=grain_density,
        wind=(1.0, 0.0),
        permeability=2e-14,
        jitter=0.2,
    )
    simulation = sph.Simulation(scene)
    simulation.step(0)
    momentum = (simulation.gas.mass[:, None] * simulation.gas.v).sum(0)
    simulation.step(3)
    gas, grains = simulation.gas, simulation.state
    common = momentum[0] / (gas.mass.sum() + grains.mass.sum())
    assert abs(slip(simulation)) < 0.02
    assert gas.v[:, 0].mean() == pytest.approx(common, abs=0.03)
    after = (gas.mass[:, None] * gas.v).sum(0) + (grains.mass[:, None] * grains.v).sum(0)
    assert np.abs(after - momentum).max() < 1e-12 * abs(momentum[0])


# ---- Darcy and diffusion ----


@pytest.mark.parametrize(("jitter", "within"), [(0.0, 0.01), (0.3, 0.02)])
def test_flux_is_that_of_darcy(jitter, within):
    """Gas driven around a periodic ring: -(k/eta) dp/dx equals e v away from the driven region.

    Disorder of both sets of particles costs another per cent: 1.3 % was found, -2 % to 1 % for
    other seeds, due to the disorder of the gas alone: see `test_disorder_has_a_rate_of_its_own`.
    """
    columns = 40
    scene = porous_box((columns, 6), heavy=HEAVY, sound_speed=100.0, jitter=jitter)
    jet = sph.Jet(Box((0.0, 0.0), (4 * DX, 6 * DX)), (0.3, 0.0))
    scene = scene.replace(gas=replace(scene.gas, jets=(jet,)))
    simulation, slopes, fluxes = sph.Simulation(scene), [], []

    def sample(simulation):
        gas = simulation.gas
        away = (gas.x[:, 0] > 10 * DX) & (gas.x[:, 0] < (columns - 6) * DX)
        slopes.append(np.polyfit(gas.x[away, 0], gas.pressure[away], 1)[0])
        fluxes.append((gas.porosity * gas.v[:, 0])[away].mean())

    simulation.run(0.05, monitor=False)
    simulation.run(0.1, every=5e-4, hooks=(sample,), monitor=False)
    darcy = -scene.gas.permeability / scene.gas.viscosity * np.mean(slopes)
    assert np.mean(fluxes) > 0.07
    assert darcy == pytest.approx(np.mean(fluxes), rel=within)


def soaked(columns, jitter=0.0, ordering=0):
    """Solid at rest and a gas, ordered for some steps by a pressure above the ambient one."""
    scene = porous_box((columns, 6), heavy=HEAVY, permeability=2e-11, jitter=jitter)
    simulation = sph.Simulation(scene)
    if ordering:
        gas, (fill,) = scene.gas, scene.gas.fills
        fills = (replace(fill, density=gas.density),)
        pressed = replace(gas, fills=fills, pressure=0.95 * gas.pressure, damping=2.0)
        earlier = sph.Simulation(scene.replace(gas=pressed))
        earlier.step(ordering)
        rows = simulation._rows
        simulation.buffers["x"][:, rows.gas_first : rows.gas_first + rows.gas] = earlier.gas.x.T
        simulation._bind(rows, fresh=True)
    return simulation


def decay_rate(simulation, steps):
    """Decay rate of a cosine of pressure, over D q^2."""
    scene, rows = simulation.scene, simulation._rows
    q, ambient = 2 * math.pi / (scene.grid.shape[0] * DX), scene.gas.pressure
    points = slice(rows.gas_first, rows.gas_first + rows.gas)
    simulation.buffers["rho"][0, points] *= 1 + 0.01 * np.cos(
        q * simulation.buffers["x"][0, points]
    )

    def wave():
        """Least-squares fit with a constant, as ordering particles take more volume."""
        gas = simulation.gas
        waves = np.stack([f(q * gas.x[:, 0]) for f in (np.ones_like, np.cos, np.sin)], axis=1)
        return simulation.time, np.linalg.lstsq(waves, gas.pressure / ambient, rcond=None)[0][1]

    simulation.step(60)
    begin = wave()
    simulation.step(steps)
    end = wave()
    rate = math.log(begin[1] / end[1]) / (end[0] - begin[0])
    return rate / (scene.gas.diffusivity(scene.material.rho0) * q**2)


def disorder(simulation):
    """Root mean square of h E/V, where E measures the disorder of the gas particles.

    A uniform pressure p above the ambient one exerts the force -p E: E = sum_b (V_a/n_a + V_b/n_b)
    grad W, V = 1/n.
    """
    rows, h = simulation._rows, simulation.scene.h
    x = simulation.buffers["x"][:, rows.gas_first : rows.gas_first + rows.gas].T
    parts = [kernel(2, h, x[None] + shift - x[:, None]) for shift in images(simulation.scene, x)]
    n = sum(w.sum(1) for w, _ in parts)
    spread = n[:, None] ** -2 + n[None] ** -2
    E = sum((spread[..., None] * grad).sum(1) for _, grad in parts)
    return h * math.sqrt(np.mean((E**2).sum(1) * n**2))


def test_pore_pressure_diffuses():
    """D = k p/(e eta); the inertia of the gas adds D q^2 t_s = 3e-4 to the rate."""
    assert decay_rate(soaked(64), 1000) == pytest.approx(1.0, abs=0.02)


def test_pore_pressure_diffuses_in_a_gas_that_has_come_to_order():
    """The disorder is that of the gas in the beds of the scene functions, 0.02 to 0.03."""
    simulation = soaked(48, jitter=0.3, ordering=1000)
    assert 0.02 < disorder(simulation) < 0.03
    assert decay_rate(simulation, 1000) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("columns", [48, 96])
def test_disorder_has_a_rate_of_its_own(columns):
    """Particles that move by -p E change their order, and with it the volume they take.

    The pressure then decays at D (h E/V)^2/h^2 in addition to D q^2, whatever the wavelength. That
    is an upper bound, reached if the exchange removes all pressures that oppose E; 0.72 to 0.91 was
    found.
    """
    simulation = soaked(columns, jitter=0.3)
    q_h = 2 * math.pi / (columns * DX) * simulation.scene.h
    most = (disorder(simulation) / q_h) ** 2
    assert 0.6 * most < decay_rate(simulation, 1000) - 1.0 < most


# ---- fluidisation ----


def bed_means(share, height, begin=0.15, end=0.3):
    """Means over a time of flux, pressure drop and height of the centre of the bed [m].

    The flux is relative to that of fluidisation, the drop to the weight of the bed; the piston
    moves with `share` of that flux.
    """
    trial = scenes.fluidised_bed(pressure=2e4)
    gas = trial.gas
    weight = 1600.0 * 9.81
    critical = gas.permeability / gas.viscosity * weight * (1 - gas.density / gas.grain_density)
    scene = scenes.fluidised_bed(
        velocity=share * critical, pressure=2e4, height=height, columns=6, plenum=0.16, duration=end
    )
    base, rows = scene.walls[1].at, []

    def sample(simulation):
        points, grains = simulation.gas, simulation.state
        y, top = points.x[:, 1], grains.x[:, 1].max()
        inside = (y > base + 0.02) & (y < top - 0.03)
        flux = (points.porosity * (points.v[:, 1] - grains.v[:, 1].mean()))[inside].mean()
        below = points.pressure[(y > base - 0.09) & (y < base - 0.06)].mean()
        above = points.pressure[(y > top + 0.01) & (y < top + 0.03)].mean()
        load = grains.mass.sum() * 9.81 / (6 * DX)
        rows.append((flux / critical, (below - above) / load, grains.x[:, 1].mean() - base))

    simulation = sph.Simulation(scene)
    simulation.run(begin, monitor=False)
    simulation.run(end, every=0.002, hooks=(sample,), monitor=False)
    return np.mean(rows, axis=0)


def test_bed_is_fluidised_where_the_gradient_is_its_weight():
    flux, drop, _ = bed_means(0.5, 0.2)
    assert 0.4 < flux < 0.55
    # the flux whose pressure drop carries the bed
    assert flux / drop == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_bed_expands_beyond_its_fluidisation_only():
    centres = {share: bed_means(share, 0.1) for share in (0.5, 0.8, 1.4)}
    assert abs(centres[0.8][2] - centres[0.5][2]) < 5e-4
    assert centres[1.4][2] - centres[0.5][2] > 5e-3
    assert centres[1.4][1] == pytest.approx(1.0, abs=0.1)
