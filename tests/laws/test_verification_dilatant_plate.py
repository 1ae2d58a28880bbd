"""Plane shear and an oedometer under a plate that keeps a pressure and follows the volume."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr

CELL, COLUMNS, PRESSURE = 0.01, 4, 1000.0
WIDTH = CELL * COLUMNS
SAND = gr.DilatantMuI(E=1e6, d=0.002)


def under_a_plate(packing, layers, *, mass, pressure, speed=0.0, **changes):
    """A simulation of periodic columns between a rough wall and a plate, without gravity."""
    top, middle = layers * CELL, layers * CELL + 0.02
    plate = gr.Body(
        gr.Box(size=(math.inf, 0.04)),
        (WIDTH / 2, middle),
        motion=gr.Motion(velocity=((speed, 0.0),)),
        free="y",
        mass=mass,
        contact="sticky" if speed else "separating",
    )
    density = packing * SAND.rho_s * math.exp(pressure / SAND.K)
    fill = gr.Fill(gr.Box((0.0, 0.0), (WIDTH, top)), 4, packing=packing, density=density, **changes)
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), CELL, (COLUMNS, layers + 6), periodic=(True, False)),
        fills=(fill,),
        material=SAND,
        walls=(gr.Wall(1, 0.0),),
        bodies=(plate,),
        gravity=gr.Gravity((0.0,), ((0.0, 0.0),)),
    )
    sim = gr.Simulation(scene, threads=1)
    sim.apply_load(0, force=(0.0, -pressure * WIDTH))
    return sim


def height(sim):
    return sim.bodies[0].position[1] - 0.02


@pytest.mark.parametrize("packing", [0.56, 0.6])
def test_plane_shear_comes_to_the_friction_and_the_packing_of_the_law(packing):
    """From both sides: the plate sinks or rises to the volume of phi_eq(I), and bears mu(I) P."""
    speed, layers = 1.0, 12
    sim = under_a_plate(packing, layers, mass=20.0, pressure=PRESSURE, speed=speed, jitter=0.4)
    sim.buffers["v"][0] = speed * sim.buffers["x"][1] / (layers * CELL)
    sim.run(1.0)
    before, begin = sim.bodies[0].impulse, sim.time
    sim.run(1.5)
    force = (sim.bodies[0].impulse - before) / (sim.time - begin) / WIDTH
    state, top = sim.state, height(sim)
    inertial = speed / top * SAND.d * math.sqrt(SAND.rho_s / PRESSURE)
    assert force[1] == pytest.approx(PRESSURE, rel=5e-3)
    assert -force[0] / force[1] == pytest.approx(SAND.friction(inertial), rel=5e-3)
    at_rest = SAND.phi_c / state.bulking
    assert at_rest == pytest.approx(SAND.packing(inertial), rel=2e-3)
    grains = state.mass.sum() / (SAND.rho_s * WIDTH)
    assert top == pytest.approx(grains / SAND.packing(inertial), rel=1e-2)
    assert (top > layers * CELL) == (packing > SAND.phi_c)
    y = state.x[:, 1]
    inside = (y > 0.1 * top) & (y < 0.9 * top)
    assert state.v[inside, 0] == pytest.approx(speed * y[inside] / top, abs=0.02 * speed)


@pytest.mark.parametrize("packing", [0.56, 0.585, 0.64])
def test_an_oedometer_has_the_path_of_the_element(packing):
    """Horizontal over vertical stress of yield, or of elasticity in dense sand; the modulus of a
    column of eight cells is softer by a few per cent, of the cell at the plate."""
    start, end, steps = 100.0, 2000.0, 40
    sim = under_a_plate(packing, 8, mass=2.0, pressure=start)
    stresses, strains, initial = [], [], height(sim)
    for k in range(1, steps + 1):
        load = start + (end - start) * k / steps
        sim.apply_load(0, force=(0.0, -load * WIDTH))
        sim.run(0.4 * k / steps)
        volume = sim.state.mass / sim.state.density
        stresses.append(-(volume @ sim.state.stress[:, :2]) / volume.sum())
        strains.append(math.log(initial / height(sim)))
    horizontal, vertical = np.array(stresses).T
    half = steps // 2
    rise = (horizontal[-1] - horizontal[half]) / (vertical[-1] - vertical[half])
    modulus = np.polyfit(strains[half:], vertical[half:], 1)[0]
    friction, root = SAND.peak_friction(packing), math.sqrt(3.0)
    yields = (root - friction) / (root + 2 * friction)
    if packing == 0.64:
        assert yields < 0.3 / 0.7
        assert rise == pytest.approx(0.3 / 0.7, rel=1e-3)
        assert modulus == pytest.approx(SAND.K + 4 * SAND.G / 3, rel=0.05)
    else:
        assert rise == pytest.approx(yields, rel=1e-2)
        assert horizontal[-1] / vertical[-1] == pytest.approx(yields, rel=1e-2)
    if packing == SAND.phi_c:
        assert modulus == pytest.approx(SAND.K * (1 + 2 * SAND.mu_s / root), rel=0.05)
