"""Rows with which the core is told of shapes, walls and blocks, for the contact of free bodies."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.mpm.rigid_contact import FAR, contact_balls, obstacles

CELL = 0.05
B = gr.shapes


@pytest.mark.parametrize(
    ("shape", "corners"),
    [
        (B.Box(size=(0.3, 0.2)), [(x, y) for x in (-0.15, 0.15) for y in (-0.1, 0.1)]),
        (
            B.Box(size=(0.3, 0.2, 0.1), center=(0.1, 0.0, 0.0)),
            [(x, y, z) for x in (-0.05, 0.25) for y in (-0.1, 0.1) for z in (-0.05, 0.05)],
        ),
        (
            B.Polygon(((-0.1, -0.1), (0.2, -0.1), (0.0, 0.2))),
            [(-0.1, -0.1), (0.2, -0.1), (0.0, 0.2)],
        ),
        (B.Union((B.Box(size=(0.2, 0.1)), B.Cylinder(0.1, center=(0.1, 0.0)))), [(-0.1, 0.05)]),
    ],
    ids=["rectangle", "box", "triangle", "union"],
)
def test_places_of_a_surface(shape, corners):
    """On the surface, with all corners, and nowhere farther apart than half a cell."""
    balls = contact_balls(shape, CELL)
    places, dim = balls[:, : shape.dim], shape.dim
    assert not balls[:, 3].any()
    assert abs(shape.distance(places)[0]).max() < 1e-6 * CELL
    for corner in corners:
        assert np.linalg.norm(places - corner, axis=1).min() < 1e-9
    if dim == 2:
        near = np.linalg.norm(places[:, None] - places[None], axis=2)
        np.fill_diagonal(near, math.inf)
        assert near.min(axis=1).max() < 0.6 * CELL


@pytest.mark.parametrize(
    ("shape", "balls"),
    [
        (B.Sphere(0.1, center=(0.01, 0.0, 0.0)), [[0.01, 0.0, 0.0, 0.1]]),
        (B.Cylinder(0.1, center=(0.02, 0.0)), [[0.02, 0.0, 0.0, 0.1]]),
        (B.HalfSpace((0.0, 1.0)), np.zeros((0, 4))),
        (
            B.Capsule(0.1, 0.05, center=(0.0, 0.0), axis=(1.0, 0.0)),
            [[-0.025, 0, 0, 0.1], [0, 0, 0, 0.1], [0.025, 0, 0, 0.1]],
        ),
    ],
    ids=["ball", "disc", "half-space", "rod"],
)
def test_balls_of_what_is_round(shape, balls):
    assert contact_balls(shape, CELL) == pytest.approx(np.array(balls), abs=1e-15)


@pytest.mark.parametrize("far", [(8.0, 8.0), (8.0, -8.0, 8.0)])
def test_places_do_not_depend_on_the_origin_of_a_shape(far):
    """A box that was far from the position of its body had one place in 3D, of 488."""
    size = (0.2, 0.1, 0.2)[: len(far)]
    near, moved = (
        contact_balls(B.Box(size=size, center=at), CELL) for at in ((0.0,) * len(far), far)
    )
    gaps = np.linalg.norm(moved[None, :, : len(far)] - far - near[:, None, : len(far)], axis=2)
    assert (
        len(moved) == len(near) and max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < CELL / 3
    )


def test_rows_of_walls_and_blocks():
    """Beyond the ends of the domain they go on; a wall within it has an axis."""
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), CELL, (20, 20)),
        fills=[gr.Fill(gr.Box((0.8, 0.8), (1.0, 1.0)), 4)],
        walls=[
            gr.Wall(1, 0.0),
            gr.Wall(0, 0.5, kind="coulomb", friction=0.3, span=((0.2, 1.0),), opens_at=2.0),
            gr.Solid((0.0, 0.0), (0.2, 0.3), kind="free_slip"),
        ],
    )
    floor, gate, block = obstacles(scene)
    assert (floor[0], floor[1], floor[3], floor[4]) == (-FAR, -FAR, FAR, 0.0)
    assert (floor[9], floor[10], floor[11]) == (FAR, FAR, -1)
    assert (gate[0], gate[1], gate[3], gate[4]) == (0.5, 0.2, 0.5, FAR)
    assert (gate[9], gate[10], gate[11]) == (0.3, 2.0, 0)
    assert (block[0], block[1], block[3], block[4]) == (-FAR, -FAR, 0.2, 0.3)
    assert (block[9], block[10], block[11]) == (0.0, FAR, -1)
