"""Rigid bodies against a plain reference: distance, motion, contact at nodes, refused input."""

import math

import numpy as np
import oracle_bodies
import pytest
from scenes_by_hand import scene_with
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import granular as gr
from granular import Body, Elastic, Fill, Grid, Motion, Wall, _core
from granular.shapes import Box, Cylinder, HalfSpace, Union
from granular.shapes.measures import extents

CELL, DT = 0.04, 4e-4  # all parts are at least three cells thick

PLANE = {
    "box": Box(size=(0.21, 0.13), center=(0.02, -0.01), rotation_deg=20.0),
    "disc": Cylinder(0.12, center=(0.01, 0.02)),
    "drum": Cylinder(0.22, center=(0.0, 0.0), inside=True),
    "half": HalfSpace((0.3, 1.0), (0.0, -0.05)),
    "bucket": Union((Box(size=(0.3, 0.12)), Box(size=(0.12, 0.3), center=(0.15, 0.1)))),
}
SPACE = {
    "box": Box(size=(0.25, 0.19, 0.3), center=(0.02, -0.01, 0.03), rotation_deg=(20.0, 10.0, 5.0)),
    "roller": Cylinder(0.14, center=(0.01, 0.02, 0.0), axis=(0.2, 1.0, 0.1), length=0.3),
    "drum": Cylinder(0.2, center=(0.0,) * 3, axis=(0.0, 1.0, 0.0), length=0.3, inside=True),
    "half": HalfSpace((0.3, -0.2, 1.0), (0.0, 0.0, -0.05)),
}
SHAPES = [pytest.param(s, id=f"{s.dim}d-{name}") for f in (PLANE, SPACE) for name, s in f.items()]
CONTACTS = ["sticky", "separating", "bilateral"]
each_shape_and_contact = pytest.mark.parametrize(
    ("shape", "contact"),
    [pytest.param(*shape.values, "separating", id=shape.id) for shape in SHAPES]
    + [(shape, kind) for shape in (PLANE["disc"], SPACE["box"]) for kind in CONTACTS[::2]],
)


def scene_of(*bodies, dim=2, gravity=-9.8, transfer="flip"):
    """A block of material in a box, with bodies."""
    shape = (15, 8, 13) if dim == 3 else (15, 13)
    upper = tuple(CELL * n for n in shape)
    walls = [Wall(dim - 1, 0.0, kind="no_slip"), Wall(0, 0.0, kind="free_slip")]
    return scene_with(
        grid=Grid((0.0,) * dim, CELL, shape),
        fills=(Fill(Box((0.0,) * dim, (*upper[:-1], 0.4)), 2**dim, jitter=1.0),),
        scheme=gr.Scheme(basis="quadratic", transfer=transfer, density=gr.ParticleDensity(), dt=DT),
        walls=tuple(walls),
        bodies=bodies,
        gravity=-gravity,
        seed=3,
    )


def grid_of(scene):
    """Simulation and nodes after the grid stage of its first step, and the nodes without bodies.

    Velocities of the points are random.
    """
    sim = gr.Simulation(scene, threads=1)
    held = sim.buffers["mass"][0] > 0
    size = (scene.grid.dim, held.sum())
    sim.buffers["v"][:, held] = np.random.default_rng(5).normal(scale=10.0, size=size)
    stored = sim.checkpoint()
    del stored.arrays["bodies"]
    free = gr.Simulation.from_checkpoint(scene.replace(bodies=()), stored, threads=1)
    for engine in (sim._engine, free._engine):
        engine.p2g()
        engine.grid()
    return sim, sim._engine.nodes(), free._engine.nodes()


# ---- distance ----


@pytest.mark.parametrize("shape", SHAPES)
def test_distance_and_normal(shape):
    body = Body(shape, (0.3, 0.2, 0.1)[: shape.dim], rotation_deg=0.0)
    x = np.random.default_rng(1).uniform(-0.4, 0.4, (60, shape.dim))
    found, normal = body.distance(x + body.position)
    places = np.pad(x, ((0, 0), (0, 3 - shape.dim)))
    wanted = [oracle_bodies.distance(shape, place) for place in places]
    assert np.allclose(found, wanted, rtol=0, atol=1e-14)
    smooth = [oracle_bodies.gradient(shape, place)[: shape.dim] for place in places]
    assert np.allclose(normal, smooth, rtol=0, atol=1e-4)
    assert np.allclose(np.linalg.norm(normal, axis=1), 1, rtol=0, atol=1e-14)


