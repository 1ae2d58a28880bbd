"""Flows on bodies of all shapes: nothing leaks, forces are those of what they carry, same bits."""

import math

import numpy as np
import pytest
from same_bits import same_bits
from scenes_by_hand import scene_with

import granular as gr
from granular import Body
from granular.shapes import (
    Box,
    Capsule,
    Complement,
    Cylinder,
    Difference,
    Frustum,
    HalfSpace,
    Offset,
    Polygon,
    Revolve,
    Shell,
    Sphere,
    Torus,
    Union,
)


def scene_of(name, cell, shape, fill, *bodies):
    dim = len(shape)
    return scene_with(
        name=name,
        grid=gr.Grid((0.0,) * dim, cell, shape),
        fills=(gr.Fill(fill, 2**dim, lithostatic=False),),
        material=gr.MuI(E=2e5),
        walls=(gr.Wall(dim - 1, 0.0),),
        bodies=bodies,
        seed=1,
    )


def hopper():
    cone = Frustum((0.02, 0.05), 0.05, center=(0.06, 0.06, 0.045), axis=(0, 0, 1), thickness=0.02)
    fill = Cylinder(0.03, center=(0.06, 0.06, 0.08), axis=(0.0, 0.0, 1.0), length=0.05)
    return scene_of("hopper", 0.01, (12, 12, 12), fill, Body(cone, (0.0,) * 3, friction=0.3))


def floor():
    """A polygon with a step and a notch, and a rod that turns above it."""
    steps = [
        (0.0, -0.2),
        (0.6, -0.2),
        (0.6, 0.1),
        (0.45, 0.1),
        (0.4, 0.02),
        (0.25, 0.02),
        (0.0, 0.2),
    ]
    rod = Capsule(0.04, 0.1, center=(0.0, 0.0), axis=(1.0, 0.5))
    turning = gr.Motion(angular_velocity=(2.0,))
    bodies = (
        Body(Polygon(steps), (0.0, 0.0), friction=0.4),
        Body(rod, (0.3, 0.18), motion=turning, contact="sticky"),
    )
    return scene_of("floor", 0.02, (50, 20), Sphere(0.07, center=(0.3, 0.31)), *bodies)


@pytest.mark.parametrize(("make", "steps"), [(hopper, 260), (floor, 320)])
def test_threads_and_restart(make, steps):
    sim = same_bits(scene := make(), steps // 2 - 3, steps - steps // 2 + 3, threads=(2,))
    assert all(np.abs(body.impulse).max() > 0 for body in sim.bodies)
    assert scene.bodies[0].distance(sim.state.x)[0].min() > -0.2 * scene.grid.cell


def test_a_hopper_is_symmetric_and_carries_its_load():
    """It empties through the orifice only, and pushes neither to the left nor to the right."""
    scene = hopper()
    sim = gr.Simulation(scene, threads=1).run(until=0.12, monitor=False)
    x = sim.state.x - (0.06, 0.06, 0.0)
    below = x[:, 2] < 0.02
    assert 0.005 < below.mean() < 0.8
    assert np.hypot(*x[below, :2].T).max() < 0.03
    impulse = sim.bodies[0].impulse
    assert np.abs(impulse[:2]).max() < 0.02 * abs(impulse[2])
    weight = 9.8 * sim.state.mass.sum()
    assert 0.2 * weight * 0.12 < -impulse[2] < weight * 0.12


SLOPE = math.radians(15.0)
TANGENT, NORMAL = (math.cos(SLOPE), math.sin(SLOPE)), (-math.sin(SLOPE), math.cos(SLOPE))
PLANE = HalfSpace(NORMAL)
FLOORS = {
    "polygon": Polygon([(0, 0), (-0.2, 0), (-2, 0), (-2, -2), (2, -2), (2, 0)], rotation_deg=15.0),
    "slab": Box(size=(4.0, 2.0), center=(-NORMAL[0], -NORMAL[1]), rotation_deg=15.0),
    "boxes": Union(
        tuple(
            Box(size=(2.0, 2.0), center=tuple(s * np.array(TANGENT) - NORMAL), rotation_deg=15.0)
            for s in (-0.9, 0.9)
        )
    ),
    "with_a_pit": Difference(PLANE, Cylinder(0.3, center=(3.0, 0.0))),
    "offset": Offset(HalfSpace(NORMAL, tuple(-0.1 * np.array(NORMAL))), by=0.1),
    "shell": Shell(Complement(PLANE), thickness=1.0),
}


@pytest.mark.parametrize("floor", FLOORS.values(), ids=FLOORS)
def test_a_slope_is_the_same_however_it_is_described(floor):
    """A pile slides down a plane; edges within a face, and those far away, take no part.

    Round-off can decide how many sweeps the contact needs: places agree to a thousandth of a cell.
    """
    sims = []
    for shape in (PLANE, floor):
        scene = scene_of(
            "slope", 0.02, (40, 30), Sphere(0.08, center=(0.45, 0.31)), Body(shape, (0.4, 0.2))
        )
        sims.append(gr.Simulation(scene, threads=1))
        sims[-1].step(260)
    one, other = (sim.state for sim in sims)
    assert abs(sims[0].bodies[0].impulse[1]) > 1
    assert np.allclose(other.x, one.x, rtol=0, atol=1e-3 * 0.02)
    assert np.allclose(sims[1].bodies[0].impulse, sims[0].bodies[0].impulse, rtol=1e-3)


BLOCK = Box(size=(0.08, 0.08, 0.08))
ROUND = {"center": (0.0,) * 3, "axis": (0.0, 0.3, 1.0)}


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.06, center=(0.0,) * 3),
        Torus(0.05, 0.03, **ROUND),
        Revolve([(0.0, -0.03), (0.07, 0.0), (0.05, 0.05)], thickness=0.04, **ROUND),
        Difference(Box(size=(0.16, 0.16, 0.08)), Sphere(0.05, center=(0.0, 0.0, 0.04))),
        Shell(
            Union((BLOCK, Capsule(0.03, 0.08, center=(0.0,) * 3, axis=(1, 0, 0)))), thickness=0.03
        ),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_a_body_is_heavier_by_what_falls_on_it(shape):
    """The impulse on a body at rest and that of gravity make the momentum of the points."""
    fill = Cylinder(0.05, center=(0.12, 0.12, 0.23), axis=(0.0, 0.0, 1.0), length=0.06)
    scene = scene_of("rain", 0.02, (12, 12, 14), fill, Body(shape, (0.12, 0.12, 0.12)))
    # the corrections of the other densities are forces without a reaction
    scene = scene.replace(scheme=gr.Scheme(density=gr.ParticleDensity()))
    sim = gr.Simulation(scene, threads=1).run(until=0.12, monitor=False)
    state = sim.state
    momentum = (state.mass[:, None] * state.v).sum(axis=0)
    fallen = np.array([0.0, 0.0, -9.8]) * state.mass.sum() * sim.time
    impulse = sim.bodies[0].impulse
    assert impulse[2] < 0.02 * fallen[2]
    assert np.allclose(momentum + impulse, fallen, rtol=0, atol=1e-12)
    assert scene.bodies[0].distance(state.x)[0].min() > -0.004
