"""Damping of elastic waves by the restitution of the contacts of grains."""

import math

import numpy as np
import pytest
from schemes_by_name import scheme_of

import granular as gr
from granular.geometry import Box, Fill, Grid
from granular.gravity import Gravity
from granular.materials import Elastic, MuI
from granular.mpm.limits import dt_limit
from granular.theory import wave_decay

LENGTH = 1.6
REST = Gravity((0.0,), ((0.0, 0.0),))
DAMPED = {"restitution": 0.5, "contact_diameter": 0.05}


def wave(material, cells, *, threads=1, dim=2, scheme=None):
    """A standing wave of one wavelength in a periodic solid."""
    cell = LENGTH / cells
    shape, size = (cells, *[4] * (dim - 1)), (LENGTH, *[4 * cell] * (dim - 1))
    scene = gr.Scene(
        name="wave",
        grid=Grid((0.0,) * dim, cell, shape, periodic=(True,) * dim),
        fills=(Fill(Box((0.0,) * dim, size), 2**dim),),
        material=material,
        scheme=scheme or scheme_of("quadratic", "flip", "particle", flip_decay=0.0),
        gravity=Gravity((0.0,), ((0.0,) * dim,)),
        duration=1.0,
    )
    sim = gr.Simulation(scene, threads=threads)
    used = sim.buffers["id"] >= 0
    sim.buffers["v"][0, used] = 1e-4 * np.sin(2 * np.pi * sim.buffers["x"][0, used] / LENGTH)
    return sim


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
    a = np.array(amplitudes)
    peaks = np.flatnonzero((a[1:-1] > a[:-2]) & (a[1:-1] > a[2:])) + 1
    return -np.polyfit(np.array(times)[peaks], np.log(a[peaks]), 1)[0]


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
