"""Material on a belt: it has its velocity, and rho h u pass."""

import math

import numpy as np
import pytest

import granular as gr

BELT = {"cell": 0.02, "stock": 0.24, "height": 0.24, "run": 0.4, "duration": 1.2}
LINE = 0.16


def test_a_rising_belt_carries_its_velocity_times_the_thickness():
    """Behind the gate all ride on the belt: their velocity is the belt's (0.3 % were found, 1 % is
    asked for). The layer is as high as the opening, less what it loosens on its way through: 0.88
    to 0.97 of it. What passes a line in 0.25 s is rho h u: 3 %, the mass of the points of one
    column of the 6 that pass.
    """
    sim = gr.Simulation(gr.scenes.conveyor(angle_deg=8.0, **BELT), threads=1)
    held = []
    for until in (0.95, 1.2):
        sim.run(until=until)
        held.append(sim.state.mass[sim.state.x[:, 0] < LINE].sum())
    passed = (held[0] - held[1]) / 0.25
    x, v, mass = sim.state.x, sim.state.v, sim.state.mass
    rides = (x[:, 0] > LINE) & (x[:, 0] < LINE + 0.12)
    speed = np.average(v[rides, 0], weights=mass[rides])
    thickness = mass[rides].sum() / (1500.0 * 0.12)
    assert speed == pytest.approx(0.5, rel=0.01)
    assert 0.85 < thickness / 0.1 < 1.0
    assert passed == pytest.approx(1500.0 * thickness * speed, rel=0.03)


def test_a_smooth_belt_carries_nothing_by_itself():
    """Without friction the bin runs out under its weight alone, whatever the belt does."""
    starts = [
        gr.Simulation(
            gr.scenes.conveyor(friction=0.0, speed=speed, **BELT | {"duration": 0.2}), threads=1
        ).run()
        for speed in (0.5, -0.5)
    ]
    first, second = (sim.state for sim in starts)
    np.testing.assert_allclose(first.x, second.x, rtol=0, atol=1e-9)
    assert math.isclose(starts[0].bodies[0].impulse[0], 0.0, abs_tol=1e-9)
