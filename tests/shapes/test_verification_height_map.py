"""Height maps as bodies: exact distances, records, and refused input."""

import numpy as np
import pytest
from scenes_by_hand import scene_with
from scipy.optimize import minimize

import granular as gr
from granular import Body, Box, Fill, Grid, HalfSpace, HeightMap, Union, _core
from granular.export.surfaces import surface
from granular.shapes.shape import turned


def plane(dtype=float):
    """Posts on z = 0.3 x + 0.7 y, and the unit normal."""
    z = np.add.outer(0.7 * 0.125 * np.arange(33), 0.3 * 0.125 * np.arange(41)).astype(dtype)
    return z, np.array([-0.3, -0.7, 1.0]) / np.sqrt(1.58)


def waves(n, size=2.0):
    """Heights of a smooth surface on n x n posts."""
    x = np.linspace(0.0, size, n)
    return HeightMap(0.2 * np.sin(3 * x) + 0.1 * np.cos(4 * x)[:, None], size / (n - 1))


@pytest.mark.parametrize("turn", [0.0, (20.0, -35.0, 50.0)])
def test_a_tilted_plane_is_exact(turn):
    """Distance and normal from near to far, where the foot is within the map."""
    z, normal = plane()
    body = Body(HeightMap(z, 0.125, origin=(-1.0, 2.0)), (0.1, 0.2, 0.3), rotation_deg=turn)
    foot = np.random.default_rng(0).uniform([1.0, 1.0], [4.0, 3.0], (800, 2))
    at = np.column_stack([foot + np.array([-1.0, 2.0]), foot @ [0.3, 0.7]])
    wanted = np.random.default_rng(1).uniform(-1.0, 1.0, 800)
    x = turned(turn).apply(at + wanted[:, None] * normal) + body.position
    found, outward = body.distance(x)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)
    near = abs(wanted) > 1e-6
    np.testing.assert_allclose(
        outward[near], np.broadcast_to(turned(turn).apply(normal), outward[near].shape), atol=1e-9
    )


def test_in_the_plane():
    """In 2D the map is a line of posts, and y is up."""
    body = Body(HeightMap(0.5 * 0.1 * np.arange(21), 0.1), (0.0, 0.0))
    normal = np.array([-0.5, 1.0]) / np.sqrt(1.25)
    foot = np.random.default_rng(0).uniform(0.5, 1.5, 300)
    wanted = np.random.default_rng(1).uniform(-0.5, 0.5, 300)
    found, outward = body.distance(np.stack([foot, 0.5 * foot], axis=1) + wanted[:, None] * normal)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)
    np.testing.assert_allclose(outward, np.broadcast_to(normal, outward.shape), rtol=0, atol=1e-9)


def test_the_nearest_point_of_waves_by_minimisation():
    """Second order in the spacing of the posts, against the smooth surface itself."""

    def height(p):
        return 0.2 * np.sin(3 * p[0]) + 0.1 * np.cos(4 * p[1])

    x = np.random.default_rng(0).uniform([0.5, 0.5, -0.2], [1.5, 1.5, 0.5], (20, 3))
    wanted = []
    for place in x:

        def square(p, place=place):
            return (p[0] - place[0]) ** 2 + (p[1] - place[1]) ** 2 + (height(p) - place[2]) ** 2

        starts = [
            place[:2] + np.array(d) for d in ((0, 0), (0.2, 0), (-0.2, 0), (0, 0.2), (0, -0.2))
        ]
        least = min(minimize(square, start, tol=1e-12).fun for start in starts)
        wanted.append(np.sign(place[2] - height(place)) * np.sqrt(least))
    errors = []
    for n in (41, 81, 161):
        found, normal = Body(waves(n), (0.0,) * 3).distance(x)
        errors.append(abs(found - wanted).max())
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, rtol=0, atol=1e-12)
    assert errors[1] < 0.35 * errors[0] and errors[2] < 0.35 * errors[1], errors


