"""Polygons, masks, layers and clouds: areas by hand, their place in records, refusals."""

import json
import math

import numpy as np
import pytest
from refusals import refused
from scenes_by_hand import scene_with

import granular as gr
from granular import Box, Cylinder, HalfSpace
from granular.mpm.scaling import Froude

GRID = gr.Grid((0.0, 0.0), 0.1, (10, 10))
SPACE = gr.Grid((0.0,) * 3, 0.1, (10,) * 3)
TRIANGLE = gr.Polygon(((0.1, 0.1), (0.9, 0.2), (0.35, 0.8)))
TRIANGLE_AREA = 0.5 * (0.8 * 0.7 - 0.1 * 0.25)


def scene_of(region, *bodies, grid=None, gravity=None, scheme=gr.schemes.default, **fill):
    dim = region.dim
    return scene_with(
        grid=grid or (GRID, SPACE)[dim - 2],
        fills=(gr.Fill(region, 4 if dim == 2 else 1, **fill),),
        scheme=scheme,
        gravity=gravity or (0.0,) * (dim - 1) + (-9.8,),
        bodies=bodies,
    )


REGIONS = [
    TRIANGLE,
    gr.Prism(TRIANGLE.vertices, 0.35, axis="y", center=(0.0, 0.375, 0.0)),
    gr.Layer(0.1, lambda x: 0.3 + 0.2 * x, 0.0, 1.0, spacing=0.1),
    gr.Layer(lambda x, y: 0.2 + 0.3 * x + 0.1 * y, 0.25, (0.1, 0.0), (0.9, 1.0), spacing=0.1),
    gr.Layer(0.0, [[0.1, 0.3], [0.2, 0.4]], (0.0, 0.0), (1.0, 1.0), spacing=1.0),
    gr.Mask([[True, False], [True, True]], (0.2, 0.2), 0.3),
    gr.Cloud([[0.2, 0.3], [0.25, 0.31]], [0.001, 0.002], velocity=[[1, 2], [3, 4]]),
    gr.Union((TRIANGLE, gr.Box((0.0, 0.0), (0.05, 0.05)))),
]


@pytest.mark.parametrize("region", REGIONS, ids=lambda region: type(region).__name__)
def test_regions_are_written_and_scaled(region):
    """A scene read again is equal, has the same points, and a hash; scaled, all is larger."""
    scene = scene_of(region)
    again = gr.Scene.from_json(scene.to_json())
    assert again == scene and hash(again) == hash(scene)
    ours, theirs = scene.points(), again.points()
    for name in ("x", "v", "volume", "density"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name))
    larger = Froude(4.0).scene(scene).points()
    np.testing.assert_allclose(larger.x, 4 * ours.x, rtol=1e-13)
    np.testing.assert_allclose(larger.volume, 4.0**region.dim * ours.volume, rtol=1e-10)
    np.testing.assert_allclose(larger.v, 2 * ours.v, rtol=1e-13)


@pytest.mark.parametrize(
    ("region", "volume"),
    [
        (TRIANGLE, TRIANGLE_AREA),
        (REGIONS[1], TRIANGLE_AREA * 0.35),
        (REGIONS[2], 0.4),
        (REGIONS[3], 0.8 * 0.25),
        (REGIONS[4], 0.25),
        (gr.Layer(0.2, 0.013, 0.0, 1.0), 0.013),  # thinner than a square
    ],
)
def test_points_have_the_volume_of_the_region(region, volume):
    points = scene_of(region).points()
    assert points.volume.sum() == pytest.approx(volume, rel=1e-3)
    assert region.contains(points.x).all()


def test_polygon_by_hand():
    hook = gr.Polygon(((0, 0), (2, 0), (2, 2), (1, 0.5)))
    x = [(1.0, 0.25), (0.5, 1.0), (1.5, 1.0), (1.0, 1.5)]
    assert hook.contains(x).tolist() == [True, False, True, False]
    prism = gr.Prism(((0, 0), (1, 0), (0, 1)), 1.0, axis="x", center=(2.5, 0.0, 0.0))
    assert prism.bounds == ((2, 0, 0), (3, 1, 1))
    assert prism.contains([(2.5, 0.2, 0.3), (1.9, 0.2, 0.3), (2.5, 0.8, 0.8)]).tolist() == [
        True,
        False,
        False,
    ]


