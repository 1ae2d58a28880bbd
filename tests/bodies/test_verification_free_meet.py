"""Free bodies are held by walls, blocks and other bodies; runs end at the ends of the domain."""

import math
import re

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Fill, Grid, Motion, MuI, Solid, Wall
from granular.shapes import Box, Cylinder, Difference, HalfSpace, Sphere

CELL = 0.05


def scene_of(*bodies, dim=2, walls=(), **grid):
    """A thin layer far from the bodies, which move without gravity, in a domain of edge 1.6 m."""
    return scene_with(
        grid=Grid((0.0,) * dim, CELL, (32,) * dim, **grid),
        fills=(Fill(Box((0.0,) * dim, (*(0.2,) * (dim - 1), 0.1)), 2**dim),),
        material=MuI(E=1e5),
        gravity=0.0,
        walls=walls,
        bodies=bodies,
    )


def disc(*velocity, at=(0.8, 0.8), shape=None, **more):
    options = {"free": "xy", "mass": 1.0} | more
    return Body(
        Cylinder(0.2, center=(0.0, 0.0)) if shape is None else shape,
        at,
        motion=Motion(
            velocity=(velocity or (0.0, 0.0),), angular_velocity=(options.pop("turning", 0.0),)
        ),
        **options,
    )


def meets(scene):
    """Time at which the run ends by an error, its message, and where the bodies are then."""
    sim = gr.Simulation(scene, threads=1)
    with pytest.raises(gr.SimulationError) as caught:
        sim.run(monitor=False)
    assert caught.value.body == 0
    assert caught.value.step == sim.steps
    assert f"t = {sim.time:.9g}" in str(caught.value)
    return str(caught.value), sim


PLATE = Body(Box(size=(0.1, 0.8)), (1.35, 0.8))
BALL = Body(
    Sphere(0.2, center=(0.0,) * 3), (0.8,) * 3, motion=Motion(velocity=((0.0, 2.0, 0.0),)),
    free="xyz", mass=1.0, inertia=(0.016,) * 3,
)  # fmt: skip


@pytest.mark.parametrize(
    ("scene", "way"),
    [
        (scene_of(disc(2.0, 0.0), walls=(Wall(0, 1.6, kind="free_slip"),)), 0.6),
        (scene_of(BALL, dim=3, walls=(Wall(1, 1.6, kind="no_slip"),)), 0.6),
        (scene_of(disc(0.0, -2.0), walls=(Wall(1, 0.3, span=((0.6, 1.6),)),)), 0.3),
        (scene_of(disc(2.0, 0.0), walls=(Solid((1.3, 0.5), (1.35, 1.2)),)), 0.3),
        (scene_of(disc(2.0, 0.0), PLATE), 0.3),
        (scene_of(disc(2.0, 0.0), Body(HalfSpace((-1.0, 0.0)), (1.3, 0.0))), 0.3),
        (
            scene_of(
                disc(0.0, 2.0), Body(Box(size=(0.8, 0.2)), (0.8, 0.3)), periodic=(False, True)
            ),
            0.8,  # through the periodic end, to the lower side of the box at 0.2 m
        ),
        (
            scene_of(
                disc(2.0, 0.0), walls=(Solid((0.1, 0.5), (0.2, 1.2)),), periodic=(True, False)
            ),
            0.7,
        ),
    ],
    ids=["wall", "in 3D", "span", "Solid", "plate", "half-space", "image", "Solid through an end"],
)
def test_it_stops_where_it_touches(scene, way):
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.6, monitor=False)
    moved = sim.bodies[0].position - np.array(scene.bodies[0].position)
    assert np.linalg.norm(moved) == pytest.approx(way, abs=1e-9)
    assert np.abs(sim.bodies[0].velocity).max() < 1e-9


def test_prescribed_motions_that_press_it_end_the_run():
    piston = Body(Box(size=(0.2, 0.8)), (0.4, 0.8), motion=Motion(velocity=((1.0, 0.0),)))
    message, _ = meets(scene_of(disc(0.0, 0.0), piston, PLATE))
    assert re.search(r"bodies\[[12]\]", message) and "pressed together" in message


