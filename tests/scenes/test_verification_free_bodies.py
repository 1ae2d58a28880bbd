"""Ready scenes of bodies that roll and tumble onto a bed: what mechanics says of them."""

import math

import numpy as np
import pytest
from same_bits import same_bits
from scipy.integrate import solve_ivp

import granular as gr

G = 9.81


def angle(state):
    return math.atan2(state.rotation[1, 0], state.rotation[0, 0])


def energy_of(body, state):
    """Kinetic energy and that of height."""
    turning = 0.5 * body.inertia * state.angular_velocity**2
    moving = 0.5 * body.mass * state.velocity @ state.velocity
    return float(turning + moving + body.mass * G * state.position[1])


def test_the_wheel_rolls_down_the_ramp_and_gives_its_momentum_to_the_bed():
    """It rolls by 2/3 g sin; on the bed its momenta change by gravity and what it feels."""
    scene = gr.scenes.rolling_wheel(cell=0.02)
    wheel, sim = scene.bodies[1], gr.Simulation(scene, threads=1)
    sim.run(until=0.4, monitor=False)
    now = sim.bodies[1]
    speed = 2 / 3 * G * math.sin(math.radians(20.0)) * sim.time
    assert np.linalg.norm(now.velocity) == pytest.approx(speed, rel=1e-9)
    assert now.angular_velocity == pytest.approx(-speed / 0.06, rel=1e-9)
    sim.run(until=0.6, monitor=False)
    assert sim.bodies[1].position[0] > 0.06  # beyond the ramp
    before, begun = sim.bodies[1], sim.time
    sim.run(until=1.0, monitor=False)
    after = sim.bodies[1]
    felt = after.impulse - before.impulse - (0.0, wheel.mass * G * (sim.time - begun))
    gained = wheel.mass * (after.velocity - before.velocity)
    assert gained == pytest.approx(felt, abs=1e-12 * np.abs(before.velocity).max() * wheel.mass)
    spun = wheel.inertia * (after.angular_velocity - before.angular_velocity)
    turned = after.angular_impulse - before.angular_impulse
    assert spun == pytest.approx(turned, rel=1e-9)
    lost = energy_of(wheel, before) - energy_of(wheel, after)
    worked = float(after.work - before.work)
    assert 0 < worked < lost  # the rest is dissipated by friction at the rim
    assert worked > 0.5 * lost
    assert np.linalg.norm(after.velocity) < 0.1 * speed
    assert 0.5 * 0.06 < after.position[1] < 0.06  # it has sunk in


def test_the_block_tips_over_the_edge():
    """As a rigid body that turns about the edge, until it slides."""
    scene = gr.scenes.tumbling_block(cell=0.02)
    block, sim = scene.bodies[1], gr.Simulation(scene, threads=1)
    until = 0.08
    sim.run(until=until, monitor=False)
    over, up = 0.02, 0.04  # of the middle, from the edge
    pivoting = block.inertia + block.mass * (over**2 + up**2)

    def rates(_, y):
        lever = over * math.cos(y[0]) + up * math.sin(y[0])
        return [y[1], block.mass * G * lever / pivoting]

    exact = solve_ivp(rates, (0, sim.time), (0.0, 0.0), rtol=1e-10, atol=1e-12).y[:, -1]
    now = sim.bodies[1]
    assert -angle(now) == pytest.approx(exact[0], rel=0.02)
    assert -now.angular_velocity == pytest.approx(exact[1], rel=0.02)
    sim.run(until=1.0, monitor=False)
    rest = sim.bodies[1]
    assert np.linalg.norm(rest.velocity) < 0.05
    assert rest.position[0] > 0.08  # on the bed


@pytest.mark.parametrize(("name", "step"), [("rolling_wheel", 500), ("tumbling_block", 150)])
def test_same_bits_with_threads_and_after_a_restart(name, step):
    """From before to after the time when the body touches both rock and bed."""
    same_bits(gr.scenes.registry[name](cell=0.02, E=1e5), step, 150)
