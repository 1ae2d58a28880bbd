"""Shapes of bodies by signed distance, against nearest points of surfaces, and against sets."""

import math
from dataclasses import replace

import numpy as np
import pytest
from oracle_body_shapes import SOLIDS, nearest
from scipy.spatial.transform import Rotation

import granular as gr
from granular import Body, _core
from granular.mpm.scaling import Froude
from granular.shapes import (
    Box,
    Capsule,
    Complement,
    Cylinder,
    Difference,
    Frustum,
    HalfSpace,
    Intersection,
    Offset,
    Polygon,
    Prism,
    Revolve,
    Shell,
    Sphere,
    Torus,
    Union,
)
from granular.shapes.measures import extents, largest_speed, reach, thicknesses
from granular.tools.serializable import _decode, _encode

AT = (0.02, -0.01, 0.03)
BALL, BLOCK = Sphere(0.2, center=AT), Box(size=(0.3, 0.25, 0.35), rotation_deg=(10.0, 20.0, 30.0))
HOLE = Cylinder(0.06, center=AT, axis=(0.2, 0.1, 1.0))
WEDGE = Intersection((HalfSpace((0.0, 1.0)), HalfSpace((1.0, -0.4)), HalfSpace((-1.0, -0.4))))
COMPOSED = {
    "hole": (Difference(BLOCK, HOLE), lambda x: inside(BLOCK, x) & ~inside(HOLE, x)),
    "common": (Intersection((BLOCK, BALL)), lambda x: inside(BLOCK, x) & inside(BALL, x)),
    "outside": (Complement(Union((BLOCK, BALL))), lambda x: ~inside(BLOCK, x) & ~inside(BALL, x)),
    "less_two": (
        Difference(BLOCK, Union((BALL, HOLE))),
        lambda x: inside(BLOCK, x) & ~inside(BALL, x) & ~inside(HOLE, x),
    ),
    "twice": (
        Union((Difference(BALL, HOLE), Intersection((BALL, Complement(BLOCK))))),
        lambda x: inside(BALL, x) & (~inside(HOLE, x) | ~inside(BLOCK, x)),
    ),
    "shell": (
        Shell(BALL, thickness=0.03),
        lambda x: abs(np.linalg.norm(x - AT, axis=1) - 0.215) < 0.015,
    ),
    "inner_shell": (
        Shell(BALL, thickness=0.03, inward=True),
        lambda x: abs(np.linalg.norm(x - AT, axis=1) - 0.185) < 0.015,
    ),
    "rounded": (Offset(BLOCK, by=0.04), lambda x: BLOCK.distance(x)[0] < 0.04),
    "thinner": (Offset(BALL, by=-0.04), lambda x: np.linalg.norm(x - AT, axis=1) < 0.16),
}
SHAPES = {name: solid.shape for name, solid in SOLIDS.items()}
SHAPES |= {name: shape for name, (shape, _) in COMPOSED.items()}
EACH_SHAPE = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)


def inside(shape, x):
    return shape.distance(x)[0] < 0


def places(count, dim, seed=1, far=0.4):
    return np.random.default_rng(seed).uniform(-far, far, (count, dim))


@pytest.mark.parametrize("solid", SOLIDS.values(), ids=SOLIDS)
def test_distance_is_that_of_the_nearest_point(solid):
    x = places(12, 3)
    found, normal = solid.shape.distance(x)
    for place, distance, out in zip(x, found, normal, strict=True):
        length, point = nearest(solid, place)
        assert distance == pytest.approx(-length if solid.contains(place) else length, abs=2e-7)
        assert np.allclose(place - distance * out, point, rtol=0, atol=2e-4)


@EACH_SHAPE
def test_normal_is_the_gradient(shape):
    x, h = places(2000, shape.dim, seed=2), 1e-6
    distance, normal = shape.distance(x)
    assert np.allclose(np.linalg.norm(normal, axis=1), 1, rtol=0, atol=1e-14)
    steps = h * np.eye(shape.dim)
    rises = [(shape.distance(x + e)[0] - shape.distance(x - e)[0]) / (2 * h) for e in steps]
    # two nearest points, such as on the axis of a cylinder, are met by few places
    assert (np.abs(np.stack(rises, axis=1) - normal).max(axis=1) > 1e-4).mean() < 2e-3
    near = x[abs(distance) < 0.02] - (distance[:, None] * normal)[abs(distance) < 0.02]
    assert len(near) > 20
    assert np.median(abs(shape.distance(near)[0])) < 1e-15


