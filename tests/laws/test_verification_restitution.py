"""Damping of elastic waves by the restitution of the contacts of grains."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with
from schemes_by_name import scheme_of

import granular as gr
from granular import NGF, Box, DruckerPrager, Elastic, Fill, Grid, MuI
from granular.mpm.limits import dt_limit
from granular.theory import bar_restitution, wave_decay

LENGTH = 1.6
DAMPED = {"restitution": 0.5, "contact_diameter": 0.05}


def wave(material, cells, *, threads=1, dim=2, scheme=None):
    """A standing wave of one wavelength in a periodic solid."""
    cell = LENGTH / cells
    shape, size = (cells, *[4] * (dim - 1)), (LENGTH, *[4 * cell] * (dim - 1))
    scene = scene_with(
        grid=Grid((0.0,) * dim, cell, shape, periodic=(True,) * dim),
        fills=(Fill(Box((0.0,) * dim, size), 2**dim),),
        material=material,
        scheme=scheme or scheme_of("quadratic", "flip", "particle", flip_decay=0.0),
        gravity=0.0,
    )
    sim = gr.Simulation(scene, threads=threads)
    used = sim.buffers["id"] >= 0
    sim.buffers["v"][0, used] = 1e-4 * np.sin(2 * np.pi * sim.buffers["x"][0, used] / LENGTH)
    return sim


def rate_of_peaks(times, amplitudes):
    """Rate at which the peaks of an oscillation decay [1/s]."""
    a = np.array(amplitudes)
    peaks = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] > a[2:])) + 1
    return -np.polyfit(np.array(times)[peaks], np.log(a[peaks]), 1)[0]


def decay(material, cells, periods=4):
    """Rate of decay [1/s] from the peaks of the amplitude of a wave."""
    sim = wave(material, cells)
    times, amplitudes = [], []
    while sim.time < periods * LENGTH / material.wave_speed:
        sim.step()
        used = sim.buffers["id"] >= 0
        phase = 2 * np.pi * sim.buffers["x"][0, used] / LENGTH
        times.append(sim.time)
        amplitudes.append(abs(np.mean(sim.buffers["v"][0, used] * np.sin(phase))))
    return rate_of_peaks(times, amplitudes)


@pytest.mark.parametrize("elasticity", ["hypoelastic", "hencky"])
def test_a_standing_wave_decays_as_in_a_solid_of_kelvin_and_voigt(elasticity):
    """The error falls with the square of the cell: that of the strain that the grid sees."""
    solid = Elastic(E=1e6, elasticity=elasticity, **DAMPED)
    theory = wave_decay(
        wavenumber=2 * math.pi / LENGTH,
        wave_speed=solid.wave_speed,
        damping_time=solid.damping_time,
    )
    errors = []
    for cells in (16, 32, 64):
        plain = decay(solid.replace(restitution=1.0), cells)
        errors.append(abs((decay(solid, cells) - plain) / theory - 1))
    assert errors[2] < 0.01
    assert errors[1] < 0.35 * errors[0]
    assert errors[2] < 0.35 * errors[1]


def rebound(material, cells, length=0.4, speed=1e-4):
    """Largest mean velocity of a bar after it hit a wall, over that before; the force is then 0."""
    cell = length / cells
    scene = scene_with(
        grid=Grid((0.0, 0.0), cell, (cells + 8, 4), periodic=(False, True)),
        fills=(Fill(Box((0.0, 0.0), (length, 4 * cell)), 4),),
        material=material,
        walls=(gr.Wall(0, 0.0, kind="free_slip"),),
        scheme=scheme_of("quadratic", "tpic", "particle"),
        gravity=0.0,
    )
    sim = gr.Simulation(scene, threads=1)
    used = sim.buffers["id"] >= 0
    before = speed * material.wave_speed
    sim.buffers["v"][0, used] = -before
    largest = -1.0
    while sim.time < 3 * length / material.wave_speed:
        sim.step()
        largest = max(largest, np.mean(sim.buffers["v"][0, used]) / before)
    return largest


@pytest.mark.parametrize("restitution", [0.5, 0.1])
def test_a_bar_rebounds_as_the_sum_of_its_modes_says(restitution):
    found = {}
    for E in (1e5, 1e7):
        bar = Elastic(E=E, restitution=restitution, contact_diameter=0.02)
        found[E] = [rebound(bar, cells) for cells in ((16, 32, 64) if E == 1e5 else (16,))]
    theory = bar_restitution(length=0.4, wave_speed=bar.wave_speed, damping_time=bar.damping_time)
    errors = abs(np.array(found[1e5]) - theory)
    assert errors[2] < 5e-4
    assert errors[1] < 0.3 * errors[0]
    assert errors[2] < 0.3 * errors[1]
    assert found[1e7][0] == pytest.approx(found[1e5][0], rel=1e-8)


def bed(*, cells=10, height=0.2, fills=None, **numbers):
    """A bed under its weight on a floor, periodic along it."""
    cell = height / cells
    layer = Box((0.0, 0.0), (4 * cell, height))
    return scene_with(
        grid=Grid((0.0, 0.0), cell, (4, cells + 6), periodic=(True, False)),
        fills=fills or (Fill(layer, 4, lithostatic=True, K0=1.0),),  # far from yield
        material=MuI(**numbers),
        walls=(gr.Wall(1, 0.0),),
    )


def settling(scene, height=0.2, periods=8):
    """Rate at which the slowest oscillation of a bed decays [1/s].

    That it is found from single steps makes an error of 0.02/s in 8 periods.
    """
    sim = gr.Simulation(scene, threads=1)
    k, wave_speed = math.pi / (2 * height), scene.material.wave_speed
    used = sim.buffers["id"] >= 0
    sim.buffers["v"][1, used] = 1e-3 * np.sin(k * sim.buffers["x"][1, used])
    times, amplitudes = [], []
    while sim.time < periods * 4 * height / wave_speed:
        sim.step(2)
        wave = np.sin(k * sim.buffers["x"][1, used])
        times.append(sim.time)
        amplitudes.append(abs(np.mean(sim.buffers["v"][1, used] * wave)))
    return rate_of_peaks(times, amplitudes)


@pytest.mark.parametrize("E", [1e6, 1e7])
@pytest.mark.parametrize("elasticity", ["hypoelastic", "hencky"])
def test_a_bed_comes_to_rest_in_the_time_of_theory(E, elasticity):
    """With the default scheme; without damping it oscillates for hundreds of times as long."""
    numbers = {"E": E, "elasticity": elasticity, "contact_diameter": 4e-3}
    damped = bed(restitution=0.3, **numbers)
    sand = damped.material
    theory = wave_decay(
        wavenumber=math.pi / 0.4, wave_speed=sand.wave_speed, damping_time=sand.damping_time
    )
    assert settling(damped) == pytest.approx(theory, rel=0.01)
    assert abs(settling(bed(restitution=1.0, **numbers), periods=32)) < 0.005 * theory


@pytest.mark.parametrize("drop", [0.0, 0.01])
def test_the_ready_bed_is_at_rest_when_it_says(drop):
    """It begins with the oscillation of its weight, which falls to a thousandth in the duration."""
    scene = gr.scenes.settling_bed(drop=drop)
    sand, k = scene.material, math.pi / 0.4
    sim = gr.Simulation(scene, threads=1)
    first = 8 * 9.8 * 0.2 / (math.pi**2 * sand.wave_speed)
    times, amplitudes = [], []
    while sim.time < scene.duration:
        sim.step(4)
        state = sim.state
        times.append(sim.time)
        wave = np.sin(k * state.x[:, 1])
        amplitudes.append(abs(2 * np.mean(state.v[:, 1] * wave)))
    rate = wave_decay(wavenumber=k, wave_speed=sand.wave_speed, damping_time=sand.damping_time)
    late = np.array(times) > scene.duration - 5 / rate
    found = rate_of_peaks(np.array(times)[late], np.array(amplitudes)[late])
    assert found == pytest.approx(rate, rel=0.01)
    speed = math.sqrt(np.mean((state.v**2).sum(axis=1)))
    assert speed < 1e-3 * max(first, math.sqrt(2 * 9.8 * drop))
    if not drop:
        assert max(amplitudes) == pytest.approx(
            first * math.exp(-rate * times[np.argmax(amplitudes)]), rel=0.1
        )
    with pytest.raises(ValueError, match="duration = None must be a time with restitution = 1"):
        gr.scenes.settling_bed(restitution=1.0)


@pytest.mark.parametrize("contact", [0.5, 1.0])
def test_the_viscous_stress_hardly_pulls(contact):
    """At the end of a contact a dashpot pulls: with this share of the impulse on the floor."""
    cell = 0.01
    material = MuI(E=1e6, restitution=0.5, contact_diameter=contact * cell)
    scene = scene_with(
        grid=Grid((0.0, 0.0), cell, (4, 28), periodic=(True, False)),
        fills=(Fill(Box((0.0, 0.0), (4 * cell, 0.2)), 4),),
        material=material,
        walls=(gr.Wall(1, 0.0, kind="free_slip"),),
        gravity=0.0,
    )
    sim = gr.Simulation(scene, threads=1, wall_forces=True)
    sim.buffers["v"][1, sim.buffers["id"] >= 0] = -1e-3 * material.wave_speed
    pushes = [0.0]
    while sim.time < 4 * 0.2 / material.wave_speed:
        sim.step()
        pushes.append(-float(sim.walls[0].impulse[1]))
    steps = np.diff(pushes)
    assert -steps[steps < 0].sum() < 2e-4 * steps[steps > 0].sum()


@pytest.mark.parametrize(
    "sand", [gr.materials.glass_beads.replace(E=1e6), NGF(E=1e6, d=4e-3)], ids=["mu_I", "ngf"]
)
def test_steady_flow_is_left_alone(sand):
    """The viscous stress of a fully plastic flow is zero: velocities on an incline stay."""
    speeds = {}
    for restitution in (1.0, 0.3):
        damped = sand.replace(restitution=restitution, contact_diameter=4e-3)
        scene = gr.scenes.incline(
            angle_deg=28.0, height=0.1, cell=0.01, duration=1.5, material=damped
        )
        speeds[restitution] = np.mean(
            gr.Simulation(scene, threads=1).run(monitor=False).state.v[:, 0]
        )
    assert speeds[1.0] > 0.1
    assert speeds[0.3] == pytest.approx(speeds[1.0], rel=2e-3)


def test_each_material_has_its_own_damping():
    """Viscous stress only in the damped layer of two; the same bits after a restart."""
    low, high = Box((0.0, 0.0), (0.08, 0.1)), Box((0.0, 0.1), (0.08, 0.2))
    damped = DruckerPrager(E=1e6, restitution=0.3, contact_diameter=4e-3)
    fills = (Fill(low, 4, lithostatic=True, material=damped), Fill(high, 4, lithostatic=True))
    scene = bed(fills=fills, E=1e6)
    sim = gr.Simulation(scene, threads=1)
    used = sim.buffers["id"] >= 0
    sim.buffers["v"][1, used] = -1e-3
    sim.step(20)
    resumed = gr.Simulation.from_checkpoint(scene, sim.checkpoint(), threads=2)
    sim.step(20), resumed.step(20)
    state, other = sim.state, resumed.state
    assert np.array_equal(state.viscous_stress, other.viscous_stress)
    assert np.array_equal(state.v, other.v)
    below = state.x[:, 1] < 0.1
    assert not state.viscous_stress[~below].any()
    assert state.viscous_stress[below].any()


def test_the_damping_time_is_that_of_the_contact_and_one_leaves_the_bits_alone():
    solid = Elastic(E=1e6, **DAMPED)
    zeta = math.log(2) / math.hypot(math.pi, math.log(2))
    frequency = math.sqrt(6 * solid.K / solid.rho_c) / 0.05
    assert solid.damping_time == pytest.approx(2 * zeta / frequency, rel=1e-14)
    assert Elastic(E=1e6, contact_diameter=0.05).damping_time == 0
    plain, elastic = wave(Elastic(E=1e6), 8), wave(Elastic(E=1e6, contact_diameter=0.05), 8)
    assert "viscous_stress" not in elastic.buffers
    for _ in range(20):
        plain.step(), elastic.step()
    assert np.array_equal(plain.buffers["v"], elastic.buffers["v"])


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("elasticity", ["hypoelastic", "hencky"])
def test_the_bits_do_not_depend_on_the_threads(dim, elasticity):
    found = []
    for threads in (1, 2, 3):
        sim = wave(Elastic(E=1e6, elasticity=elasticity, **DAMPED), 16, threads=threads, dim=dim)
        for _ in range(30):
            sim.step()
        state = sim.state
        found.append(np.concatenate([state.v.ravel(), state.viscous_stress.ravel()]))
    assert abs(found[0]).max() > 0
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])


def test_the_limit_of_the_time_step_falls_and_holds():
    """The limit sqrt(dt0^2 + T^2) - T; below it a wave decays though T is many steps long."""
    solid = Elastic(E=1e6, restitution=0.1, contact_diameter=1.0)
    plain = dt_limit(wave(solid.replace(restitution=1.0), 16).scene)
    sim = wave(solid, 16)
    T = solid.damping_time
    assert T > 2 * plain
    assert dt_limit(sim.scene) == pytest.approx(math.hypot(plain, T) - T, rel=1e-12)
    for _ in range(500):
        sim.step()
    crossing = 0.5 * LENGTH / 16 / solid.wave_speed
    assert sim.time / 500 == pytest.approx(math.hypot(crossing, T) - T, rel=0.01)
    assert abs(sim.buffers["v"]).max() <= 1e-4


@pytest.mark.parametrize("make", [MuI, Elastic])
def test_bad_input_is_refused(make):
    for bad in (0.0, 1.1, -1.0, math.nan):
        with pytest.raises(ValueError, match="restitution"):
            make(restitution=bad, contact_diameter=0.01)
    with pytest.raises(ValueError, match="contact_diameter"):
        make(restitution=0.5)
    with pytest.raises(ValueError, match="contact_diameter"):
        make(restitution=0.5, contact_diameter=0.0)