@pytest.mark.parametrize(
    ("scene", "what", "way"),
    [
        (scene_of(disc(2.0, 0.0)), "the end of the domain at x = 1.6 m", 0.6),
        (scene_of(disc(0.0, 2.0)), "the end of the domain at y = 1.6 m", 0.6),
    ],
    ids=["end", "top"],
)
def test_what_it_meets_is_named(scene, what, way):
    """Half a cell to one and a half after the contact, and the steps to the next look."""
    message, sim = meets(scene)
    assert message.startswith("bodies[0] has met ")
    assert re.search(what, message), message
    speed = np.linalg.norm(scene.bodies[0].motion.velocity[0])
    late = speed * sim.time - way
    assert 0.4 * CELL < late < 1.6 * CELL + 50 * sim.dt * speed


def test_a_body_that_turns_meets_the_wall_with_its_corner():
    rod = disc(0.0, 0.0, shape=Box(size=(1.0, 0.2)), at=(0.8, 0.3), inertia=0.1, turning=2.0)
    message, sim = meets(scene_of(rod))
    assert "the end of the domain at y = 0 m" in message
    angle = 2.0 * sim.time
    lowest = 0.3 - 0.5 * np.sin(angle) - 0.1 * np.cos(angle)
    assert -1.5 * CELL < lowest < -0.5 * CELL


WINDOW = Wall(0, 0.8, kind="free_slip", span=((0.0, 1.6),))


def endless(shape, *velocity):
    """A body without an end, which moves along itself or to where it is already."""
    return Body(shape, (0.8, 0.8), motion=Motion(velocity=(velocity,)), free="x", mass=1.0)


HOLE = Wall(1, 0.3, span=((0.0, 0.5),))
PASSING = {
    "open": scene_of(disc(2.0, 0.0), open_sides={"x+"}),
    "periodic": scene_of(disc(2.0, 0.0), periodic=(True, False)),
    "from above": scene_of(disc(0.0, -2.0, at=(0.8, 2.4)), periodic=(True, False)),
    "away": scene_of(disc(0.0, 2.0, at=(0.8, 2.4))),
    "led": scene_of(disc(2.0, 0.0, at=(1.0, 0.8), free="y")),
    "window": scene_of(disc(0.0, 0.8, free="y"), walls=(WINDOW,)),
    "past": scene_of(disc(2.0, 0.0), Body(Box(size=(0.1, 0.2)), (1.35, 0.3)), open_sides={"x+"}),
    "hole": scene_of(disc(0.0, -2.0), walls=(HOLE,), open_sides={"y-"}),
    "gate": scene_of(disc(0.0, -0.8), walls=(Wall(1, 0.5, opens_at=0.05),)),
    "endless": scene_of(endless(Box(size=(math.inf, 0.2)), 0.5, 0.0)),
    "retreating": scene_of(endless(HalfSpace((-1.0, 0.0)), 0.5, 0.0), walls=(Wall(0, 1.6),)),
}


@pytest.mark.parametrize("scene", PASSING.values(), ids=PASSING)
def test_what_it_may_pass(scene):
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.7, monitor=False)
    assert sim.time >= 0.7


def test_frames_before_it_are_kept(tmp_path):
    path = tmp_path / "run.h5"
    sim = gr.Simulation(scene_of(disc(2.0, 0.0)), threads=1)
    with pytest.raises(gr.SimulationError, match="has met the end"):
        sim.run(save=path, every=0.05)
    stored = gr.open(path)
    assert sim.time - 0.06 < stored[-1].time < sim.time


def test_steps_alone_are_watched_too():
    """However the steps are divided, bodies are checked at a multiple of 50 of them."""
    _, sim = meets(scene_of(disc(2.0, 0.0)))
    other = gr.Simulation(scene_of(disc(2.0, 0.0)), threads=1)
    with pytest.raises(gr.SimulationError, match="has met the end"):
        for _ in range(sim.steps + 1):
            other.step(7)
    assert other.steps % 50 == 0
    assert abs(other.steps - sim.steps) <= 50


STAIRS = tuple(Solid((0.0, k * CELL), (1.6 - k * CELL, (k + 1) * CELL)) for k in range(8))
SADDLE = Difference(Box(size=(0.6, 0.6)), Box(size=(0.1, 0.5), center=(0.0, -0.1)))
FLOOR, LID, INNER = Wall(1, 0.0), Wall(1, 1.6), Wall(1, 0.8, kind="free_slip")