def test_distance_turns_with_the_body():
    body = Body(Box(size=(0.2, 0.1)), (1.0, 2.0), rotation_deg=90.0)
    distance, normal = body.distance(np.array([[1.0, 2.2], [1.2, 2.0], [1.0, 2.0]]))
    assert np.allclose(distance, [0.1, 0.15, -0.05], rtol=0, atol=1e-15)
    assert np.allclose(normal[:2], [[0, 1], [1, 0]], rtol=0, atol=1e-15)


# ---- contact at the feet of the points ----

SLACK = 0.1
"""Error of velocities over that which contact makes; the sweeps end at changes of a hundredth."""


def moving(shape, contact, **options):
    """A body with a velocity and a rotation amid the material."""
    dim = shape.dim
    turning = (1.5,) if dim == 2 else ((0.4, -1.5, 0.3),)
    motion = Motion(velocity=((0.3, -0.4, 0.2)[:dim],), angular_velocity=turning)
    place = (0.33, 0.21, 0.22) if dim == 3 else (0.33, 0.24)
    turned = 15.0 if dim == 2 else (15.0, 5.0, -10.0)
    friction = 0.0 if contact == "sticky" else 0.4
    meets = {"motion": motion, "contact": contact, "friction": friction}
    return Body(shape, place, rotation_deg=turned, **meets, **options)


def feet_of(sim, nodes, body):
    """Feet of the points on the only body, which moves with its prescribed mean velocity."""
    omega = np.zeros(3)
    omega[2 if body.dim == 2 else slice(None)] = body.motion.angular_velocity[0]
    velocity = np.pad(body.motion.velocity[0], (0, 3 - body.dim))
    now = oracle_bodies.at_its_place(body, sim.bodies[0])
    return oracle_bodies.Feet(sim, nodes, now, velocity, omega)


@each_shape_and_contact
def test_reaction_is_what_the_nodes_receive(shape, contact):
    """Impulse and angular impulse of the body, those of the nodes, and the forces at the feet."""
    body = moving(shape, contact)
    scene = scene_of(body, dim=shape.dim).replace(walls=())
    sim, nodes, free = grid_of(scene)
    feet = feet_of(sim, nodes, body)
    assert np.abs(nodes["v"] - free["v"]).max() > 0.1
    assert np.allclose(nodes["w"] - free["w"], nodes["v"] - free["v"], rtol=0, atol=1e-13)
    given = (nodes["mass"][:, None] * (nodes["v"] - free["v"])).sum(axis=0)
    force = feet.force.sum(axis=0)[: shape.dim]
    size = DT * np.abs(feet.force).sum()
    assert np.allclose(given, DT * force, rtol=0, atol=1e-12 * size)
    torque = np.cross(feet.x - np.pad(body.position, (0, 3 - shape.dim)), feet.force).sum(axis=0)
    sim._engine.g2p()
    state = sim.bodies[0]
    assert np.allclose(state.impulse, -given, rtol=0, atol=1e-12 * size)
    torque = torque[2] if shape.dim == 2 else torque
    own_place = np.isnan(feet.slip[:, 0])  # points with little mass about their feet
    slack = DT * np.linalg.norm(feet.force[own_place] * feet.distance[own_place, None])
    atol = 1e-12 * size + slack
    assert np.allclose(state.angular_impulse, -DT * torque, rtol=0, atol=atol)