def test_the_search_finds_the_nearest_triangle():
    """Rough heights, whose nearest triangle may be far aside: as the tree of triangles finds it."""
    rng = np.random.default_rng(4)
    z = rng.uniform(-1.0, 1.0, (19, 30))
    body = HeightMap(z, (0.2, 0.3))
    y, x = np.meshgrid(0.3 * np.arange(19), 0.2 * np.arange(30), indexing="ij")
    index = np.arange(z.size).reshape(z.shape)
    a, b, c, d = (
        part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32)
    tree = _core.mesh_tree(np.stack([x.ravel(), y.ravel(), z.ravel()], 1), faces)
    places = rng.uniform([0, 0, -4], [5.8, 5.4, 4], (3000, 3))
    found = Body(body, (0.0,) * 3).distance(places)[0]
    np.testing.assert_allclose(
        abs(found), _core.mesh_distance(tree, places, False), rtol=0, atol=1e-12
    )
    assert (found[places[:, 2] > 1] > 0).all() and (found[places[:, 2] < -1] < 0).all()


def test_single_precision_is_not_copied():
    z, normal = plane(np.float32)
    shape = HeightMap(z, 0.125)
    assert np.shares_memory(shape.samples()[0][1], z) and not shape.z.flags.writeable
    x = np.array([[2.0, 2.0, 2.5]])
    assert Body(shape, (0.0,) * 3).distance(x)[0][0] == pytest.approx(
        float(x[0] @ normal), abs=1e-6
    )


def test_beyond_its_edges_the_surface_goes_on():
    z, _ = plane()
    body = Body(HeightMap(z, 0.125, extended=True), (0.0,) * 3)
    inside, beyond = body.distance(np.array([[2.0, 0.0, 1.0], [2.0, -7.0, 1.0]]))[0]
    assert beyond == inside


def bed(shape, **change):
    given = {"lower": (0.0, 0.0, 0.0), "cell": 0.05, "shape": (8, 6, 10)} | change
    return scene_with(
        grid=Grid(**given),
        fills=(Fill(Box((0.0, 0.0, 0.25), (0.4, 0.3, 0.35)), 8),),
        scheme=gr.Scheme(dt=4e-4),
        bodies=(Body(shape, (0.0,) * 3, friction=0.3),),
    )


def test_a_bed_falls_on_ground(tmp_path):
    """Level ground acts as a half-space does; the scene goes through a record, bit by bit."""
    shape = HeightMap(np.full((4, 5), 0.21, dtype=np.float32), 0.1)
    scene = bed(shape)
    assert gr.Scene.from_json(scene.to_json()) == scene
    assert gr.Scene.from_json(scene.to_json()).bodies[0].shape.z.dtype == np.float32
    half = HalfSpace((0.0, 0.0, 1.0), (0.0, 0.0, float(np.float32(0.21))))
    impulses = []
    for one in (shape, half, Union((shape, Box(size=(0.2,) * 3, center=(0.2, 0.15, -0.2))))):
        sim = gr.Simulation(bed(one), threads=1)
        sim.step(300)
        impulses.append(sim.bodies[0].impulse)
    assert impulses[1][2] < -1
    # points at the verge of contact take sides by round-off: a change of E by 1e-14 changes the
    # impulse on either ground by up to 3e-5 (measured)
    np.testing.assert_allclose(impulses[0], impulses[1], rtol=0, atol=1e-4 * abs(impulses[1][2]))
    assert np.array_equal(impulses[0], impulses[2])
    gr.Simulation(scene, threads=1).run(until=0.02, save=tmp_path / "m.h5", every=0.01)
    again = gr.Simulation.resume(tmp_path / "m.h5").run(until=0.04)
    whole = gr.Simulation(scene, threads=1).run(until=0.04, every=0.01, monitor=False)
    assert np.array_equal(again.state.x, whole.state.x)
    small = gr.scaling.Froude(length=0.25).scene(scene).bodies[0].shape
    assert small == HeightMap(shape.z * np.float32(0.25), 0.025)


