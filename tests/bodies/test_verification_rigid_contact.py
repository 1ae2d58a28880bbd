"""Free bodies that touch walls, blocks and other bodies, against mechanics of rigid bodies."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Fill, Grid, Motion, MuI, Solid, Wall
from granular.mpm.bodies import mass_properties
from granular.shapes import Box, Cylinder, HalfSpace, Sphere

CELL = 0.05
G = 9.81


def scene_of(*bodies, walls=(), gravity=G, dt=None, **grid):
    """A domain of edge 1.6 m without material: what it has flies out of the top at once."""
    dim = bodies[0].dim
    high = 32 * CELL
    return scene_with(
        grid=Grid((0.0,) * dim, CELL, (32,) * dim, open_sides={"xyz"[dim - 1] + "+"}, **grid),
        fills=(
            Fill(
                Box((high - CELL,) * dim, (high,) * dim),
                2**dim,
                velocity=(*(0.0,) * (dim - 1), 20.0),
            ),
        ),
        material=MuI(E=1e5),
        scheme=gr.Scheme(dt=dt),
        gravity=gravity,
        walls=walls,
        bodies=bodies,
        duration=2.0,
    )


def body_of(shape, at, *, density=1000.0, velocity=None, turning=None, **more):
    """A body that moves and turns freely."""
    dim, whole = shape.dim, mass_properties(shape, density)
    motion = Motion(
        velocity=((0.0,) * dim if velocity is None else velocity,),
        angular_velocity=((0.0 if dim == 2 else (0.0,) * 3) if turning is None else turning,),
    )
    options = {"free": "xyz"[:dim], "mass": whole.mass, "inertia": whole.inertia} | more
    return Body(shape, at, motion=motion, **options)


def disc(radius, at, **more):
    return body_of(Cylinder(radius, center=(0.0, 0.0)), at, **more)


def ball(radius, at, **more):
    return body_of(Sphere(radius, center=(0.0,) * 3), at, **more)


def energy(scene, states):
    """Kinetic energy and that of height of all free bodies."""
    total = 0.0
    for body, now in zip(scene.bodies, states, strict=True):
        if body.mass is None:
            continue
        w = np.atleast_1d(now.angular_velocity)
        inertia = np.atleast_2d(body.inertia)
        tensor = now.rotation @ inertia @ now.rotation.T if body.dim == 3 else inertia
        total += 0.5 * body.mass * now.velocity @ now.velocity + 0.5 * w @ tensor @ w
        total -= body.mass * np.array(scene.gravity.vectors[0]) @ now.position
    return float(total)


def momenta(scene, states):
    """Momentum and angular momentum about the origin of all free bodies."""
    p, spin = np.zeros(3), np.zeros(3)
    for body, now in zip(scene.bodies, states, strict=True):
        x, v = (np.pad(part, (0, 3 - body.dim)) for part in (now.position, now.velocity))
        w = np.array([0, 0, now.angular_velocity]) if body.dim == 2 else now.angular_velocity
        inertia = np.diag([0, 0, body.inertia]) if body.dim == 2 else np.array(body.inertia)
        turn = np.eye(3)
        turn[: body.dim, : body.dim] = now.rotation
        p += body.mass * v
        spin += body.mass * np.cross(x, v) + turn @ inertia @ turn.T @ w
    return p, spin


FLOOR = {
    "wall": lambda dim: {"walls": (Wall(dim - 1, 0.0),)},
    "inner wall": lambda dim: {"walls": (Wall(dim - 1, 0.2),)},
    "Solid": lambda dim: {"walls": (Solid((0.0,) * dim, (*(1.6,) * (dim - 1), 0.2)),)},
    "body": lambda dim: {
        "other": (Body(HalfSpace((*(0.0,) * (dim - 1), 1.0)), (*(0.8,) * (dim - 1), 0.2)),)
    },
}


@pytest.mark.parametrize(
    ("floor", "dim", "e"),
    [
        *((floor, 2, 0.6) for floor in FLOOR),
        *((floor, 2, e) for floor in ("wall", "body") for e in (0.0, 1.0)),
        ("wall", 3, 0.6),
        ("Solid", 3, 0.6),
        ("body", 3, 0.6),
    ],
)
def test_a_ball_rebounds_to_the_square_of_its_restitution(floor, dim, e):
    """The apex after n bounces is e^2n of the first, up to the distance of a step."""
    level = 0.0 if floor == "wall" else 0.2
    given = FLOOR[floor](dim)
    make = disc if dim == 2 else ball
    falling = make(0.1, (*(0.8,) * (dim - 1), level + 0.5), restitution=e)
    scene = scene_of(falling, *given.get("other", ()), walls=given.get("walls", ()), dt=4e-4)
    sim = gr.Simulation(scene, threads=1)
    fall = math.sqrt(2 * 0.4 / G)
    apex, start = 0.0, fall
    for bounce in (1, 2):
        half = e**bounce * fall  # from the impact to the apex
        sim.run(until=start + half, monitor=False)
        apex = sim.bodies[0].position[-1] - 0.1 - level
        assert apex == pytest.approx(0.4 * e ** (2 * bounce), abs=2 * 4e-4 * G * fall)
        start += 2 * half
    assert abs(sim.bodies[0].velocity[:-1]).max() < 1e-12


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("mu", [0.3, 0.9])
def test_a_block_slides_down_an_oblique_body(dim, mu):
    """By g (sin - mu cos), or not at all."""
    slope = math.radians(30.0)
    normal = (-math.sin(slope), *(0.0,) * (dim - 2), math.cos(slope))
    along = np.array([-math.cos(slope), *(0.0,) * (dim - 2), -math.sin(slope)])
    ramp = Body(HalfSpace(normal), (0.8,) * dim, friction=mu)
    half = 0.1
    block = body_of(
        Box(size=(0.3, *(0.2,) * (dim - 1))),
        tuple(np.array((0.8,) * dim) + half * np.array(normal)),
        rotation_deg=30.0 if dim == 2 else (0.0, -30.0, 0.0),
        friction=1.0,
    )
    sim = gr.Simulation(scene_of(block, ramp, dt=5e-4), threads=1)
    sim.run(until=0.15, monitor=False)
    pull = max(G * (math.sin(slope) - mu * math.cos(slope)), 0.0)
    now = sim.bodies[0]
    assert now.velocity @ along == pytest.approx(pull * sim.time, rel=1e-6, abs=1e-9)
    assert now.velocity @ np.array(normal) == pytest.approx(0.0, abs=1e-8)
    assert np.abs(now.angular_velocity).max() < 1e-7


@pytest.mark.parametrize("dim", [2, 3])
def test_a_ball_rolls_down_an_oblique_body(dim):
    """By 5/7 g sin, a disc by 2/3 of it; without enough friction it slips."""
    slope = math.radians(20.0)
    normal = np.array([-math.sin(slope), *(0.0,) * (dim - 2), math.cos(slope)])
    along = np.array([-math.cos(slope), *(0.0,) * (dim - 2), -math.sin(slope)])
    share = 1 / 2 if dim == 2 else 2 / 5
    for mu in (0.5, 0.05):
        make = disc if dim == 2 else ball
        inertia = share * 10.0 * 0.01
        rolling = make(
            0.1,
            tuple(0.8 + 0.1 * normal),
            friction=mu,
            mass=10.0,
            inertia=inertia if dim == 2 else (inertia,) * 3,
        )
        ramp = Body(HalfSpace(tuple(normal)), (0.8,) * dim, friction=1.0)
        sim = gr.Simulation(scene_of(rolling, ramp, dt=5e-4), threads=1)
        sim.run(until=0.2, monitor=False)
        now = sim.bodies[0]
        rolls = mu > math.tan(slope) * share / (1 + share)
        pull = G * math.sin(slope) / (1 + share)
        if not rolls:
            pull = G * (math.sin(slope) - mu * math.cos(slope))
        assert now.velocity @ along == pytest.approx(pull * sim.time, rel=1e-6)
        turning = np.linalg.norm(now.angular_velocity)
        spun = pull if rolls else mu * G * math.cos(slope) / share
        assert turning == pytest.approx(spun * sim.time / 0.1, rel=1e-6)


PAIRS = {
    "discs": (
        disc(0.1, (0.5, 0.8), velocity=(2.0, 0.3), turning=5.0, friction=0.4, restitution=0.5),
        disc(0.15, (0.9, 0.85), velocity=(-1.0, 0.0), friction=0.3, restitution=0.8),
    ),
    "boxes": (
        body_of(Box(size=(0.3, 0.1)), (0.5, 0.8), velocity=(2.0, 0.3), turning=4.0, friction=0.4),
        body_of(
            Box(size=(0.2, 0.2)), (0.9, 0.85), rotation_deg=30.0, velocity=(-1.0, 0.0), friction=0.3
        ),
    ),
    "bricks": (
        body_of(
            Box(size=(0.3, 0.2, 0.1)),
            (0.5, 0.8, 0.8),
            velocity=(2.0, 0.1, 0.3),
            turning=(1.0, 4.0, 2.0),
            friction=0.4,
            restitution=0.7,
        ),
        body_of(
            Sphere(0.15, center=(0.0,) * 3),
            (0.9, 0.85, 0.8),
            velocity=(-1.0, 0.0, 0.0),
            friction=0.3,
            restitution=0.7,
        ),
    ),
    "through a periodic end": (
        disc(0.1, (0.2, 0.8), velocity=(-2.0, 0.0), turning=5.0, friction=0.4),
        disc(0.15, (1.35, 0.85), velocity=(1.0, 0.0), friction=0.3),
    ),
}


@pytest.mark.parametrize("pair", PAIRS)
def test_pairs_keep_momentum_and_do_not_gain_energy(pair):
    bodies = PAIRS[pair]
    grid = {"periodic": (True, False)} if "periodic" in pair else {}
    scene = scene_of(*bodies, gravity=0.0, dt=4e-4, **grid)
    sim = gr.Simulation(scene, threads=1)
    before, start = energy(scene, sim.bodies), momenta(scene, sim.bodies)
    last = before
    for _ in range(30):
        sim.step(25)
        now = energy(scene, sim.bodies)
        assert now <= last * (1 + 1e-9)
        last = now
    assert last < 0.95 * before
    end = momenta(scene, sim.bodies)
    assert end[0] == pytest.approx(start[0], abs=1e-12 * np.abs(start[0]).max())
    if "periodic" not in pair:
        assert end[1] == pytest.approx(start[1], abs=1e-12 * np.abs(start[1]).max())


def test_a_head_on_impact_of_balls():
    """Velocities after it by momentum and restitution, of different masses."""
    first = ball(0.1, (0.5, 0.8, 0.8), velocity=(2.0, 0.0, 0.0), restitution=0.6)
    second = ball(0.15, (0.9, 0.8, 0.8), restitution=0.9)
    m, n = first.mass, second.mass
    sim = gr.Simulation(scene_of(first, second, gravity=0.0, dt=4e-4), threads=1)
    sim.run(until=0.2, monitor=False)
    common = m * 2.0 / (m + n)
    assert sim.bodies[0].velocity[0] == pytest.approx(common - 0.6 * n * 2.0 / (m + n), rel=1e-9)
    assert sim.bodies[1].velocity[0] == pytest.approx(common + 0.6 * m * 2.0 / (m + n), rel=1e-9)


@pytest.mark.parametrize("mu", [0.05, 0.5])
def test_an_oblique_bounce(mu):
    """A ball that grips reverses its sliding velocity e times; one that slides loses (1 + e) mu."""
    e, speed = 0.6, 2.0
    bouncing = disc(0.1, (0.5, 0.3), velocity=(1.0, -speed), friction=mu, restitution=e)
    scene = scene_of(bouncing, walls=(Wall(1, 0.0),), gravity=0.0, dt=4e-4)
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.15, monitor=False)
    now = sim.bodies[0]
    lost = min((1 + e) * mu * speed, (1 + e) / 3)  # 1/3: the mass of a disc at its rim
    assert now.velocity == pytest.approx((1.0 - lost, e * speed), rel=1e-12)
    assert now.angular_velocity == pytest.approx(-2 * lost / 0.1, rel=1e-12)


def test_a_body_that_moves_pushes_and_drags():
    """A piston gives a disc 1 + e times its speed; a belt that moves carries a block along."""
    piston = Body(Box(size=(0.2, 0.4)), (0.2, 0.8), motion=Motion(velocity=((0.5, 0.0),)))
    pushed = disc(0.1, (0.5, 0.8), restitution=0.4)
    sim = gr.Simulation(scene_of(pushed, piston, gravity=0.0, dt=4e-4), threads=1)
    sim.run(until=0.3, monitor=False)
    assert sim.bodies[0].velocity[0] == pytest.approx(1.4 * 0.5, rel=1e-12)
    block = body_of(Box(size=(0.3, 0.2)), (0.4, 0.1), friction=0.3)
    belt = (Wall(1, 0.0, velocity=(0.6, 0.0)),)
    sim = gr.Simulation(scene_of(block, walls=belt, dt=4e-4), threads=1)
    sim.run(until=0.1, monitor=False)
    assert sim.bodies[0].velocity[0] == pytest.approx(0.3 * G * sim.time, rel=1e-6)
    sim.run(until=0.5, monitor=False)
    assert sim.bodies[0].velocity == pytest.approx((0.6, 0.0), abs=1e-9)


def test_a_tower_stands():
    """Five blocks on each other, with friction, do not sink into each other or creep."""
    blocks = [
        body_of(Box(size=(0.2, 0.1)), (0.8, 0.05 + 0.1 * k), friction=0.5, restitution=0.3)
        for k in range(5)
    ]
    sim = gr.Simulation(scene_of(*blocks, walls=(Wall(1, 0.0),), dt=4e-4), threads=1)
    sim.run(until=0.3, monitor=False)
    for k, state in enumerate(sim.bodies):
        assert state.position == pytest.approx((0.8, 0.05 + 0.1 * k), abs=1e-5)


def test_an_edge_that_strikes_turns_the_block():
    """A block lands on the edge of a step without friction: the impulse by the effective mass.

    The end of the block is above the step, too, but lifts off.
    """
    block = body_of(Box(size=(0.4, 0.1)), (0.8, 0.5), velocity=(0.0, -1.0))
    step = Body(Box(size=(0.4, 0.4)), (1.1, 0.2))  # its edge is at x = 0.9
    sim = gr.Simulation(scene_of(block, step, gravity=0.0, dt=4e-4), threads=1)
    sim.run(until=0.0504, monitor=False)
    now, lever = sim.bodies[0], 0.1
    impulse = 1.0 / (1 / block.mass + lever**2 / block.inertia)
    assert now.velocity[1] == pytest.approx(-1.0 + impulse / block.mass, rel=1e-3)
    assert now.angular_velocity == pytest.approx(lever * impulse / block.inertia, rel=1e-3)


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_a_tumbling_block_comes_to_rest_without_gaining_energy(e):
    """It falls on a corner, on a floor of two blocks that lie flush, and ends flat."""
    block = body_of(
        Box(size=(0.3, 0.2)),
        (0.8, 0.7),
        rotation_deg=40.0,
        turning=-2.0,
        friction=0.5,
        restitution=e,
    )
    floor = (Solid((0.0, 0.0), (0.8, 0.2)), Solid((0.8, 0.0), (1.6, 0.2)))
    floor = (*floor, Wall(0, 0.0), Wall(0, 1.6))
    scene = scene_of(block, walls=floor, dt=4e-4)
    sim = gr.Simulation(scene, threads=1)
    last = energy(scene, sim.bodies)
    start = last
    for _ in range(80):
        sim.step(50)
        now = energy(scene, sim.bodies)
        fall = block.mass * G * 4e-4 * max(abs(sim.bodies[0].velocity[1]), 2.0)
        assert now <= last + fall  # the energy of symplectic steps swings by g dt v
        last = now
    rest = sim.bodies[0]
    assert np.linalg.norm(rest.velocity) < 1e-6
    assert abs(rest.angular_velocity) < 1e-6
    height = rest.position[1] - 0.2
    assert min(abs(height - 0.1), abs(height - 0.15)) < 1e-4
    assert last < 0.5 * start


def test_a_brick_comes_to_rest_on_a_face():
    """It is thrown on the floor of a box, turning about all axes."""
    edges = (0.3, 0.2, 0.12)
    brick = body_of(
        Box(size=edges),
        (0.8, 0.8, 0.6),
        rotation_deg=(30.0, 20.0, 10.0),
        velocity=(0.3, 0.2, 0.0),
        turning=(3.0, -5.0, 2.0),
        friction=0.5,
        restitution=0.5,
    )
    sides = tuple(Wall(axis, x) for axis in (0, 1) for x in (0.0, 1.6))
    sim = gr.Simulation(scene_of(brick, walls=(Wall(2, 0.0), *sides), dt=4e-4), threads=1)
    sim.run(until=1.6, monitor=False)
    rest = sim.bodies[0]
    assert np.abs(rest.velocity).max() < 1e-8
    assert np.abs(rest.angular_velocity).max() < 1e-7
    assert min(abs(rest.position[2] - edge / 2) for edge in edges) < 1e-6


def test_a_disc_in_a_drum_stays_in_it():
    """The overlap of a step is of the order of dt^2, and is undone again."""
    rolling = disc(0.1, (0.8, 0.35), velocity=(2.0, 0.0), friction=0.3)
    drum = Body(Cylinder(0.6, center=(0.0, 0.0), inside=True), (0.8, 0.8), friction=0.3)
    inside = Fill(Box((0.75, 1.2), (0.8, 1.25)), 4)
    sim = gr.Simulation(scene_of(rolling, drum, dt=4e-4).replace(fills=(inside,)), threads=1)
    for _ in range(40):
        sim.step(25)
        beyond = np.linalg.norm(sim.bodies[0].position - 0.8) - 0.5
        assert beyond < 50 * (2.0 * 4e-4) ** 2 / (2 * 0.5)


def test_a_block_slides_over_blocks_that_lie_flush():
    """No face is felt where two of them meet."""
    block = body_of(Box(size=(0.3, 0.2)), (0.4, 0.3), velocity=(1.0, 0.0))
    floor = tuple(Solid((0.2 * k, 0.0), (0.2 * k + 0.2, 0.2)) for k in range(8))
    sim = gr.Simulation(scene_of(block, walls=floor, dt=4e-4), threads=1)
    sim.run(until=0.8, monitor=False)
    assert sim.bodies[0].velocity == pytest.approx((1.0, 0.0), abs=1e-9)