@each_shape_and_contact
def test_conditions_of_contact_hold_at_the_feet(shape, contact):
    """In a flow about a moving body, to the tolerance of the sweeps."""
    body = moving(shape, contact)
    sim = gr.Simulation(scene_of(body, dim=shape.dim), threads=1)
    sim.step(30)
    before = oracle_bodies.at_its_place(body, sim.bodies[0])
    sim._engine.p2g()
    sim._engine.grid()
    feet = feet_of(sim, sim._engine.nodes(), body)
    assert before.position == pytest.approx(sim.bodies[0].position)
    spacing = 0.5 * (feet.mass / sim.scene.material.rho_c) ** (1 / shape.dim)
    seen = np.isfinite(feet.slip[:, 0]) & (feet.distance > -0.5 * CELL) & feet.flat
    near = seen & (feet.distance < spacing)
    along = np.einsum("nd,nd->n", feet.slip, feet.normal)
    push = DT * np.abs(feet.force).max() / feet.mass.mean()  # velocity that contact makes
    assert near.any()
    tangential = np.linalg.norm(feet.force - feet.pressing[:, None] * feet.normal, axis=1)
    if contact == "sticky":
        assert np.abs(feet.slip[near]).max() < SLACK * push
        return
    assert np.all(tangential[seen] <= 0.4 * abs(feet.pressing[seen]) * (1 + 1e-9))
    if contact == "bilateral":
        assert np.abs(along[near]).max() < SLACK * push
        return
    assert np.all(feet.pressing[seen] >= 0)
    least = np.minimum((spacing - feet.distance) / DT, 0)
    assert np.all(along[seen] > least[seen] - SLACK * push)
    pressed = near & (feet.pressing > 0)
    assert pressed.any()
    assert np.abs(along[pressed]).max() < SLACK * push
    sliding = feet.slip - along[:, None] * feet.normal
    fast = pressed & (np.linalg.norm(sliding, axis=1) > SLACK * push)
    assert np.allclose(tangential[fast], 0.4 * feet.pressing[fast], rtol=1e-6)


@pytest.mark.parametrize("mass", [1.0, 1e5])
@pytest.mark.parametrize("contact", ["sticky", "separating"])
def test_free_body_takes_up_the_impulse(contact, mass):
    """Free bodies with a hundredth of the mass of the nodes they touch, and heavy ones."""
    motion = Motion(velocity=((0.2, -0.5),))
    body = Body(
        Box(size=(0.31, 0.25)), (0.31, 0.27), motion=motion, contact=contact, free="y", mass=mass
    )
    sim = gr.Simulation(scene_of(body), threads=1)
    sim.step(30)
    before = sim.bodies[0]
    sim._engine.p2g()
    sim._engine.grid()
    now = oracle_bodies.at_its_place(body, before)
    feet = oracle_bodies.Feet(sim, sim._engine.nodes(), now, np.zeros(3), np.zeros(3))
    sim._engine.g2p()
    after = sim.bodies[0]
    gained = mass * (after.velocity[1] - before.velocity[1] + 9.8 * DT)
    assert gained == pytest.approx(after.impulse[1] - before.impulse[1], rel=1e-9)
    slip = feet.slip - [0.2, after.velocity[1], 0.0]
    spacing = 0.5 * np.sqrt(feet.mass / sim.scene.material.rho_c)
    near = np.isfinite(slip[:, 0]) & feet.flat & (abs(feet.distance) < spacing)
    push = DT * np.abs(feet.force).max() / feet.mass.mean()
    assert near.any()
    along = np.einsum("nd,nd->n", slip, feet.normal)[near]
    if contact == "sticky":
        assert np.abs(slip[near]).max() < SLACK * push
    else:
        assert along.min() > -SLACK * push


# ---- motion ----


