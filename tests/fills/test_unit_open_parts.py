"""Squares of the seeding lattice that bodies cut: parts of cubes, rows, edges, thin bodies."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Box, Cylinder, HalfSpace
from granular.model import seeding_lattice
from granular.model.open_parts import LEAST_SHARE, plane_cut
from granular.model.seeding import joined
from granular.mpm.body_distances import distance_from_bodies

CELL = 0.1
SPACING = CELL / 2


def scene_of(*bodies, dim=2, **fill):
    return scene_with(
        grid=gr.Grid((0.0,) * dim, CELL, (10,) * dim),
        fills=(gr.Fill(gr.Box((0.0,) * dim, (1.0,) * dim), 2**dim, **fill),),
        bodies=bodies,
    )


@pytest.mark.parametrize("dim", [2, 3])
def test_part_of_a_cube_above_a_plane(dim):
    """Against a sum over a fine grid, for oblique planes and those along axes."""
    n = 400 if dim == 2 else 80
    axis = (np.arange(n) + 0.5) / n - 0.5
    u = np.stack(np.meshgrid(*[axis] * dim), axis=-1).reshape(-1, dim)
    rng = np.random.default_rng(dim)
    normals = [*rng.normal(size=(5, dim)), np.eye(dim)[0], -np.eye(dim)[1]]
    for normal in normals:
        unit = normal / np.linalg.norm(normal)
        distance = rng.uniform(-0.4, 0.4)
        height = distance + u @ unit
        share, centre = plane_cut(np.array([0.2 * distance]), unit[None], 0.2)
        assert share[0] == pytest.approx((height > 0).mean(), abs=1.5 / n)
        assert centre[0] == pytest.approx(0.2 * height[height > 0].mean(), abs=0.4 / n)
    share, centre = plane_cut(np.array([-1.0, 1.0]), np.tile(unit, (2, 1)), 1.0)
    assert share == pytest.approx([0.0, 1.0], abs=1e-9)
    assert centre == pytest.approx([0.0, 1.0])


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("offset", [0.0, 0.02, 0.04, 0.0475])
def test_first_row_lies_half_its_thickness_off_a_plane(dim, offset):
    """Rows of less than a tenth of a square are merged with the row above."""
    floor = gr.Body(HalfSpace((0.0,) * (dim - 1) + (1.0,)), (0.0,) * (dim - 1) + (0.3 + offset,))
    points = scene_of(floor, dim=dim).points()
    height = points.x[:, -1] - 0.3 - offset
    first = height.min()
    row = SPACING - offset
    row += SPACING * (row < LEAST_SHARE * SPACING)
    assert first == pytest.approx(row / 2, rel=1e-3)
    assert points.volume[height < first * 1.001] == pytest.approx(row * SPACING ** (dim - 1))
    assert points.volume.sum() == pytest.approx(0.7 - offset, rel=1e-6)


@pytest.mark.parametrize("dim", [2, 3])
def test_points_do_not_depend_on_how_many_are_made_at_once(dim, monkeypatch):
    """Also where small parts at a body are merged with points of another part."""
    ball = gr.Body(gr.Sphere(0.23, center=(0.0,) * dim), (0.41,) * dim)
    region = gr.Sphere(0.43, center=(0.5,) * dim)
    rough = gr.Fill(region, 2**dim, jitter=0.4, stagger=True, lithostatic=True)
    scene = scene_of(ball, dim=dim).replace(
        fills=(rough, gr.Fill(Box((0.0,) * dim, (0.1,) * dim), 4**dim))
    )
    whole = vars(scene.points())
    monkeypatch.setattr(seeding_lattice, "AT_ONCE", 50)
    parts = list(scene.points_in_parts())
    assert len(parts) > 5
    for name, array in vars(joined(parts, dim)).items():
        np.testing.assert_array_equal(array, whole[name])


def test_far_bodies_change_nothing():
    """Points, their order and their jitter are those without bodies, to the last bit."""
    far = gr.Body(Cylinder(0.2, center=(0.0, 0.0)), (2.0, 2.0))
    ours, theirs = (scene_of(*b, jitter=0.7).points() for b in ((far,), ()))
    assert np.array_equal(ours.x, theirs.x) and np.array_equal(ours.volume, theirs.volume)


@pytest.mark.parametrize("dim", [2, 3])
def test_points_keep_out_of_edges_and_corners_also_with_jitter(dim):
    rng = np.random.default_rng(4)
    for _ in range(4):
        turned = rng.uniform(0, 90) if dim == 2 else tuple(rng.uniform(0, 90, 3))
        block = gr.Body(Box(size=(0.32, 0.21, 0.27)[:dim]), (0.5,) * dim, rotation_deg=turned)
        plain, moved = (scene_of(block, dim=dim, jitter=j) for j in (0.0, 1.0))
        solid = np.prod((0.32, 0.21, 0.27)[:dim])
        for scene in (plain, moved):
            points = scene.points()
            assert distance_from_bodies(scene.grid, scene.bodies)(points.x)[0].min() > 0
            assert points.volume.sum() == pytest.approx(1 - solid, rel=1e-3 * solid)
        assert not np.array_equal(plain.points().x, moved.points().x)


@pytest.mark.parametrize("turned_deg", [0.0, 33.0])
def test_both_sides_of_a_thin_body_have_their_volume(turned_deg):
    """A plate of a twentieth of a square through the middle of the domain."""
    plate = gr.Body(Box(size=(np.inf, 0.0025)), (0.5, 0.512), rotation_deg=turned_deg)
    points = scene_of(plate).points()
    normal = np.array([-np.sin(np.radians(turned_deg)), np.cos(np.radians(turned_deg))])
    above = (points.x - plate.position) @ normal > 0
    half = gr.Body(HalfSpace(tuple(normal)), tuple(plate.position + 0.00125 * normal))
    wanted = scene_of(half).points().volume.sum()
    # A plate thinner than an eighth of a square takes some of the eighths it is in as a whole.
    assert points.volume[above].sum() == pytest.approx(wanted, rel=1e-3)
    assert abs((points.x - plate.position) @ normal).min() > 0.00125


def test_a_fill_within_a_body_has_no_point():
    block = gr.Body(Box(size=(3.0, 3.0)), (0.5, 0.5))
    with pytest.raises(ValueError, match=r"fills\[0\] = .* at least one material point"):
        scene_of(block).points()


def test_points_in_bodies_are_told():
    """Seeded points keep out; one that is put into a body is told of."""
    floor = gr.Body(HalfSpace((0.0, 1.0)), (0.0, 0.3))
    sim = gr.Simulation(scene_of(floor), threads=1)
    sim.step(1)
    assert sim.health()["in_bodies"].value == 0
    sim.buffers["x"][1, sim.buffers["id"] == 0] -= 0.6 * CELL
    sim.step(1)
    said = sim.health()["in_bodies"]
    assert said.verdict == "suspect" and 0 < said.value < 0.01