def bricks(height):
    """Two blocks, one above the other."""
    shape = Box(size=(0.3, 0.4, 0.2))
    block = {"free": "xyz", "mass": 1.0, "inertia": (0.016,) * 3}
    return scene_of(*(Body(shape, (0.8, 0.8, z), **block) for z in (0.5, 0.5 + height)), dim=3)


@pytest.mark.parametrize(
    ("scene", "says"),
    [
        *(
            (scene_of(disc(at=(0.8, 0.1)), walls=(Wall(1, 0.0, kind=kind),)), r"0.1 m .*walls\[0\]")
            for kind in ("no_slip", "free_slip", "coulomb")
        ),
        (scene_of(disc(at=(0.8, -0.5)), walls=(FLOOR,)), r"0.7 m within walls\[0\]"),
        (scene_of(disc(at=(0.8, 2.1)), walls=(LID,)), r"0.7 m within walls\[0\]"),
        (scene_of(disc(), walls=(INNER,)), r"0.2 m within walls\[0\].* at \(0.8, 0.8\)"),
        (
            scene_of(disc(shape=Box(size=(0.11, 0.6))), walls=(Wall(1, 0.8, opens_at=1.0),)),
            r"0.3 m within walls\[0\]",
        ),
        (scene_of(disc(), walls=(Solid((0.6, 0.3), (1.0, 0.7)),)), r"within walls\[0\], a Solid"),
        (scene_of(disc(at=(0.8, 0.4)), walls=STAIRS), r"within walls\[\d\], a Solid"),
        (
            scene_of(
                disc(at=(0.8, 0.9), shape=Box(size=(0.6, 0.4))),
                walls=(FLOOR, Solid((0.75, 0.3), (0.85, 0.85))),
            ),
            r"within walls\[1\], a Solid",
        ),
        (scene_of(PLATE, disc(at=(1.2, 0.8))), r"bodies\[1\] begins 0.1 m within bodies\[0\]"),
        (scene_of(disc(), disc(at=(1.1, 0.8))), r"bodies\[0\] begins 0.1 m within bodies\[1\]"),
        (
            scene_of(disc(at=(0.1, 0.8)), disc(at=(1.5, 0.8)), periodic=(True, False)),
            r"0.2 m within bodies\[1\]",
        ),
        (scene_of(disc(at=(0.8, 0.9)), Body(HalfSpace((0.0, -1.0)), (0.8, 1.0))), r"bodies\[1\]"),
        (bricks(0.15), r"0.05 m within bodies\[1\]"),
    ],
)
def test_it_must_not_begin_within_what_holds_it(scene, says):
    with pytest.raises(ValueError, match=says):
        gr.Simulation(scene, threads=1)


@pytest.mark.parametrize(
    "scene",
    [
        scene_of(disc(at=(0.8, 0.2)), walls=(FLOOR,)),
        scene_of(disc(at=(0.8, 0.176)), walls=(FLOOR,)),  # less than half a cell
        scene_of(disc(at=(0.8, 1.0)), walls=(INNER,)),
        scene_of(disc(), walls=(Wall(1, 0.8, opens_at=0.0),)),
        scene_of(disc(), walls=(Wall(1, 0.8, span=((0.0, 0.5),)),)),
        scene_of(disc(shape=SADDLE), walls=(Wall(0, 0.8, span=((0.0, 0.9),)),)),
        scene_of(
            disc(at=(0.8, 0.1), free="x"), walls=(FLOOR,)
        ),  # a symmetry plane, for all it knows
        scene_of(disc(at=(0.8, 0.6)), walls=STAIRS),
        scene_of(disc(), disc(at=(1.2, 0.8))),
        scene_of(disc(), Body(Difference(Box(size=(1.0, 1.0)), Box(size=(0.4, 0.4))), (0.8, 0.8))),
        scene_of(
            Body(Box(size=(0.4, 0.1)), (0.8, 0.8), inertia=0.1),
            Body(Box(size=(0.1, 0.1)), (0.8, 0.8)),
        ),
        scene_of(
            Body(Box(size=(0.4, 0.4)), (0.8, 0.1)), walls=(FLOOR,)
        ),  # its motion is prescribed
        bricks(0.2),
    ],
)
def test_where_it_may_begin(scene):
    gr.Simulation(scene, threads=1).step(1)