def test_heights_are_bilinear_and_constant_beyond():
    heights = gr.Heights.of(lambda x, y: 1 + 2 * x + 3 * y + 4 * x * y, (0, 0), (1, 2), 0.5)
    x = np.random.default_rng(0).uniform((0, 0), (1, 2), (50, 2))
    wanted = 1 + 2 * x[:, 0] + 3 * x[:, 1] + 4 * x[:, 0] * x[:, 1]
    assert np.allclose(heights.height(x), wanted, rtol=1e-14)
    assert heights.height([(-1.0, 0.0), (3.0, 2.0)]).tolist() == [1.0, 1 + 2 + 6 + 8]
    line = gr.Heights([0.0, 1.0, 0.0], 2.0, 0.5)
    assert line.height([[2.25], [2.5], [9.0]]).tolist() == [0.5, 1.0, 0.0]
    assert gr.Heights.of(line, 2, 3, 0.25).z.tolist() == [0, 0.5, 1, 0.5, 0]


def test_heights_of_a_body():
    """The surface is looked for from above, whether the position is in the solid or not."""
    slope = gr.Body(HalfSpace((-math.sin(0.6), math.cos(0.6))), (0.2, 0.1))
    found = gr.Heights.of(slope, 0.0, 1.0, 0.25).z
    assert np.allclose(found, 0.1 + math.tan(0.6) * (np.arange(5) * 0.25 - 0.2), atol=1e-9)
    drum = gr.Body(Cylinder(0.4, center=(0.0, 0.0), inside=True), (0.5, 0.6))
    found = gr.Heights.of(drum, 0.2, 0.8, 0.3).z
    assert np.allclose(found, 0.6 - np.sqrt(0.16 - np.array([0.09, 0, 0.09])), atol=1e-9)
    for size in (1e-3, 1.0, 1e4):  # the roof above its floor, at any size
        floor, roof = (Box(size=(3 * size, 0.2 * size), center=(0, y * size)) for y in (0.1, 0.5))
        found = gr.Heights.of(gr.Body(gr.shapes.Union((floor, roof)), (0, 0)), -size, size, size).z
        assert found == pytest.approx(0.6 * size, rel=1e-9)
    with pytest.raises(ValueError, match=r"must have a surface below \(0.0,\)"):
        gr.Heights.of(gr.Body(Box(size=(0.1, 0.1)), (0.5, 0.5)), 0.0, 1.0, 0.25)


def test_layer_on_a_slope_fills_it_without_a_gap():
    slope = gr.Body(HalfSpace((-math.sin(0.4), math.cos(0.4))), (0.5, 0.4))
    layer = gr.Layer(slope, 0.12, 0.1, 0.9, spacing=0.05)
    points = scene_of(layer, slope).points()
    assert points.volume.sum() == pytest.approx(0.8 * 0.12, rel=2e-3)
    assert slope.distance(points.x)[0].min() > 0.05 * 0.05


def test_mask_of_a_region_of_ones_own():
    class Ring(gr.shapes.Region):
        bounds = ((0.1, 0.1), (0.9, 0.9))

        def _inside(self, x):
            return abs(np.linalg.norm(x - 0.5, axis=1) - 0.3) < 0.1

    ring = Ring()
    with pytest.raises(TypeError, match=r"use granular.Mask.of\(region.contains"):
        scene_of(ring).to_json()
    mask = gr.Mask.of(ring.contains, (0.1, 0.1), (0.9, 0.9), 0.05)
    ours, theirs = scene_of(mask).points(), scene_of(ring).points()
    assert np.array_equal(ours.x, theirs.x) and len(ours.x) > 100
    assert mask.bounds == pytest.approx(np.array(ring.bounds))