@pytest.mark.parametrize(("shape", "contains"), COMPOSED.values(), ids=COMPOSED)
def test_operations_are_those_of_sets(shape, contains):
    x = places(4000, 3, seed=3, far=0.3)
    distance, _ = shape.distance(x)
    assert np.array_equal(distance < 0, contains(x))
    # nowhere is the surface nearer than the distance says: it is exact, or a bound
    ways = places(4000, 3, seed=4, far=1.0)
    ways *= 0.999 * abs(distance / np.linalg.norm(ways, axis=1))[:, None]
    assert np.array_equal(shape.distance(x + ways)[0] < 0, distance < 0)


def test_operations_by_hand():
    box, x = Box(size=(2.0, 2.0)), np.array([[3.0, 0.0], [0.4, 0.2], [4.0, 5.0], [0.0, -1.25]])
    distance, normal = Complement(box).distance(x)
    assert np.allclose(distance, [-2, 0.6, -5, -0.25], rtol=0, atol=1e-15)
    assert np.allclose(normal[:2], [[-1, 0], [-1, 0]], rtol=0, atol=1e-15)
    assert np.allclose(Offset(box, by=0.5).distance(x)[0], [1.5, -1.1, 4.5, -0.25], atol=1e-15)
    assert np.allclose(Offset(box, by=-0.5).distance(x)[0], [2.5, -0.1, 5.5, 0.75], atol=1e-15)
    assert np.allclose(Shell(box, thickness=0.5).distance(x)[0], [1.5, 0.6, 4.5, -0.25], atol=1e-15)
    shell = Shell(box, thickness=0.5, inward=True)
    assert np.allclose(shell.distance(x)[0], [2, 0.1, 5, 0.25], rtol=0, atol=1e-15)
    both = Intersection((box, Union((Box(size=(1.0, 8.0)), Box(size=(8.0, 1.0))))))
    assert np.allclose(both.distance(x)[0], [2, -0.3, 5, 0.25], rtol=0, atol=1e-15)
    assert Complement(Complement(box)).rows().tolist() == box.rows().tolist()


@pytest.mark.parametrize(
    "make",
    [
        lambda c, a: Frustum((0.05, 0.2), 0.3, center=c, axis=a),
        lambda c, a: Frustum((0.05, 0.2), 0.3, center=c, axis=a, thickness=0.03),
        lambda c, a: Frustum((0.2, 0.0), 0.3, center=c, axis=a, inside=True),
        lambda c, a: Capsule(0.08, 0.2, center=c, axis=a),
        lambda c, a: Revolve(
            [(0.05, -0.2), (0.15, 0), (0.15, 0.2)], center=c, axis=a, thickness=0.02
        ),
        lambda c, a: Revolve([(0, 0), (0.2, 0.1), (0, 0.05)], center=c, axis=a),
    ],
)
def test_2d_is_the_section_through_the_axis(make):
    x, axis = places(500, 2), (0.6, -1.1)
    flat, normal = make(AT[:2], axis).distance(x)
    solid, wanted = make((*AT[:2], 0.0), (*axis, 0.0)).distance(np.pad(x, ((0, 0), (0, 1))))
    assert np.allclose(flat, solid, rtol=0, atol=1e-15)
    assert np.allclose(normal, wanted[:, :2], rtol=0, atol=1e-9)


