"""Forces on an obstacle: at rest, of a fast layer, and of what has come to rest before it."""

import numpy as np
import pytest

import granular as gr
from granular import theory

RHO = 1500.0


def force(sim, until):
    """Mean force on the obstacle until a time [N/m]."""
    begin, felt = sim.time, sim.bodies[0].impulse
    sim.run(until=until)
    return (sim.bodies[0].impulse - felt) / (sim.time - begin)


@pytest.mark.parametrize("cell", [0.02, 0.01])
def test_a_bed_at_rest_presses_as_its_depth(cell):
    """It begins under K0 times the weight above, at yield, and yields by half a per cent of it."""
    bed = {"angle_deg": 0.0, "gap": 0.0, "length": 0.2, "headroom": 0.1}
    sim = gr.Simulation(gr.scenes.obstacle(cell=cell, **bed), threads=1)
    sim.run(until=0.05)
    felt = force(sim, 0.1)
    assert felt[0] == pytest.approx(sim.scene.material.K0 * 0.5 * RHO * 9.81 * 0.1**2, rel=0.01)
    assert abs(felt[1]) < 1e-9 * felt[0]  # the face is smooth


def test_a_fast_layer_is_turned_by_its_momentum_flux():
    """All of the momentum along the bed ends at a smooth wall, tall enough that the layer is turned
    by 90 degrees: rho h v^2, less what is stored in the heap at its foot. The first contact, until
    0.05 s, is that of an elastic wave, whose pressure is of the order of rho c v. Waves go on:
    single frames are off by a third, the mean over 0.15 s by less than 1 % with these cells and by
    5 to 13 % with twice as large ones; 20 % are asked for.
    """
    jet = {"angle_deg": 0.0, "gap": 0.02, "length": 1.0, "friction": 0.0, "speed": 4.0}
    scene = gr.scenes.obstacle(gravity=0.5, tall=0.6, headroom=0.4, behind=0.2, **jet)
    sim = gr.Simulation(scene, threads=1)
    first = force(sim, 0.01)[0]
    sim.run(until=0.05)
    flux = RHO * 0.1 * 4.0**2
    assert force(sim, 0.2)[0] == pytest.approx(flux, rel=0.2)
    assert first > 2 * flux


def test_what_comes_to_rest_presses_between_active_and_passive():
    """Rankine's bounds with the depth at the wall, on a level bed that the layer slid along."""
    layer = {"angle_deg": 0.0, "gap": 0.1, "length": 0.4, "speed": 1.5, "tall": 0.4}
    sim = gr.Simulation(gr.scenes.obstacle(cell=0.02, behind=0.2, **layer), threads=1)
    sim.run(until=1.2)
    felt = force(sim, 1.5)[0]
    assert np.sqrt((sim.state.v**2).sum(axis=1).mean()) < 0.01
    found = gr.measure.deposit(sim.state)
    depth = found.thickness[(found.axes[0] > 0.04) & (found.axes[0] < 0.1)].mean()
    bounds = theory.earth_pressure(0.3819)
    hydrostatic = 0.5 * RHO * 9.81 * depth**2
    assert bounds.active_coaxial < felt / hydrostatic < bounds.passive_coaxial
