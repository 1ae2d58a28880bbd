"""Bodies that turn by the torque of the material: flight, conservation, bits."""

import numpy as np
import pytest
from same_bits import same_bits
from scenes_by_hand import scene_with
from scipy.integrate import solve_ivp

import granular as gr
from granular import Body, Box, Cylinder, Fill, Grid, Motion, MuI


def scene_of(body, *, gravity=-9.8, transfer="apic", dt=None):
    """A block of material in 2D or 3D, without walls, and a body."""
    dim = body.dim
    block = Box((0.0,) * dim, (*(0.6,) * (dim - 1), 0.2))
    return scene_with(
        grid=Grid((-0.5,) * dim, 0.05, (32,) * dim),
        fills=(Fill(block, 2**dim),),
        scheme=gr.Scheme(basis="quadratic", transfer=transfer, density=gr.ParticleDensity(), dt=dt),
        bodies=(body,),
        gravity=-gravity,
    )


BOX = Body(
    Box(size=(0.3, 0.16)),
    (0.2, 0.31),
    rotation_deg=25.0,
    motion=Motion(velocity=((0.3, -1.0),), angular_velocity=(3.0,)),
    friction=0.4,
    free="xy",
    mass=30.0,
    inertia=0.3,
)
BRICK = Body(
    Box(size=(0.3, 0.2, 0.16)),
    (0.25, 0.3, 0.31),
    rotation_deg=(20.0, 10.0, 30.0),
    motion=Motion(velocity=((0.2, 0.1, -1.0),), angular_velocity=((1.0, -2.0, 4.0),)),
    friction=0.4,
    free="xyz",
    mass=15.0,
    inertia=((0.1, 0.01, 0.0), (0.01, 0.14, 0.02), (0.0, 0.02, 0.17)),
)


def spin(body, state):
    """Angular momentum about the origin of the scene, in 2D along z."""
    x, v = state.position, state.velocity
    if body.dim == 2:
        orbit = x[0] * v[1] - x[1] * v[0]
        return body.mass * orbit + body.inertia * state.angular_velocity
    tensor = state.rotation @ np.array(body.inertia) @ state.rotation.T
    return body.mass * np.cross(x, v) + tensor @ state.angular_velocity


def test_flight_is_that_of_euler_and_galilei():
    """The orientation converges with the square of the step to that of RK45; the path is exact."""
    inertia = np.diag([0.1, 0.16, 0.2])
    start = np.array([0.5, 8.0, 0.3])
    body = Body(
        Box(size=(0.3, 0.2, 0.1)),
        (0.3, 0.3, 4.0),
        motion=Motion(velocity=((0.5, 0.0, 2.0),), angular_velocity=(tuple(start),)),
        free="xyz",
        mass=3.0,
        inertia=(0.1, 0.16, 0.2),
    )

    def rates(_, y):
        w, q = y[:3], y[3:].reshape(3, 3)
        return [
            *np.linalg.solve(inertia, -np.cross(w, inertia @ w)),
            *(q @ np.cross(np.eye(3), -w).T).ravel(),
        ]

    end = 0.2
    exact = solve_ivp(rates, (0, end), [*start, *np.eye(3).ravel()], rtol=1e-11, atol=1e-12).y[
        :, -1
    ]
    q = exact[3:].reshape(3, 3)
    errors = []
    for dt in (8e-4, 4e-4):
        sim = gr.Simulation(scene_of(body, dt=dt), threads=1)
        begin = sim.bodies[0]
        sim.run(until=end, monitor=False)
        now = sim.bodies[0]
        errors.append(np.abs(now.rotation - q).max())
        turning = now.rotation @ inertia @ now.rotation.T @ now.angular_velocity
        assert turning == pytest.approx(inertia @ start, rel=1e-12)
        fall = 0.5 * -9.8 * end * (end + dt)  # of the symplectic Euler step
        assert now.position == pytest.approx(
            begin.position + np.array([0.1, 0, 0.4 + fall]), rel=1e-12
        )
        assert now.angular_velocity == pytest.approx(q @ exact[:3], abs=30 * errors[-1])
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.05)