@pytest.mark.parametrize("thickness", [None, 0.04])
def test_polygons_and_prisms_are_one(thickness):
    star = [(0.3 * r * math.cos(a), 0.3 * r * math.sin(a)) for r, a in STAR]
    x = places(400, 2, seed=6)
    flat, normal = Polygon(star, center=AT[:2], rotation_deg=20.0, thickness=thickness).distance(x)
    for axis, order in (("z", [0, 1, 2]), ("x", [2, 0, 1]), ("y", [0, 2, 1])):
        # a left-handed order of the coordinates turns the other way about the axis
        turn = (20.0 if axis != "y" else -20.0) * np.eye(3)["xyz".index(axis)]
        center = np.array([*AT[:2], 0.0])[order]
        prism = Prism(
            star, math.inf, axis=axis, center=center, rotation_deg=tuple(turn), thickness=thickness
        )
        solid, wanted = prism.distance(np.pad(x, ((0, 0), (0, 1)), constant_values=7.0)[:, order])
        assert np.allclose(flat, solid, rtol=0, atol=1e-14)
        assert np.allclose(np.pad(normal, ((0, 0), (0, 1)))[:, order], wanted, rtol=0, atol=1e-9)


STAR = [(1.0 if k % 2 else 0.4, 2 * math.pi * k / 10) for k in range(10)]


def test_the_sense_of_a_polygon_does_not_matter():
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.0, 0.5)]
    x = np.array([[0.5, 0.25], [2.0, 0.5], [0.5, 0.75], [-1.0, 0.5], [0.25, 0.5]])
    for given in (square, square[::-1], square[2:] + square[:2]):
        assert Polygon(given).distance(x)[0].tolist() == [-0.25, 1.0, -0.25, 1.0, -0.25]
    tent = Revolve([(0, 0), (0.3, 0), (0, 0.4)], center=(0, 0, 0), axis=(0, 0, 1))
    cone = Frustum((0.3, 0.0), 0.4, center=(0, 0, 0.2), axis=(0, 0, 1))
    assert np.allclose(tent.distance(places(99, 3))[0], cone.distance(places(99, 3))[0], atol=1e-15)
    # the tip, and a place on the axis within
    assert tent.distance(np.array([[0, 0, 0.5], [0, 0, 0.1]]))[0] == pytest.approx([0.1, -0.1])


def test_a_hopper_lets_through_what_is_narrower_than_its_orifice():
    for dim in (2, 3):
        axis, center = (0.0,) * (dim - 1) + (1.0,), (0.0,) * dim
        hopper = Frustum((0.02, 0.1), 0.15, center=center, axis=axis, thickness=0.01)
        heights = np.linspace(-0.2, 0.2, 81)
        x = np.zeros((81, dim))
        x[:, -1] = heights
        middle = hopper.distance(x)[0]
        slope = 0.15 / math.hypot(0.15, 0.08)  # at the upper end the rim is nearest
        between = abs(heights) < 0.03
        radius = 0.06 + heights[between] / 0.15 * 0.08
        assert np.allclose(middle[between], radius * slope, rtol=1e-12)
        assert middle.min() >= 0.02 * slope
        x[:, 0] = 0.06 + heights / 0.15 * 0.08  # along the inner surface
        assert abs(hopper.distance(x[abs(heights) <= 0.075])[0]).max() < 1e-15
        assert thicknesses(hopper)[0 if dim == 2 else 1] == pytest.approx(0.01)


@EACH_SHAPE
def test_extents_and_speeds_bound_all_points(shape):
    rng = np.random.default_rng(7)
    start = Rotation.from_rotvec(rng.uniform(-2, 2, 3)).as_matrix()
    x = places(20000, 3, seed=7, far=0.45)
    x = x[inside(shape, x)]
    if not np.isfinite(reach(shape)):
        assert np.linalg.norm(x, axis=1).max() > 0.7
        return
    turned = x @ start.T
    still = extents(shape, start, np.zeros((1, 3)))
    assert (abs(turned).max(axis=0) <= still).all()
    assert np.linalg.norm(x, axis=1).max() <= reach(shape) + 1e-12
    about = rng.uniform(-1, 1, 3)
    turns = Rotation.from_rotvec(
        np.linspace(0, 2 * np.pi, 60)[:, None] * about / np.linalg.norm(about)
    )
    swept = np.max([abs(turn.apply(turned[::20])).max(axis=0) for turn in turns], axis=0)
    assert (swept <= extents(shape, start, about[None])).all()
    v = rng.uniform(-1, 1, 3)
    fastest = np.linalg.norm(v + np.cross(about, turned), axis=1).max()
    assert fastest <= largest_speed(shape, start, v[None], about[None])


