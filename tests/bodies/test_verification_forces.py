"""Forces of the material on bodies: weight, momentum, torque."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Box, Cylinder, Difference, Fill, Grid, Motion, Sphere, Wall

G = 9.8


def bed(*bodies, height=0.4, holes=(), walls=True, gravity=-G, transfer="apic"):
    """A bed 1 m wide in cells of 5 cm."""
    region = Box((0.0, 0.0), (1.0, height))
    for hole in holes:
        region = Difference(region, hole)
    sides = (Wall(1, 0.0, kind="no_slip"), Wall(0, 0.0, kind="free_slip"))
    sides += (Wall(0, 1.0, kind="free_slip"),)
    return scene_with(
        grid=Grid((0.0, 0.0), 0.05, (20, 16)),
        fills=(Fill(region, 4),),
        scheme=gr.Scheme(basis="quadratic", transfer=transfer, density=gr.ParticleDensity()),
        walls=sides if walls else (),
        bodies=bodies,
        gravity=-gravity,
        duration=2.0,
    )


def test_box_at_rest_weighs_what_it_weighs():
    """Mean force over 1.6 s, in which the box bounces; before it sinks by less than a cell."""
    mass = 100.0
    box = Body(Box(size=(0.3, 0.2)), (0.5, 0.52), friction=0.3, free="y", mass=mass)
    sim = gr.Simulation(bed(box), threads=1)
    sim.run(until=0.4, monitor=False)
    begin, felt = sim.time, sim.bodies[0]
    assert 0.47 < felt.position[1] < 0.52
    sim.run(until=2.0, monitor=False)
    force = (sim.bodies[0].impulse - felt.impulse) / (sim.time - begin)
    assert force[1] == pytest.approx(mass * G, rel=0.005)
    assert abs(force[0]) < 0.005 * mass * G  # 0 by symmetry, but for the order of the sweeps
    moved = mass * (sim.bodies[0].velocity - felt.velocity) / (sim.time - begin)
    assert force[1] == pytest.approx(mass * G + moved[1], rel=1e-9)


def _momentum(sim):
    state = sim.state
    return state.mass @ state.v


@pytest.mark.parametrize("transfer", ["flip", "apic", "tpic", "xpic"])
def test_momentum_of_material_and_bodies_is_kept(transfer):
    """Without walls and gravity, the bodies gain the momentum that the material loses."""
    bodies = (
        Body(
            Box(size=(0.2, 0.1), rotation_deg=30.0), (0.2, 0.35), free="xy", mass=5.0, friction=0.4
        ),
        Body(
            Cylinder(0.1, center=(0.02, 0.0)),
            (0.6, 0.35),
            motion=Motion(velocity=((-1.0, -0.5),), angular_velocity=(6.0,)),
            contact="sticky",
        ),
    )
    scene = bed(*bodies, walls=False, gravity=0.0, transfer=transfer)
    grid = Grid((-0.5, -0.5), 0.05, (40, 36))
    sim = gr.Simulation(scene.replace(grid=grid), threads=1)
    before = _momentum(sim)
    sim.run(until=0.1, monitor=False)
    impulse = sum(body.impulse for body in sim.bodies)
    assert np.linalg.norm(impulse) > 1
    assert np.allclose(_momentum(sim) - before, -impulse, rtol=0, atol=1e-10)


def _pushed_box(transfer):
    box = Body(
        Box(size=(0.3, 0.2)), (0.5, 0.43), motion=Motion(velocity=((0.3, -0.2),)), friction=0.3
    )
    scene = bed(box, transfer=transfer)
    return scene.replace(scheme=scene.scheme.replace(dt=5e-4))


def _driven_blade(transfer):
    """A scene in 3D; points do not shift, which would give them the velocity of their new place."""
    scheme = gr.scenes.excavation().scheme.replace(transfer=transfer, dt=1e-3)
    size = {"cell": 0.05, "length": 0.6, "width": 0.4, "start": 0.2, "travel": 0.1}
    return gr.scenes.excavation(**size, settle=0.02, ramp=0.01, scheme=scheme)


@pytest.mark.parametrize(
    ("made", "transfer", "begin"),
    [(_pushed_box, "apic", 1), (_driven_blade, "apic", 1500), (_driven_blade, "tpic", 1500)],
)
def test_momentum_with_walls_and_gravity(made, transfer, begin):
    """In each step change = weight - forces on the body and on the walls, to round-off."""
    scene = made(transfer)
    sim = gr.Simulation(scene, threads=1, wall_forces=True)
    sim.step(begin)
    felt = 0.0
    for _ in range(40):
        before, impulse = _momentum(sim), sim.bodies[0].impulse
        walls = sum(wall.impulse for wall in sim.walls)
        weight = sim.state.mass.sum() * scene.gravity.at(sim.time) * scene.scheme.dt
        sim.step(1)
        impulse = sim.bodies[0].impulse - impulse
        walls = sum(wall.impulse for wall in sim.walls) - walls
        felt += np.linalg.norm(impulse)
        assert np.allclose(_momentum(sim) - before, weight - impulse - walls, rtol=0, atol=1e-10)
    assert felt > 0


def _sheared(contact, divided):
    """A cylinder that rotates in a bed with finer cells than the other beds."""
    motion = Motion(angular_velocity=(2.0,))
    cylinder = Body(Cylinder(0.12, center=(0.0, 0.0)), (0.5, 0.2), motion=motion, contact=contact)
    grid = Grid((0.0, 0.0), 0.05 / divided, (20 * divided, 16 * divided))
    scene = bed(cylinder, holes=(Sphere(0.12, center=(0.5, 0.2)),)).replace(grid=grid)
    return gr.Simulation(scene, threads=1)


def _ring_torque(state):
    """Torque of the shear stress over the ring 0.12 m to 0.19 m about the axis of the cylinder."""
    x = state.x - [0.5, 0.2]
    r = np.hypot(*x.T)
    ring = (r > 0.12) & (r < 0.19)
    c, s = x[ring, 0] / r[ring], x[ring, 1] / r[ring]
    xx, yy, _, xy = state.stress[ring].T
    shear = (yy - xx) * c * s + xy * (c**2 - s**2)
    volume = state.volume[ring]
    return 2 * np.pi * (volume @ (r[ring] ** 2 * shear)) / volume.sum()


def test_turning_cylinder_is_held_back():
    """The torque on the cylinder is the reaction to that of the shear stress in the ring about it.

    The material in between takes up some angular momentum while it starts to rotate.
    """
    sim = _sheared("sticky", 2)
    sim.run(until=0.2, monitor=False)
    begin, felt, stresses = sim.time, sim.bodies[0].angular_impulse, []
    while sim.time < 0.4:
        sim.run(until=sim.time + 0.01, monitor=False)
        stresses.append(_ring_torque(sim.state))
    torque = (sim.bodies[0].angular_impulse - felt) / (sim.time - begin)
    assert torque < 0
    assert torque == pytest.approx(np.mean(stresses), rel=0.1)


def test_smooth_cylinder_turns_freely():
    sim = _sheared("bilateral", 1)
    sim.run(until=0.2, monitor=False)
    assert abs(sim.bodies[0].angular_impulse) < 1e-10 * np.abs(sim.bodies[0].impulse).max()