def test_cloud_is_seeded_as_it_is():
    rng = np.random.default_rng(1)
    x, volume = rng.uniform(0.2, 0.8, (40, 2)), rng.uniform(1e-3, 2e-3, 40)
    cloud = gr.Cloud(x, volume, velocity=-x, density=np.full(40, 1200.0))
    points = scene_of(cloud).points()
    assert np.array_equal(points.x, x) and np.array_equal(points.volume, volume)
    assert np.array_equal(points.v, -x) and (points.density == 1200).all()
    moving = scene_of(cloud, velocity=(1.0, 0.0), density=1300.0).points()
    assert (moving.v == (1, 0)).all() and (moving.density == 1300).all()
    state = gr.Simulation(scene_of(cloud), threads=1).state
    assert np.allclose(state.mass, volume * 1200)
    assert cloud.contains(x + 0.49 * np.sqrt(volume)[:, None]).all()
    assert not cloud.contains([(0.1, 0.1), (0.9, 0.5)]).any()
    with pytest.raises(ValueError, match=r"fills\[0\].region.density must be None in a litho"):
        scene_of(cloud, lithostatic=True).points()
    fast = scene_of(gr.Cloud(x, volume, velocity=1e3 * x), scheme=gr.Scheme(dt=1e-4))
    with pytest.raises(ValueError, match=r"dt = 0.0001 must be <= .* points or bodies of \d+ m/s"):
        gr.Simulation(fast, threads=1)
    deep = gr.Body(HalfSpace((0.0, 1.0)), (0.0, 0.3))
    with pytest.raises(ValueError, match=r"fills\[0\].region has a point at .* within a body"):
        scene_of(cloud, deep).points()
    with pytest.raises(ValueError, match="must not be a Cloud"):
        scene = gr.scenes.slump_sph()
        scene.replace(fills=(gr.Fill(gr.Cloud([[0.1, 0.1]], 1e-3), 1),))


# ---- depth ----


def test_depth_below_the_top_above_each_point():
    """A heap, a disc and a cave below an overhang, against gravity in two directions."""
    heap = gr.Layer(0.0, lambda x: 0.8 - abs(x - 0.5), 0.0, 1.0, spacing=0.05)
    points = scene_of(heap, lithostatic=True).points()
    assert np.allclose(points.depth, 0.8 - abs(points.x[:, 0] - 0.5) - points.x[:, 1], atol=1e-12)
    disc = gr.Sphere(0.4, center=(0.5, 0.5))
    points = scene_of(disc, lithostatic=True).points()
    x, y = points.x.T - 0.5
    assert np.allclose(points.depth, np.sqrt(0.16 - x**2) - y, atol=1e-6)
    cave = gr.Difference(gr.Box((0, 0), (1, 1)), gr.Box((0.3, 0.4), (0.7, 0.6)))
    points = scene_of(cave, lithostatic=True).points()
    assert np.allclose(points.depth, 1 - points.x[:, 1], atol=1e-12)
    up = np.array([0.6, 0.8])
    across = scene_of(disc, lithostatic=True, gravity=tuple(-9.8 * up)).points()
    s, t = (across.x - 0.5) @ up, (across.x - 0.5) @ (-up[1], up[0])
    assert np.allclose(across.depth, np.sqrt(0.16 - t**2) - s, atol=1e-6)
    box = scene_of(gr.Box((0, 0), (1, 1)), lithostatic=True, gravity=(9.8, 0.0)).points()
    assert np.allclose(box.depth, box.x[:, 0], atol=1e-14)


def test_lithostatic_needs_gravity_across_periodic_axes():
    layer = gr.Grid((0.0, 0.0), 0.1, (10, 10), periodic=(True, False))
    with pytest.raises(ValueError, match="no component along a periodic axis"):
        scene_of(gr.Box((0, 0), (1, 1)), grid=layer, gravity=(1.0, -9.0), lithostatic=True)


# ---- what is refused ----