def test_thicknesses_by_hand():
    up = {"center": (0.0,) * 3, "axis": (0.0, 0.0, 1.0)}
    plate = Box(size=(1.0, 1.0, 0.1))
    assert thicknesses(plate) == (0.1, math.inf)
    assert thicknesses(Union((plate, BALL))) == (0.1, 0.4)
    assert thicknesses(Difference(plate, HOLE)) == (math.inf, 0.1)
    assert thicknesses(Complement(plate)) == (math.inf, math.inf)
    assert thicknesses(Shell(BALL, thickness=0.03))[1] == pytest.approx(0.03)
    assert thicknesses(Torus(0.3, 0.05, **up))[1] == pytest.approx(0.1)
    ell = [(0, 0), (1, 0), (1, 0.2), (0.2, 0.2), (0.2, 1), (0, 1)]
    # a circle that touches both outer sides and the inner corner
    widest = 2 * 0.2 * math.sqrt(2) / (1 + math.sqrt(2))
    assert thicknesses(Polygon(ell))[1] == pytest.approx(widest, rel=0.1)
    cone = Frustum((0.3, 0.0), 0.4, **up)  # its inscribed ball has the radius 2 A / (perimeter)
    assert thicknesses(cone)[1] == pytest.approx(2 * 0.3 * 0.4 / (0.3 + 0.5), rel=0.02)


def test_scenes_keep_and_scale_all_shapes():
    star = [(r * math.cos(a), r * math.sin(a)) for r, a in STAR]
    shapes = [*SHAPES.values(), WEDGE, Polygon(star, thickness=0.1)]
    for shape in shapes:
        assert _decode(_encode(shape)) == shape
        small = Froude(0.25)._scaled(shape, shape.dim)
        x = places(200, shape.dim)
        # the factor is a power of two, so that not a digit changes
        assert small.distance(0.25 * x)[0].tolist() == (0.25 * shape.distance(x)[0]).tolist()


def test_bodies_place_shapes():
    cone = Frustum((0.2, 0.0), 0.3, center=(0.0,) * 3, axis=(0, 0, 1))
    body = Body(cone, (1.0, 2.0, 3.0), rotation_deg=(90.0, 0.0, 0.0))  # z goes to -y
    distance, normal = body.distance(np.array([[1.0, 1.75, 3.0], [1.0, 2.25, 3.0]]))
    assert np.allclose(distance, 0.1, rtol=0, atol=1e-15)
    assert np.allclose(normal, [[0, -1, 0], [0, 1, 0]], rtol=0, atol=1e-15)
    assert body.extents() == pytest.approx([0.2, 0.15, 0.2])


