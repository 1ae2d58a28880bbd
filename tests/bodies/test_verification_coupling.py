"""Bodies that another program moves and loads: against theory, and against what the core does."""

import itertools

import numpy as np
import pytest
from same_bits import bits, shown
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Box, Fill, Grid, Motion, Sphere, Wall

CELL = 0.01
G = 9.8


def bed(*bodies, dim=2, **changes):
    """A bed of 24 by 10 cells, and space for bodies above it."""
    shape = (24, 30) if dim == 2 else (12, 4, 16)
    depth = 10 if dim == 2 else 5
    top = (*(CELL * n for n in shape[:-1]), depth * CELL)
    given = {
        "grid": Grid((0.0,) * dim, CELL, shape, periodic=(True,) * (dim - 1) + (False,)),
        "fills": (Fill(Box((0.0,) * dim, top), 2**dim, lithostatic=True),),
        "walls": (Wall(dim - 1, 0.0, kind="no_slip"),),
        "bodies": bodies,
    }
    return scene_with(**given | changes)


def disc(height=0.13, **options):
    return Body(Sphere(0.02, center=(0.0, 0.0)), (0.12, height), **options)


def test_a_body_in_free_space_obeys_newton():
    """Force and torque are constant between exchanges: v and omega exact, x with the step."""
    mass, inertia, force, torque, push = 3.0, (0.02, 0.03, 0.05), (1.5, -0.6, 2.0), 0.004, 20
    ball = Body(
        Sphere(0.01, center=(0.0,) * 3), (0.06, 0.02, 0.12), free="xyz", mass=mass, inertia=inertia
    )
    scene = bed(ball, dim=3, gravity=0.0, fills=(Fill(Box((0.0,) * 3, (0.12, 0.04, 0.02)), 8),))
    sim = gr.Simulation(scene)
    sim.apply_load(0, force=force, torque=(0.0, 0.0, torque))
    sim.step(push)
    loaded, state = sim.time, sim.bodies[0]
    np.testing.assert_allclose(state.velocity, np.array(force) * loaded / mass, rtol=1e-12)
    assert state.angular_velocity[2] == pytest.approx(torque * loaded / inertia[2], rel=1e-12)
    np.testing.assert_array_equal(state.applied_force, force)
    gone = state.position - ball.position
    exact = 0.5 * np.array(force) / mass * loaded**2
    np.testing.assert_allclose(gone, exact * (1 + 1 / push), rtol=1e-9)  # symplectic Euler
    sim.apply_load(0, force=(0.0,) * 3, torque=(0.0,) * 3)
    sim.step(5)
    np.testing.assert_array_equal(sim.bodies[0].velocity, state.velocity)


def test_what_is_set_is_the_same_as_a_motion():
    """To the last bit, at once, and also after a motion that is not constant."""
    velocity, omega, n = (0.05, -0.1), 2.0, 40
    moved = gr.Simulation(bed(disc(motion=Motion(velocity=(velocity,), angular_velocity=(omega,)))))
    at_rest = gr.Simulation(bed(disc()))
    at_rest.set_motion(0, velocity=velocity, angular_velocity=omega)
    assert at_rest.bodies[0].driven and not moved.bodies[0].driven
    for sim in (moved, at_rest):
        sim.step(n)
    assert shown(at_rest.state) == shown(moved.state)
    assert at_rest.set_motion(0).force[1] == pytest.approx(moved.bodies[0].impulse[1] / moved.time)
    turning = Motion(times=(0.0, 0.1), velocity=((0.0, 0.0), (1.0, 0.0)))
    sim = gr.Simulation(bed(disc(motion=turning)))
    sim.step(n)
    before = sim.bodies[0]
    sim.set_motion(0, angular_velocity=1.0)  # what is not named stays
    sim.step(n)
    np.testing.assert_array_equal(sim.bodies[0].velocity, before.velocity)
    assert sim.bodies[0].angular_velocity == 1.0


def coupled(scene, every, until, mass):
    """A falling disc whose equation of motion is integrated outside, and the impulse on it."""
    sim = gr.Simulation(scene)
    velocity, impulse = scene.bodies[0].motion.velocity[0][1], 0.0
    while sim.time < until:
        load = sim.body_load(0)
        impulse += load.force[1] * load.duration
        velocity += (load.force[1] / mass - G) * load.duration
        sim.set_motion(0, velocity=(0.0, velocity))
        sim.step(every)
    load = sim.set_motion(0)
    assert sim.body_load(0).duration == 0
    return sim, impulse + load.force[1] * load.duration