def test_bad_regions_are_refused():
    square = ((0, 0), (1, 0), (1, 1))
    refused(
        ("vertices: 2 must be 3 to 1000", lambda: gr.Polygon(((0, 0), (1, 1)))),
        ("the polygon must be simple", lambda: gr.Polygon(((0, 0), (2, 2), (2, 0), (0, 2)))),
        (r"vertices\[1\]", lambda: gr.Polygon(((0, 0), (math.inf, 1), (1, 0)))),
        (r"vertices\[1\]", lambda: gr.Polygon(((0, 0), (1, 1, 1), (1, 0)))),
        ("length = -1", lambda: gr.Prism(square, -1, axis="y")),
        ("axis = 'w'", lambda: gr.Prism(square, 1, axis="w")),
        ("inside of shape .* True somewhere", lambda: gr.Mask(np.zeros((2, 2), bool), (0, 0), 1)),
        ("must have the shape", lambda: gr.Mask([True], (0, 0), 1)),
        ("spacing = 0.0", lambda: gr.Mask([[True]], (0, 0), 0)),
        (r"returned the shape \(2,\)", lambda: gr.Mask.of(lambda x: [True] * 2, (0, 0), (1, 1), 1)),
        (r"upper = .* must exceed", lambda: gr.Mask.of(lambda x: x[:, 0], (0, 0), (1, 0), 1)),
        ("at most 2147483647 squares", lambda: gr.Mask.of(len, (0, 0), (1, 1), 1e-9)),
        ("at least 2 heights", lambda: gr.Heights([1.0], 0.0, 1.0)),
        ("at most 2147483647 heights", lambda: gr.Heights.of(1.0, (0, 0), (1, 1), 1e-9)),
        ("spacing = None must be a number", lambda: gr.Layer(0, lambda x: x, 0, 1)),
        ("thickness must be >= 0", lambda: gr.Layer(0, -1.0, 0, 1)),
        ("thickness must be >= 0", lambda: gr.Layer(0, 0.0, 0, 1)),
        (r"upper\[0\] = 0.0 must exceed", lambda: gr.Layer(0, 1.0, 0, 0)),
        ("lower = .* must be 1 or 2 numbers", lambda: gr.Layer(0, 1.0, (0, 0, 0), (1, 1, 1))),
        ("heights along 1 axes", lambda: gr.Layer(gr.Heights(np.ones((2, 2)), (0, 0), 1), 1, 0, 1)),
        ("volume: the least is 0.0", lambda: gr.Cloud([[0, 0]], [0.0])),
        ("x of shape", lambda: gr.Cloud(np.zeros((0, 2)), 1.0)),
        ("velocity of shape", lambda: gr.Cloud([[0, 0]], 1.0, velocity=[0, 0])),
    )
    refused(
        ("thickness = 'high' must be", lambda: gr.Layer(0, "high", 0, 1, spacing=1)),
        ("inside of int64 must be an array of bool", lambda: gr.Mask([[1]], (0, 0), 1)),
        ("x of .* must be an array of float", lambda: gr.Cloud([["a", "b"]], 1.0)),
        error=TypeError,
    )


@pytest.mark.parametrize(
    "changes",
    [
        {"dtype": "<i4"},
        {"shape": [3, 3]},
        {"shape": [-1]},
        {"shape": [2**40, 2**40]},
        {"shape": "ab"},
        {"data": "no base64!"},
        {"data": "AAAA"},
        {"data": 7},
        {"more": 1},
    ],
)
def test_damaged_arrays_in_json_are_refused(changes):
    data = json.loads(scene_of(REGIONS[5]).to_json())
    data["scene"]["fills"][0]["region"]["inside"].update(changes)
    with pytest.raises(ValueError, match="not the JSON of a scene"):
        gr.Scene.from_json(json.dumps(data))


def test_arrays_cannot_be_changed():
    z = np.zeros(3)
    heights = gr.Heights(z, 0.0, 1.0)
    z[0] = 5
    assert not heights.z.any()
    with pytest.raises(ValueError, match="read-only"):
        heights.z[0] = 1
    assert heights != gr.Heights(z, 0.0, 1.0)
    assert scene_of(TRIANGLE).points().x.flags.writeable is False


def test_terrain_beside_a_layer_does_not_bound_it():
    x = np.linspace(0.0, 1.0, 101)
    for peak in (2.0, -2.0):
        terrain = gr.Heights(np.where(x > 0.8, 0.2 + peak, 0.2), (0.0,), 0.01)
        low, high = gr.Layer(on=terrain, thickness=0.1, lower=0.2, upper=0.6).bounds
        assert low == pytest.approx((0.2, 0.2)) and high == pytest.approx((0.6, 0.3))
