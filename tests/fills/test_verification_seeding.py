"""Beds at rest on planes at any angle: force, pressure beside the plane, creep."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Box, HalfSpace

G, RHO, CELL = 9.81, 1500.0, 0.01
LENGTH, HEIGHT = 0.2, 0.1


def bed(turned_deg, offset):
    """A bed between three planes, all turned with gravity against the grid; origin, along, up."""
    a = math.radians(turned_deg)
    along, up = np.array([math.cos(a), math.sin(a)]), np.array([-math.sin(a), math.cos(a)])
    origin = np.array([0.22, 0.08]) - 0.5 * LENGTH * along + offset * CELL * (along + up)
    corners = [origin + x * along + y * up for x in (0, LENGTH) for y in (0, HEIGHT)]
    sides = [
        gr.Body(
            Box(size=(0.04, 0.2)), tuple(origin + x * along + 0.1 * up), rotation_deg=turned_deg
        )
        for x in (-0.02, LENGTH + 0.02)
    ]
    base = gr.Body(HalfSpace(tuple(up)), tuple(origin), friction=0.5)
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), CELL, (44, 34)),
        fills=(
            gr.Fill(gr.Polygon([corners[i] for i in (0, 2, 3, 1)]), 4, lithostatic=True, K0=1.0),
        ),
        material=gr.materials.glass_beads.replace(E=1e6, rho_c=RHO),
        gravity=-G * up,
        duration=3.0,
        bodies=(base, *sides),
    )
    return scene, origin, along, up


@pytest.mark.parametrize(
    ("turned_deg", "offset"), [(0.0, 0.25), (17.0, 0.0), (17.0, 0.5), (40.0, 0.0), (40.0, 0.25)]
)
def test_bed_at_rest_on_a_plane(turned_deg, offset):
    """Mean pressure of the first half cell, force on the plane, and motion until 0.25 s."""
    scene, origin, along, up = bed(turned_deg, offset)
    points = scene.points()
    assert points.volume.sum() == pytest.approx(LENGTH * HEIGHT, rel=1e-3)
    assert ((points.x - origin) @ up).min() >= 0.04 * CELL / 2
    sim = gr.Simulation(scene, threads=1)
    start = sim.state
    sim.run(until=0.15, monitor=False)
    time, before = sim.time, sim.bodies[0].impulse
    sim.run(until=0.25, monitor=False)
    state = sim.state
    force = -(sim.bodies[0].impulse - before) @ up / (sim.time - time)
    assert force == pytest.approx(state.mass.sum() * G, rel=2e-3)
    x, y = (state.x - origin) @ along, (state.x - origin) @ up
    middle = (x > 0.25 * LENGTH) & (x < 0.75 * LENGTH)
    first = middle & (y < CELL / 2)
    share = state.pressure / (RHO * G * (HEIGHT - y))
    assert np.average(share[first], weights=state.mass[first]) == pytest.approx(1, abs=0.05)
    top = middle & (y > HEIGHT - CELL)
    assert abs(((state.x - start.x) @ up)[top].mean()) < 1e-3 * CELL


@pytest.mark.parametrize("dim", [2, 3])
def test_volume_about_a_ball_converges(dim):
    """The open volume errs by the curvature over an eighth of a square: second order."""
    errors = []
    for cells in (10, 20, 40)[: 5 - dim]:
        cell, radius = 1.0 / cells, 0.23
        center = (0.513, 0.492, 0.471)[:dim]
        shape = {
            2: gr.shapes.Cylinder(radius, center=(0.0, 0.0)),
            3: gr.shapes.Cylinder(radius, center=(0.0,) * 3, axis=(0.2, 1.0, 0.4), length=0.5),
        }[dim]
        scene = scene_with(
            grid=gr.Grid((0.0,) * dim, cell, (cells,) * dim),
            fills=(gr.Fill(gr.Box((0.0,) * dim, (1.0,) * dim), 2**dim),),
            gravity=G,
            bodies=(gr.Body(shape, center),),
        )
        solid = math.pi * radius**2 * (1.0 if dim == 2 else 0.5)
        errors.append(abs(scene.points().volume.sum() - 1 + solid) / solid)
    assert errors[0] < 2e-4
    assert errors[0] / errors[-1] > 3.5 ** (len(errors) - 1)


def carried_pressure(stagger, speed=0.1, cells=4):
    """Pressure of the first row of a bed that a box carries up through the grid, over its weight.

    One value for each eighth of a cell that is crossed.
    """
    low, width, height = 2 * CELL, 12 * CELL, 10 * CELL
    motion = gr.Motion(velocity=((0.0, speed),))
    faces = (((0.0, 1.0), 0.5), ((1.0, 0.0), 0.0), ((-1.0, 0.0), 0.0))
    corners = ((low, low), (low, low), (low + width, low))
    region = gr.Box((low, low), (low + width, low + height))
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), CELL, (16, 20)),
        fills=(
            gr.Fill(region, 4, velocity=(0.0, speed), stagger=stagger, lithostatic=True, K0=1.0),
        ),
        material=gr.materials.glass_beads.replace(E=1e6, rho_c=RHO),
        gravity=G,
        bodies=tuple(
            gr.Body(HalfSpace(normal), at, motion=motion, friction=friction)
            for (normal, friction), at in zip(faces, corners, strict=True)
        ),
    )
    sim = gr.Simulation(scene, threads=1)
    above = sim.state.x[:, 1] - low
    first = above < CELL / 2
    found = []
    for eighth in range(1, 8 * cells + 1):
        sim.run(until=eighth * CELL / speed / 8, monitor=False)
        found.append(sim.state.pressure[first].mean() / (RHO * G * (height - above[first])).mean())
    return np.array(found[8:])


def test_staggered_columns_cross_lines_of_nodes_one_after_the_other():
    """The points of a row along the grid cross a line at once, and their pressure jumps by it."""
    assert np.ptp(carried_pressure(False)) > 0.3
    staggered = carried_pressure(True)
    assert np.ptp(staggered) < 0.15
    assert staggered.mean() == pytest.approx(1, abs=0.08)