def test_a_body_integrated_outside_converges_to_the_built_in_one():
    """The force of the last interval acts in the next one: the error is of its length."""
    mass, until, scheme = 8.0, 0.06, gr.Scheme(dt=1e-4)
    options = {"motion": Motion(velocity=((0.0, -0.5),)), "friction": 0.3}
    built_in = gr.Simulation(bed(disc(free="y", mass=mass, **options), scheme=scheme)).run(
        until=until
    )
    wanted = built_in.bodies[0].position[1]
    fallen = 0.13 - wanted
    errors = []
    for every in (20, 10, 5):
        sim, impulse = coupled(bed(disc(**options), scheme=scheme), every, until, mass)
        assert sim.time == built_in.time
        assert impulse == pytest.approx(sim.bodies[0].impulse[1], rel=1e-12)
        errors.append(abs(sim.bodies[0].position[1] - wanted) / fallen)
    orders = [np.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert errors[-1] < 0.003
    assert all(0.9 < order < 1.1 for order in orders)


@pytest.mark.parametrize("dim", [2, 3])
def test_same_bits_with_threads_after_a_restart_and_in_a_record(dim, tmp_path):
    """Checkpoints and records have all that was set, and the begin of the interval."""
    middle = (0.06,) * (dim - 1)
    free = Body(
        Sphere(0.02, center=(0.0,) * dim), (*middle, 0.11), free="xyz"[:dim], mass=2.0,
        inertia=1e-3 if dim == 2 else (1e-3,) * 3,
    )  # fmt: skip
    moved = Body(Box(size=(0.02,) * dim), (*(0.02, *middle)[: dim - 1], 0.09))
    scene = bed(moved, free, dim=dim)
    turning, torque = (2.0, 0.3) if dim == 2 else ((0.0, 2.0, 0.0), (0.0, 0.3, 0.0))

    def steps(sim, first, last):
        loads = []
        for k in range(first, last):
            velocity = (0.1 * (-1) ** k, *(0.0,) * (dim - 2), -0.05)
            loads.append(sim.set_motion(0, velocity=velocity, angular_velocity=turning))
            loads.append(sim.apply_load(1, force=(0.5 * k, *(0.0,) * (dim - 1)), torque=torque))
            sim.step(7)
        return [(load.force.tobytes(), load.torque.tobytes(), load.duration) for load in loads]

    whole = gr.Simulation(scene, threads=1)
    loads = steps(whole, 0, 6)
    path, every = tmp_path / "a.h5", 5 * whole.dt
    part = gr.Simulation(scene, threads=2)
    with part.recording(path, every=every):
        assert steps(part, 0, 3) == loads[:6]
    for sim in (
        gr.Simulation.from_checkpoint(scene, part.checkpoint()),
        gr.Simulation.resume(path, threads=3),
    ):
        assert steps(sim, 3, 6) == loads[6:]
        assert shown(sim.state) == shown(whole.state)
        assert str(sim.bodies) == str(whole.bodies)
    record = gr.open(path)
    assert len(record) == 1 + int(part.time / every + 1e-9)
    assert record[-1].bodies[0].driven and record[-1].bodies[1].applied_force[0] == 1.0


def test_a_block_of_recording_writes_what_a_run_does(tmp_path):
    """Frames at the same steps with the same bits; runs within it, and no other options of them."""
    scene = bed(disc(motion=Motion(velocity=((0.0, -0.2),))))
    whole = gr.Simulation(scene).run(until=0.03, save=tmp_path / "run.h5", every=0.004)
    sim, seen = gr.Simulation(scene), []
    with sim.recording(tmp_path / "block.h5", every=0.004):
        while sim.time < 0.02:
            sim.step(3)
        sim.run(until=0.03, hooks=(lambda sim: seen.append(sim.time),))
        with pytest.raises(ValueError, match="is set by the block"):
            sim.run(until=0.04, every=0.1)
        with pytest.raises(RuntimeError, match="in another block"), sim.recording():
            pass
    assert bits(sim) == bits(whole)
    one, other = gr.open(tmp_path / "run.h5"), gr.open(tmp_path / "block.h5")
    assert [shown(frame) for frame in other] == [shown(frame) for frame in one]
    assert seen and sim.health().verdict == whole.health().verdict == other.health().verdict
    with pytest.raises(ZeroDivisionError), sim.recording():
        sim.step(5)
        raise ZeroDivisionError
    assert gr.Simulation.resume(tmp_path / "block.h5").steps == sim.steps  # saved all the same


def test_steps_become_shorter_at_once_if_a_body_is_fast():
    sim = gr.Simulation(bed(disc(0.2)))
    sim.step(3)
    before = sim.dt
    sim.set_motion(0, velocity=(10.0, 0.0))
    assert sim.dt < before
    sim.step(1)
    assert sim.time == pytest.approx(3 * before + sim.dt, rel=1e-12)


def test_what_cannot_be_set_is_refused():
    """The argument is named, with its value and what is allowed."""
    wide = Body(Box(size=(0.236, 0.05)), (0.12, 0.125))
    fixed, free = disc(0.18), disc(0.225, free="y", mass=1.0)
    turning = disc(0.27, free="xy", mass=1.0, inertia=1e-3)
    sim = gr.Simulation(bed(wide, fixed, free, turning, scheme=gr.Scheme(dt=1.5e-4)))
    for message, error, call in (
        ("body = 4", ValueError, lambda: sim.set_motion(4)),
        ("body = 0.5", TypeError, lambda: sim.set_motion(0.5)),
        (
            "velocity = .* must be 2 numbers",
            ValueError,
            lambda: sim.set_motion(1, velocity=(0, 0, 0)),
        ),
        ("velocity.* = nan", ValueError, lambda: sim.set_motion(1, velocity=(np.nan, 0))),
        ("along y: bodies.2. moves freely", ValueError, lambda: sim.set_motion(2, velocity=(0, 1))),
        (
            "must be None: bodies.3. turns",
            ValueError,
            lambda: sim.set_motion(3, angular_velocity=1),
        ),
        ("slower than elastic waves", ValueError, lambda: sim.set_motion(1, velocity=(1e3, 0))),
        ("must have a dt of at most", ValueError, lambda: sim.set_motion(1, velocity=(25.0, 0))),
        ("half the period", ValueError, lambda: sim.set_motion(0, angular_velocity=1.0)),
        ("along x: the motion", ValueError, lambda: sim.apply_load(2, force=(1, 0))),
        ("has no inertia", ValueError, lambda: sim.apply_load(2, torque=1.0)),
        ("torque = .* must be a finite", TypeError, lambda: sim.apply_load(3, torque=(1.0, 0, 0))),
    ):
        with pytest.raises(error, match=message):
            call()
    with pytest.raises(ValueError, match="no bodies"):
        gr.Simulation(bed()).set_motion(0)
    assert not any(body.driven for body in sim.bodies)