def test_a_domain_beyond_the_map_is_refused():
    shape = HeightMap(np.zeros((4, 4)), 0.1)
    with pytest.raises(ValueError, match=r"from 0 to 0.4 m along x .* from 0 to 0.3 m"):
        bed(shape)
    bed(HeightMap(np.zeros((4, 4)), 0.1, extended=True))
    bed(HeightMap(np.zeros((4, 5)), 0.1), periodic=(True, False, False))
    # far from the origin a post is where it is to the rounding of its coordinate, 1e-9 m here
    utm = (512345.1, 5234567.3)
    far = HeightMap(np.zeros((40, 50)), 0.1, origin=utm)
    corners = np.array([utm, [utm[0] + 98 * 0.05, utm[1] + 78 * 0.05]])
    slack = 64 * np.spacing(utm[1])  # of the grid, see Grid.slack
    far.check("bodies[0]", corners, slack)
    with pytest.raises(ValueError, match="along y"):
        far.check("bodies[0]", corners + np.array([0.0, 1e-5]), slack)


def test_a_map_is_drawn_as_its_posts():
    shape = HeightMap(np.arange(12.0).reshape(3, 4), (0.5, 0.25), origin=(1.0, 2.0))
    vertices, quads = surface(shape, 3, 1.0)
    assert len(vertices) == 12 and len(quads) == 6 and quads[0] == (0, 1, 5, 4)
    assert vertices[6].tolist() == [2.0, 2.25, 6.0]
    assert abs(Body(shape, (0.0,) * 3).distance(vertices)[0]).max() < 1e-12
    vertices, quads = surface(HeightMap(np.zeros(2000), 0.1), 2, 1.0)
    assert len(vertices) == 1000 and len(quads) == 499
    assert vertices[499].tolist() == pytest.approx([199.9, 0.0, 0.0])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"z": [[0.0, np.nan], [0.0, 0.0]]}, r"z\[0, 1\] = nan must be finite"),
        ({"z": [[0.0, 0.0]]}, "two posts"),
        ({"z": np.zeros((2, 2, 2))}, "1 or 2 axes"),
        ({"z": [["a", "b"]]}, "real numbers"),
        ({"z": np.ma.masked_equal([[0, 1], [-9999, 3]], -9999)}, r"1 entries are .* z\[1, 0\]"),
        ({"z": np.full((2, 2), 1e40)}, "below 1e30"),
        ({"spacing": 0.0}, r"spacing\[0\] = 0.0"),
        ({"spacing": (1.0, 1.0, 1.0)}, "must have 2 numbers"),
        ({"origin": (1.0,)}, "must have 2 numbers"),
        ({"origin": (1.0, np.inf)}, r"origin\[1\] = inf"),
        ({"extended": 1}, "extended = 1"),
    ],
)
def test_bad_maps_are_refused(change, message):
    given = {"z": np.zeros((3, 4)), "spacing": 0.1} | change
    with pytest.raises((TypeError, ValueError), match=message):
        HeightMap(given.pop("z"), given.pop("spacing"), **given)


def test_core_refuses_bad_maps():
    shape, x = HeightMap(np.zeros((30, 40)), 0.1), np.zeros((2, 3))
    rows, (grid, z, ranges) = shape.rows(), shape.samples()[0]
    for tables in (
        (grid, z), (grid[:3], z, ranges), (grid * 0, z, ranges), (grid, z.T, ranges),
        (grid, z[:1], ranges), (grid, z.astype(int), ranges), (grid, z, ranges[:-1]),
        (grid, z, ranges * np.nan), (grid, z * np.nan, ranges), (grid, None, ranges),
        (grid, z[None], ranges), (grid, z.astype(np.float32) + np.float32(np.inf), ranges),
        [grid, z, ranges],
    ):  # fmt: skip
        with pytest.raises((TypeError, ValueError)):
            _core.body_distance(rows, (tables,), x)
    far = np.array([[1e50, -1e50, 1e50], [0.0, 0.0, -1e50]])
    _core.body_distance(rows, shape.samples(), far)