UP = {"center": (0.0,) * 3, "axis": (0.0, 0.0, 1.0)}
SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Sphere(0.0, center=(0.0,) * 3), "radius = 0.0"),
        (lambda: Sphere(1.0, center=(0.0,)), "center"),
        (lambda: Capsule(1.0, math.inf, **UP), "length = inf"),
        (lambda: Capsule(1.0, 1.0, center=(0.0, 0.0), axis=(0.0, 0.0)), "axis"),
        (lambda: Torus(1.0, 1.0, **UP), "tube = 1.0 must be < radius = 1.0"),
        (lambda: Frustum((0.0, 0.0), 1.0, **UP), "must not both be 0"),
        (lambda: Frustum((1.0, -1.0), 1.0, **UP), r"radii\[1\] = -1.0"),
        (lambda: Frustum((1.0,), 1.0, **UP), "two numbers"),
        (lambda: Frustum((1.0, 2.0), 1.0, thickness=0.0, **UP), "thickness = 0.0"),
        (lambda: Frustum((1.0, 2.0), 1.0, thickness=0.1, inside=True, **UP), "thickness = 0.1"),
        (lambda: Polygon(SQUARE[:2]), "2 must be 3 to 1000 vertices"),
        (lambda: Polygon([*SQUARE, (0.0, 1.0)]), r"vertices\[3\] = .* must differ"),
        (lambda: Polygon([SQUARE[k] for k in (0, 2, 1, 3)]), "must be simple"),
        (lambda: Polygon([(0, 0), (2, 0), (1, 0)]), "must be simple"),
        (lambda: Polygon([(0, 0), (2, 0), (2, 2), (1, 0), (0, 2)]), "must be simple"),
        (lambda: Polygon([(0, 0), (1, 0), (math.nan, 1)]), r"vertices\[2\]\[0\] = nan"),
        (lambda: Prism(SQUARE, 0.0, axis="z"), "length = 0.0"),
        (lambda: Prism(SQUARE, 1.0, axis="w"), "axis = 'w'"),
        (lambda: Revolve([(-0.1, 0), (1, 0), (1, 1)], **UP), r"profile\[0\] = .* r >= 0"),
        (lambda: Revolve([(0, 0), (0, 1)], thickness=0.1, **UP), "must not all lie on the axis"),
        (lambda: Intersection(()), r"parts = \(\)"),
        (lambda: Intersection((BALL, Box(size=(1.0, 1.0)))), r"parts\[1\]"),
        (lambda: Difference(BALL, Box(size=(1.0, 1.0))), "without"),
        (lambda: Difference(BALL, "hole"), "without = 'hole'"),
        (lambda: Complement(None), "shape = None"),
        (lambda: Offset(BALL, by=0.0), "by = 0.0"),
        (lambda: Shell(BALL, thickness=-1.0), "thickness = -1.0"),
        (lambda: BALL.distance(np.zeros((2, 2))), "x of shape"),
    ],
)
def test_bad_shapes_are_refused(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()


def test_core_refuses_bad_parts():
    x, kinds = np.zeros((1, 3)), _core.enumerations()["part"]
    cone = Frustum((0.2, 0.0), 0.3, **UP)
    (vertices,) = cone.samples()
    for bad in (vertices[0], vertices[:, :2], vertices[..., :1], vertices[:, [0, 0, 1]], -vertices):
        with pytest.raises(ValueError):
            _core.body_distance(cone.rows(), (np.ascontiguousarray(bad),), x)
    with pytest.raises(ValueError):
        _core.body_distance(cone.rows(), (), x)
    ball = BALL.rows()
    for kind, size in (
        ("union", 2.0),
        ("intersection", 0.0),
        ("union", 1e300),
        ("capsule", np.inf),
    ):
        row = ball.copy()
        row[0, 0], row[0, 14] = kinds[kind], size
        with pytest.raises(ValueError):
            _core.body_distance(np.concatenate([ball, row]), (), x)
    with pytest.raises(ValueError):
        _core.body_distance(Shell(BALL, thickness=0.1).rows()[1:], (), x)


def test_core_survives_any_rows():
    """Rows of random kinds, sizes and arrays are computed or refused."""
    rng, taken = np.random.default_rng(0), 0
    kinds = len(_core.enumerations()["part"])
    for _ in range(3000):
        rows = np.zeros((rng.integers(1, 6), 17))
        rows[:, 0] = rng.integers(0, kinds, len(rows))
        rows[:, 1] = rng.integers(0, 2, len(rows))
        rows[:, 2:14] = rng.normal(size=(len(rows), 12))
        rows[:, 14:] = rng.choice([0.0, 0.3, 1.0, 2.0, 3.0, np.inf], (len(rows), 3))
        count = int(np.isin(rows[:, 0], [3, 6, 7]).sum())
        arrays = tuple(
            abs(rng.integers(-3, 4, (1, rng.integers(1, 6), 2)).astype(float)) for _ in range(count)
        )
        try:
            _core.body_distance(rows, arrays, rng.uniform(-2, 2, (5, 3)))
            taken += 1
        except ValueError:
            continue
    assert 300 < taken < 2700


def test_too_many_parts_are_refused():
    many = Intersection((BALL,) * 200)
    scene = gr.scenes.column_collapse()
    flat = Intersection((Box(size=(1.0, 1.0)),) * 200)
    with pytest.raises(ValueError, match="at most 64 of 256"):
        replace(scene, bodies=(Body(flat, (9.0, 9.0)), Body(flat, (-9.0, 9.0))))
    assert many.distance(places(3, 3))[0] == pytest.approx(BALL.distance(places(3, 3))[0])
