"""Bodies, inflows, material at rest and tractions on ranks have the bits of one process."""

from dataclasses import replace

import numpy as np
import pytest
from same_bits import bits

import granular as gr
from granular import shapes
from granular.mpm import engine as core
from granular.ranks.part import Part, Plan, bare
from granular.run.machine import Machine

GRAINS = gr.materials.glass_beads.replace(E=1e6)


def bed(*bodies, **numbers):
    """A bed 0.6 m wide that hardly moves, with bodies."""
    defaults = {
        "grid": gr.Grid((0.0, 0.0), 0.02, (30, 20)),
        "fills": (gr.Fill(gr.Box((0.0, 0.0), (0.6, 0.2)), 4, lithostatic=True),),
        "material": GRAINS,
        "walls": (gr.Wall(0, 0.0), gr.Wall(0, 0.6), gr.Wall(1, 0.0)),
        "gravity": (0.0, -9.81),
        "duration": 1.0,
    }
    return gr.Scene(name="bed", bodies=bodies, **(defaults | numbers))


def blocks():
    """Blocks that slide, fall and turn, and a plate that moves material."""
    box = shapes.Box(size=(0.08, 0.05))
    free = {"free": "xy", "mass": 8.0, "friction": 0.3}
    turning = gr.Motion(velocity=(-0.6, 0.0), angular_velocity=3.0)
    plate = gr.Body(shapes.Box(size=(0.16, 0.016)), (0.45, 0.2), motion=turning, contact="sticky")
    return bed(
        gr.Body(box, (0.2, 0.25), motion=gr.Motion(velocity=(0.5, -0.8)), inertia=0.01, **free),
        gr.Body(box, (0.3, 0.35), motion=gr.Motion(velocity=(0.0, -1)), restitution=0.5, **free),
        plate,
        scheme=gr.Scheme(transfer="apic", density=gr.ParticleDensity()),
    )


def calm():
    """A bed that falls asleep, and a ball that wakes a part of it."""
    ball = gr.Body(
        shapes.Cylinder(0.03, center=(0.0, 0.0)), (0.3, 0.5), free="y", mass=10.0, friction=0.2
    )
    grid = gr.Grid((0.0, 0.0), 0.02, (30, 30))
    return bed(ball, grid=grid, scheme=gr.Scheme(sleep_speed=0.03))


def tray():
    """A stream that fills a tray up to the inlet, where points wait and are missed."""
    stream = gr.Inflow(gr.Box((0.1, 0.16), (0.3, 0.2)), (0.0, -1.0), 4)
    pile = (gr.Fill(gr.Box((0.0, 0.0), (0.4, 0.06)), 4),)
    grid = gr.Grid((0.0, 0.0), 0.02, (20, 14))
    return bed(grid=grid, fills=pile, inflows=(stream,), walls=(gr.Wall(1, 0.0),))


BODIES = {
    "free and driven": (blocks, 200),
    "thin, rough, nonlocal": (lambda: gr.scenes.excavation(cell=0.025), 60),
    "space": (lambda: gr.scenes.sphere_drop(cell=0.008), 60),
    "averaged": (lambda: gr.scenes.wheel(scheme=gr.schemes.cell_averaged), 60),
    "asleep": (calm, 1600),
    "inflow": (tray, 700),
    "driven inflow": (lambda: gr.scenes.chute_fed(cell=0.02), 200),
}


@pytest.mark.parametrize("name", BODIES)
def test_bodies_inflows_sleep_and_tractions_through_a_restart(name, scattered):
    """Half of the steps by five ranks, whose blocks change their owners, the rest by three."""
    make, steps = BODIES[name]
    scene, part = make(), steps // 4
    alone = gr.Simulation(scene, tractions=True)
    alone.step(steps)
    if name == "asleep":
        assert 0.1 < (alone.state.v == 0).all(axis=1).mean() < 0.9
    if name == "inflow":
        assert alone.inflows[0].missed > 0
    with scattered(5), gr.ranks.threads(5) as comm:
        sim = gr.Simulation(scene, comm=comm, tractions=True)
        sim.step(part)
        with scattered(6):
            sim.balance(1.0)
        sim.step(part)
        point = sim.checkpoint()
    with scattered(7), gr.ranks.threads(3) as comm:
        sim = gr.Simulation.from_checkpoint(scene, point, comm=comm)
        sim.step(steps - 2 * part)
        assert bits(sim) == bits(alone)
        assert [flow.points for flow in sim.inflows] == [flow.points for flow in alone.inflows]
        for one, other in zip(sim.bodies, alone.bodies, strict=True):
            assert np.array_equal(one.impulse, other.impulse)


def test_bodies_driven_from_outside(scattered):
    def drive(sim):
        sim.step(20)
        sim.set_motion(2, velocity=(-1.0, 0.2), angular_velocity=-2.0)
        sim.step(20)
        load = sim.apply_load(0, force=(20.0, -30.0), torque=1.0)
        sim.step(20)
        return load.force.tolist(), sim.body_load(0).force.tolist(), bits(sim)

    alone = drive(gr.Simulation(blocks()))
    with scattered(3), gr.ranks.threads(4) as comm:
        assert drive(gr.Simulation(blocks(), comm=comm)) == alone


class Garbled:
    """Rank 0 of two, where the other one sends numbers without sense about contact points."""

    rank, size = 0, 2

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)

    def exchange(self, messages):
        for _, _, into in messages:
            numbers = self.rng.integers(-2, 40, len(into) // 8)
            into[: 8 * len(numbers)] = numbers.astype(np.int64).tobytes()

    def reduce(self, array, of):
        if of is np.add and len(array) == 7:  # an error; then contact points, nodes and bytes
            array[4:] = self.rng.integers(-1, (30, 30, 20000))


@pytest.mark.parametrize("seed", range(8))
def test_garbled_contact_points_end_in_an_error(seed):
    scene = blocks()
    points = core.initial_points(scene)
    arrays = {name: np.ascontiguousarray(np.atleast_2d(a.T)) for name, a in points.items()}
    arrays["id"] = np.arange(arrays["x"].shape[1])
    plan = Plan(scene, 1.0, Machine(threads=1), False, False)
    owners = np.zeros(int(np.prod(bare(plan)._engine.blocks(8))), np.int32)
    part = Part(Garbled(seed), replace(plan, edge=8, owners=owners))
    part.take(arrays)
    part.begin()
    with pytest.raises(RuntimeError, match="does not answer"):
        part.advance(500, 1.0)