@pytest.mark.parametrize("body", [BOX, BRICK], ids=["2D", "3D"])
def test_the_body_gains_what_the_nodes_lose(body):
    """Linear and angular momentum of each of many steps, the latter about the origin."""
    scene = scene_of(body, gravity=0.0, dt=5e-4)
    sim = gr.Simulation(scene, threads=1)
    sim.step(100)
    felt = sim.bodies[0].impulse
    for _ in range(20):
        stored = sim.checkpoint()
        alone = gr.Simulation.from_checkpoint(scene.replace(bodies=()), stored, threads=1)
        before = sim.bodies[0]
        for engine in (sim._engine, alone._engine):
            engine.p2g()
            engine.grid()
        nodes, without = sim._engine.nodes(), alone._engine.nodes()
        there = {tuple(x): v for x, v in zip(without["x"].round(6), without["v"], strict=True)}
        plain = np.array([there.get(tuple(x), np.zeros_like(x)) for x in nodes["x"].round(6)])
        given = nodes["mass"][:, None] * (nodes["v"] - plain)
        sim._engine.g2p()
        after = sim.bodies[0]
        x, j = (np.pad(part, ((0, 0), (0, 3 - body.dim))) for part in (nodes["x"], given))
        turned = np.cross(x, j).sum(axis=0)
        turned = turned[2] if body.dim == 2 else turned
        size = np.abs(given).sum()
        assert size > 0
        gained = body.mass * (after.velocity - before.velocity)
        assert gained == pytest.approx(-given.sum(axis=0), abs=1e-12 * body.mass)
        assert spin(body, after) - spin(body, before) == pytest.approx(
            -turned, abs=1e-12 * body.mass
        )
        sim = gr.Simulation.from_checkpoint(scene, stored, threads=1)
        sim.step(1)
    assert np.linalg.norm(felt) > 1


@pytest.mark.parametrize("body", [BOX, BRICK], ids=["2D", "3D"])
def test_same_bits_with_threads_and_after_a_restart(body):
    one = same_bits(scene_of(body), 80, 80)
    turned = one.bodies[0].angular_velocity - np.array(body.motion.angular_velocity[0])
    assert np.abs(turned).max() > 0.1


def test_light_body_is_stable():
    """A body of a hundredth of the density of the bed comes along with it."""
    body = BOX.__class__(
        Cylinder(0.1, center=(0.0, 0.0)),
        (0.3, 0.3),
        friction=0.5,
        free="xy",
        mass=0.5,
        inertia=0.0025,
        motion=Motion(velocity=((0.0, -1.0),)),
    )
    sim = gr.Simulation(scene_of(body, gravity=0.0), threads=1)
    sim.step(600)
    now = sim.bodies[0]
    assert np.linalg.norm(now.velocity) < 1.0
    assert abs(now.angular_velocity) < 10.0


def test_too_light_a_body_is_warned_of():
    """Below a tenth of the mass of a full cell, here of 0.05 m."""
    full = MuI(E=1e6).rho_c * 0.05**2
    for share, warns in ((0.11, False), (0.09, True)):
        body = Body(Cylinder(0.1, center=(0.0, 0.0)), (0.3, 0.4), free="xy", mass=share * full)
        found = [w for w in gr.scene_warnings(scene_of(body)) if "bodies[0].mass" in w]
        assert bool(found) == warns


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Body(Box(size=(1.0, 1.0)), (0.0, 0.0), inertia=0.0), "inertia = 0.0"),
        (
            lambda: Body(Box(size=(1.0,) * 3), (0.0,) * 3, inertia=(1.0, 1.0, 3.0)),
            "sum of the others",
        ),
        (lambda: Body(Box(size=(1.0,) * 3), (0.0,) * 3, inertia=1.0), "inertia = 1.0"),
        (
            lambda: Body(
                Box(size=(1.0,) * 3), (0.0,) * 3, inertia=((1, 2, 0), (0, 1, 0), (0, 0, 1))
            ),
            "symm",
        ),
        (lambda: Body(gr.shapes.HalfSpace((0.0, 1.0)), (0.0, 0.0), inertia=1.0), "endless"),
        (
            lambda: Body(Box(size=(1.0, 1.0)), (0.0, 0.0), restitution=0.5),
            "restitution = 0.5 must be 0",
        ),
        (
            lambda: Body(Box(size=(1.0, 1.0)), (0.0, 0.0), inertia=1.0, restitution=1.5),
            r"restitution = 1.5 must be in \[0.0, 1.0\]",
        ),
    ],
)
def test_bad_inertia_is_refused(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()