def test_scripted_motion_is_exact():
    """After steps that divide the table anywhere, the displacement is the integral of velocity."""
    motion = Motion(
        times=(0.0105, 0.02, 0.0333),
        velocity=((1.0, 0.0), (-2.0, 1.0), (0.5, 3.0)),
        angular_velocity=(0.0, 40.0, -10.0),
    )
    sim = gr.Simulation(scene_of(Body(Cylinder(0.05, center=(0, 0)), (0.3, 3.0), motion=motion)))
    sim.step(round(0.05 / DT))
    fine = np.unique([*np.linspace(0, sim.time, 5), *motion.times])
    path = [np.interp(fine, motion.times, v) for v in zip(*motion.velocity, strict=True)]
    moved = np.trapezoid(path, fine, axis=1)
    moved -= sim.bodies[0].position
    assert np.allclose(moved, [-0.3, -3.0], rtol=0, atol=1e-14)
    angle = np.trapezoid(np.interp(fine, motion.times, motion.angular_velocity), fine)
    axes = [[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]
    assert np.allclose(sim.bodies[0].rotation, axes, rtol=0, atol=1e-13)
    assert sim.bodies[0].velocity.tolist() == [0.5, 3.0]
    assert sim.bodies[0].angular_velocity == -10.0


def test_turning_in_3d_about_an_oblique_axis():
    omega = np.array([3.0, -4.0, 12.0])
    motion = Motion(velocity=((0.0, 0.0, 0.0),), angular_velocity=(tuple(omega),))
    shape = Box(size=(0.02, 0.03, 0.04))
    sim = gr.Simulation(scene_of(Body(shape, (0.3, 0.1, 5.0), motion=motion), dim=3), threads=1)
    sim.step(100)
    wanted = oracle_bodies._turn(np.degrees(omega * sim.time)).as_matrix()
    assert np.allclose(sim.bodies[0].rotation, wanted, rtol=0, atol=1e-12)


def test_free_fall_and_empty_space():
    """A body that touches nothing feels no force and falls with g."""
    falling = Body(Box(size=(0.1, 0.1)), (0.3, 9.0), free="y", mass=2.0)
    passing = Body(HalfSpace((0.0, 1.0)), (0.0, -3.0), motion=Motion(velocity=((1.0, 0.0),)))
    sim = gr.Simulation(scene_of(falling, passing), threads=1)
    before = sim.state
    sim.step(20)
    for state in sim.bodies:
        assert not state.impulse.any()
        assert not state.angular_impulse
    assert sim.bodies[0].velocity[1] == pytest.approx(-9.8 * sim.time, rel=1e-14)
    assert sim.bodies[0].velocity[0] == 0
    height = 9.0 - 9.8 * sim.time * (sim.time + DT) / 2
    assert sim.bodies[0].position[1] == pytest.approx(height, rel=1e-14)
    alone = gr.Simulation(scene_of(), threads=1)
    alone.step(20)
    assert np.array_equal(sim.state.x, alone.state.x)
    assert not np.array_equal(before.x, alone.state.x)


@pytest.mark.parametrize("contact", ["sticky", "bilateral"])
def test_work_of_a_piston_is_the_energy_of_what_it_presses(contact):
    """An elastic block against a wall, pressed by 1 % in 20 crossing times of its waves."""
    material = Elastic(E=1e5, nu=0.0)
    end = 20 * 0.5 / material.wave_speed
    motion = Motion(
        times=(0.0, 0.5 * end, end), velocity=((0.0, 0.0), (-0.01 / end, 0.0), (0.0, 0.0))
    )
    piston = Body(Box(size=(0.4, 2.0)), (0.7, 0.1), motion=motion, contact=contact)
    scene = scene_with(
        grid=Grid((0.0, 0.0), 0.05, (20, 4)),
        fills=(Fill(Box((0.0, 0.0), (0.5, 0.2)), 4),),
        material=material,
        walls=(Wall(0, 0.0, kind="free_slip"), Wall(1, 0.0, kind="free_slip")),
        scheme=gr.Scheme(basis="linear", transfer="flip", density=gr.ParticleDensity()),
        gravity=0.0,
        duration=end,
        bodies=(piston,),
    )
    sim = gr.Simulation(scene, threads=1).run(monitor=False)
    held = gr.measure.energy(sim.state)
    # The piston takes a tenth of the last of ten cells, whose two rows of points stay: their stress
    # is a tenth too low, and the energy 2 %.
    assert held.elastic == pytest.approx(1e5 * 0.01**2 / 2 * 0.1, rel=0.03)
    assert sim.bodies[0].work == pytest.approx(held.elastic + held.kinetic, rel=1e-3)


# ---- scenes, records ----


def test_scene_round_trip():
    bodies = (
        Body(PLANE["bucket"], (0.1, 0.2), contact="sticky", rotation_deg=3.0),
        Body(PLANE["drum"], (0.1, 0.2), friction=0.3, free="xy", mass=2.0),
        Body(PLANE["half"], (0.1, 0.2), motion=Motion(velocity=((1.0, 2.0),))),
        Body(PLANE["disc"], (0.1, 0.2), contact="bilateral"),
    )
    scene = scene_of(*bodies)
    assert gr.Scene.from_json(scene.to_json()) == scene
    space = scene_of(*(Body(shape, (0.1,) * 3) for shape in SPACE.values()), dim=3)
    assert gr.Scene.from_json(space.to_json()) == space


def test_record_tells_of_bodies(tmp_path):
    motion = Motion(angular_velocity=(2.0,))
    still = Body(Box(size=(0.2, 0.1)), (0.3, 0.25))
    turning = Body(Cylinder(0.1, center=(0, 0)), (0.3, 0.1), motion=motion, contact="sticky")
    sim = gr.Simulation(scene_of(still, turning), threads=1)
    sim.run(until=0.05, save=tmp_path / "b.h5", every=0.01)
    with gr.open(tmp_path / "b.h5") as record:
        assert record.bodies.shape == (6, 2, 40)
        assert record.bodies[-1].tolist() == sim._engine.bodies().tolist()
        assert not any(name.startswith("body") for name in record.samples)
        for b in range(2):
            force = gr.measure.body_force(record, b)
            spans = np.diff(record.times)
            total = (force.force * spans[:, None]).sum(axis=0)
            assert np.allclose(total, sim.bodies[b].impulse, rtol=1e-12)
            torque = (force.torque * spans).sum()
            assert torque == pytest.approx(sim.bodies[b].angular_impulse, rel=1e-12)
            wide = gr.measure.body_force(record, b, window=5)
            assert np.allclose(wide.force[0] * record.times[-1], total, rtol=1e-12)
        with pytest.raises(ValueError, match=r"body = 2 must be .* 0 to 1"):
            gr.measure.body_force(record, 2)
        with pytest.raises(ValueError, match="window = 6 must be less than"):
            gr.measure.body_force(record, window=6)
    plain = gr.Simulation(scene_of(), threads=1)
    plain.run(until=0.01, save=tmp_path / "p.h5", every=0.01)
    with gr.open(tmp_path / "p.h5") as record, pytest.raises(ValueError, match="with bodies"):
        gr.measure.body_motion(record)


# ---- what is refused ----

BOX = Box(size=(1.0, 1.0))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Box(size=(1.0, 0.0)), r"size\[1\] = 0.0"),
        (lambda: Box(size=(1.0, 1.0), center=(0.0,)), "center"),
        (lambda: Box(size=(1.0, 1.0, 1.0), rotation_deg=3.0), "rotation_deg"),
        (lambda: Cylinder(0.0, center=(0.0, 0.0)), "radius = 0.0"),
        (lambda: Cylinder(1.0, center=(0.0, 0.0), length=2.0), "length = 2.0"),
        (lambda: Cylinder(1.0, center=(0.0,) * 3), "axis = None"),
        (lambda: Cylinder(1.0, center=(0.0,) * 3, axis=(0, 0, 0)), "axis"),
        (lambda: Cylinder(1.0, center=(0.0, 0.0), inside=1), "inside = 1"),
        (lambda: HalfSpace((0.0, 0.0)), "normal"),
        (lambda: Union(()), r"parts = \(\)"),
        (lambda: Union((BOX, Box(size=(1.0,) * 3))), r"parts\[1\]"),
        (lambda: Motion(times=(1.0, 1.0), velocity=((0, 0), (0, 0))), "ascend"),
        (lambda: Motion(velocity=((0, 0), (0, 0))), "must be one value for each of the times, 1"),
        (lambda: Motion(velocity=((0, math.nan),)), "velocity"),
        (lambda: Motion(), "one must be given"),
        (lambda: Motion(velocity=((0, 0, 0),), angular_velocity=(1.0,)), r"angular_velocity\[0\]"),
        (lambda: Body("box", (0.0, 0.0)), "shape = 'box'"),
        (lambda: Body(BOX, (0.0,) * 3), "position"),
        (lambda: Body(BOX, (0.0, 0.0), contact="glue"), "contact = 'glue'"),
        (lambda: Body(BOX, (0.0, 0.0), contact="sticky", friction=0.1), "friction = 0.1"),
        (lambda: Body(BOX, (0.0, 0.0), friction=-0.1), "friction = -0.1"),
        (lambda: Body(BOX, (0.0, 0.0), free="z", mass=1.0), "free = 'z'"),
        (lambda: Body(BOX, (0.0, 0.0), free="xx", mass=1.0), "free = 'xx'"),
        (lambda: Body(BOX, (0.0, 0.0), free="x"), "mass = None"),
        (lambda: Body(BOX, (0.0, 0.0), mass=1.0), "mass = 1.0"),
        (lambda: Body(BOX, (0.0, 0.0), free="x", mass=0.0), "mass = 0.0"),
        (lambda: Body(BOX, (0.0, 0.0), motion=Motion(velocity=((0,) * 3,))), "dimension"),
        (lambda: scene_of(Body(Box(size=(1.0,) * 3), (0.0,) * 3)), r"bodies\[0\]"),
        (lambda: scene_of(*[Body(BOX, (0.0, 0.0))] * 65), "at most 64"),
        (lambda: scene_of(BOX), r"bodies\[0\]"),
    ],
)
def test_bad_bodies_are_refused(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()


def test_core_refuses_bad_rows():
    scene = scene_of(Body(BOX, (0.3, 5.0)))
    sim = gr.Simulation(scene, threads=1)
    good = sim._engine.bodies()
    for bad in (good[:, :18], good.astype(np.float32), good * np.nan, np.zeros_like(good), None):
        with pytest.raises((TypeError, ValueError)):
            sim._engine.restore_bodies(bad)
    without = gr.Simulation(scene.replace(bodies=()), threads=1).checkpoint()
    with pytest.raises(ValueError, match="does not hold contact_force"):
        gr.Simulation.from_checkpoint(scene, without)
    rows = BOX.rows()
    columns, values = [0, 0, 0, 2, 5, 14, 14], [3.0, 4.0, -1.0, np.inf, np.nan, -1.0, np.nan]
    for column, value in zip(columns, values, strict=True):
        bad = rows.copy()
        bad[0, column] = value
        with pytest.raises(ValueError):
            _core.body_distance(bad, (), np.zeros((1, 3)))
    with pytest.raises(ValueError):
        _core.body_distance(np.tile(rows, (257, 1)), (), np.zeros((1, 3)))


@pytest.mark.parametrize("seed", range(8))
def test_extents_are_those_of_all_orientations_of_a_motion(seed):
    """Against the points of the surface, turned about one axis through all angles."""
    rng = np.random.default_rng(seed)
    center, turn = rng.uniform(-1, 1, 3), tuple(rng.uniform(-90, 90, 3))
    box = Box(size=tuple(rng.uniform(0.1, 2, 3)), center=tuple(center), rotation_deg=turn)
    rod = Cylinder(0.3, center=tuple(center), axis=tuple(rng.uniform(-1, 1, 3)), length=1.5)
    start = Rotation.from_rotvec(rng.uniform(-2, 2, 3))
    about = rng.uniform(-1, 1, 3) if seed % 2 else np.zeros(3)
    angles = np.linspace(0, 2 * np.pi, 721)[:, None]
    turns = Rotation.from_rotvec(angles * about / max(np.linalg.norm(about), 1e-9))
    for shape, slack in ((box, 1e-3), (rod, 0.35)):
        sides = np.stack(np.meshgrid(*[np.linspace(-1, 1, 41)] * 3), -1).reshape(-1, 3)
        row = shape.rows()[0]
        if shape is rod:
            sides = sides[np.hypot(sides[:, 0], sides[:, 1]) <= 1 + 1e-12]
            row[14:] = row[14], row[14], row[15]
        places = row[2:5] + (sides * row[14:]) @ row[5:14].reshape(3, 3).T
        swept = max_over_turns(start.apply(places), turns)
        found = extents(shape, start.as_matrix(), np.array([about, 2 * about]))
        assert (found >= swept - 1e-12).all()
        assert (found <= swept + (slack if about.any() else 1e-2)).all()


def max_over_turns(places, turns):
    """Largest absolute coordinates that places have in any of the turns, shape (3,)."""
    hull = places[np.unique(ConvexHull(places).vertices)]
    return np.max([abs(turn.apply(hull)).max(axis=0) for turn in turns], axis=0)


def test_infinite_extents_stay_along_their_axis():
    axle = Cylinder(0.1, center=(0, 0, 0), axis=(0, 1, 0))
    rest, about_y, about_z = np.zeros((1, 3)), np.eye(3)[[1]], np.eye(3)[[2]]
    assert extents(axle, np.eye(3), rest) == pytest.approx([0.1, np.inf, 0.1])
    assert extents(axle, np.eye(3), about_y) == pytest.approx([0.1, np.inf, 0.1])
    assert extents(axle, np.eye(3), about_z) == pytest.approx([np.inf, np.inf, 0.1])
    both = np.concatenate([about_y, about_z])
    assert np.isinf(extents(axle, np.eye(3), both)).all()
    assert extents(Box(size=(1.0, 2.0)), np.eye(3), rest)[:2] == pytest.approx([0.5, 1.0])
