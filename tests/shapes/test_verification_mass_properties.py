"""Mass, centre and inertia of homogeneous bodies, and the bounds of their errors."""

import math

import numpy as np
import pytest
from cube import CORNERS, FACES

import granular as gr
from granular import Body
from granular.mpm.bodies import mass_properties
from granular.shapes import (
    Box,
    Capsule,
    Cylinder,
    Difference,
    Frustum,
    Intersection,
    Mesh,
    Offset,
    Polygon,
    Prism,
    Shell,
    Sphere,
    Torus,
    Union,
)
from granular.shapes.moments import _of_cells

ROUNDING = 1e-12
APART = (2.0, 0.0, 0.0)
HOOK = ((0.5, 0.2), (1.5, 0.2), (1.5, 0.6), (0.9, 0.6), (0.9, 1.4), (0.5, 1.4))


def off(found, mass, center, inertia):
    """Largest error, relative as `MassProperties.error` is."""
    inertia, center = np.array(inertia), np.array(center)
    largest, trace = inertia, inertia
    if inertia.ndim:
        largest, trace = np.linalg.eigvalsh(inertia).max(), np.trace(inertia) / 2
    return max(
        abs(found.mass / mass - 1),
        abs(np.array(found.center) - center).max() / math.sqrt(trace / mass),
        abs(np.array(found.inertia) - inertia).max() / largest,
    )


def moved(whole, to):
    """Moment of inertia about another point than the centre."""
    arm = np.array(whole.center) - to
    if len(arm) == 2:
        return whole.inertia + whole.mass * arm @ arm
    turned = arm @ arm * np.eye(3) - np.outer(arm, arm)
    return np.array(whole.inertia) + whole.mass * turned


def less(shape, hole):
    """Mass, centre and inertia of a shape with a hole, by those of both."""
    whole, gone = mass_properties(shape, 1000.0), mass_properties(hole, 1000.0)
    mass = whole.mass - gone.mass
    center = whole.mass * np.array(whole.center) - gone.mass * np.array(gone.center)
    center = center / mass
    return mass, center, moved(whole, center) - moved(gone, center)


def same(shape):
    """Those of a shape that has a formula."""
    whole = mass_properties(shape, 1000.0)
    assert whole.error == 0
    return whole.mass, whole.center, whole.inertia


def test_formulas():
    """Those of homogeneous bodies in text books."""
    disc = mass_properties(Cylinder(0.1, center=(0.02, 0.0)), 1000.0)
    assert disc.mass == pytest.approx(10 * np.pi, rel=1e-12)
    assert disc.center == (0.02, 0.0)
    assert disc.inertia == pytest.approx(0.5 * disc.mass * 0.01, rel=1e-12)
    ball = mass_properties(Sphere(0.1, center=(0.0, 0.0, 0.0)), 1000.0)
    assert ball.inertia == pytest.approx(0.4 * ball.mass * 0.01 * np.eye(3), rel=1e-12)
    box = mass_properties(Box(size=(0.3, 0.2, 0.1)), 1000.0)
    exact = 6.0 / 12 * np.diag([0.05, 0.1, 0.13])
    assert np.array(box.inertia) == pytest.approx(exact, rel=1e-12)


SINGLE = {
    "rectangle": Box(size=(0.3, 0.2), center=(0.03, 0.0), rotation_deg=20.0),
    "disc": Cylinder(0.1, center=(8.0, 0.0)),
    "stadium": Capsule(0.1, 0.3, center=(0.0, 0.0), axis=(1.0, 1.0)),
    "strip": Box(size=(0.4, 0.005), rotation_deg=45.0),
    "box": Box(size=(0.3, 0.2, 0.1)),
    "plate": Box(size=(0.4, 0.3, 0.005), center=(1.0, 2.0, 3.0), rotation_deg=(0.0, 45.0, 0.0)),
    "cylinder": Cylinder(0.1, center=(0.0,) * 3, axis=(1.0, 1.0, 0.0), length=0.3),
    "capsule": Capsule(0.1, 0.3, center=(0.0,) * 3, axis=(1.0, 0.0, 1.0)),
    "torus": Torus(0.2, 0.05, center=(0.0,) * 3, axis=(0.0, 1.0, 1.0)),
} | {f"ball at {x} m": Sphere(0.1, center=(x, -0.3 * x, 0.0)) for x in (1.0, 3.0, 8.0)}


@pytest.mark.parametrize("shape", SINGLE.values(), ids=SINGLE)
def test_quadrature_is_within_its_bound_of_formulas(shape):
    """A union of a shape with itself has no formula; it may be anywhere, and thin."""
    found = mass_properties(Union((shape, shape)), 1000.0)
    assert 0 < found.error <= 1.5e-3  # of the plate, for which the cells do not suffice
    assert off(found, *same(shape)) <= found.error


TURN = {"rotation_deg": (10.0, 20.0, 30.0)}
HOLLOW = {
    "box": (Box(size=(0.4, 0.3, 0.2), **TURN), Box(size=(0.394, 0.294, 0.194), **TURN)),
    "box along": (Box(size=(0.4, 0.3, 0.2)), Box(size=(0.394, 0.294, 0.194))),
    "ball": (Sphere(0.2, center=(1.0, 0, 0)), Sphere(0.197, center=(1.0, 0, 0))),
    "crescent": (Sphere(0.2, center=(0.0,) * 3), Sphere(0.1, center=(0.05, 0.0, 0.0))),
    "frame": (Box(size=(0.4, 0.3)), Box(size=(0.394, 0.294))),
    "ring": (Cylinder(0.2, center=(1.0, 0.0)), Cylinder(0.199, center=(1.0, 0.0))),
}


@pytest.mark.parametrize(("shape", "hole"), HOLLOW.values(), ids=HOLLOW)
def test_hollow_bodies_are_exact(shape, hole):
    """Walls of 3 mm, of 1 mm in 2D."""
    found = mass_properties(Difference(shape, hole), 1000.0)
    assert found.error == 0 and off(found, *less(shape, hole)) < ROUNDING


def small_parts(dim, random):
    """Wires, balls and discs far from each other, as thin as 1/1000 of the size of all."""
    parts = []
    for k in range(4):
        center, size = (*random.uniform(-1, 1, dim - 1), 3.0 * k), float(random.uniform(2e-3, 2e-2))
        if dim == 2:
            turn = float(random.uniform(0, 90))
            kinds = [
                Cylinder(size, center=center),
                Box(size=(1.0, size), center=center, rotation_deg=turn),
            ]
        else:
            axis = tuple(random.normal(size=3))
            kinds = [Sphere(size, center=center)]
            kinds += [
                Cylinder(r, length=h, center=center, axis=axis)
                for r, h in ((size, 1.0), (0.3, size))
            ]
        parts.append(kinds[random.integers(len(kinds))])
    return Union(parts)


def test_no_small_part_is_passed_over():
    """Parts that are apart are added exactly; the cells alone find all of them, too.

    Of 4 balls of 1.6 mm along 6 m, one was missing from the mass at an error of 1e-4.
    """
    random = np.random.default_rng(1)
    for dim in (2, 2, 2, 3, 3):
        shape = small_parts(dim, random)
        exact = mass_properties(shape, 1.0)
        assert exact.error == 0
        assert exact.mass == pytest.approx(sum(same(part)[0] for part in shape.parts) / 1000)
        cells = _of_cells(shape, 1e-2)  # what is above 1 % is refused
        assert 0 < cells.error
        assert abs(cells.volume / exact.mass - 1) <= cells.error


def test_sections_and_far_parts():
    """A cone, a triangle, and two balls of 0.1 m that are 8 m apart."""
    cone = mass_properties(Frustum((0.3, 0.0), 0.6, center=(0.0,) * 3, axis=(0.0, 0.0, 1.0)), 1.0)
    mass = math.pi * 0.3**2 * 0.2
    across = 3 / 80 * mass * (4 * 0.3**2 + 0.6**2)
    assert off(cone, mass, (0, 0, -0.15), np.diag([across, across, 0.3 * mass * 0.09])) < 1e-3
    triangle = mass_properties(Polygon(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))), 1.0)
    assert triangle.error == 0 and off(triangle, 0.5, (1 / 3, 1 / 3), 1 / 18) < ROUNDING
    balls = Union((Sphere(0.1, center=(0.0,) * 3), Sphere(0.1, center=(8.0, 0.0, 0.0))))
    mass, _, inertia = same(balls.parts[0])
    both = 2 * np.array(inertia) + 2 * mass * 16 * np.diag([0, 1, 1])
    found = mass_properties(balls, 1000.0)
    assert found.error == 0 and off(found, 2 * mass, (4.0, 0.0, 0.0), both) < ROUNDING


@pytest.mark.parametrize(
    "shape",
    [
        Polygon(HOOK, center=(1.0, -2.0), rotation_deg=30.0),
        Polygon(HOOK[::-1]),
        Prism(HOOK, 0.7, axis="y", center=(1.0, 2.0, 3.0), rotation_deg=(20.0, -30.0, 50.0)),
    ],
)
def test_polygons_are_those_of_their_cells(shape):
    exact, cells = mass_properties(shape, 1.0), _of_cells(shape, 1e-3)
    size = np.sqrt(np.trace(cells.second) / cells.volume)
    assert exact.error == 0 and exact.mass == pytest.approx(0.72 * (0.7 if shape.dim == 3 else 1))
    assert np.abs(exact.center - cells.center).max() < cells.error * size
    trace = np.trace(cells.second)
    tensor = trace if shape.dim == 2 else trace * np.eye(3) - cells.second
    assert np.abs(np.array(exact.inertia) - tensor).max() < cells.error * trace


def test_meshes_are_exact_anywhere():
    """Also 5,000 km from the origin, where 1 nm are lost; with a cavity; and of overlapping parts.

    A square as a sheet is a plate with half round edges and quarters of balls at its corners.
    """
    for at in ((0.0,) * 3, (3.0, 0.0, -1.0), (5e6, 5e5, 0.0)):
        box = Box(size=(0.2, 0.2, 0.2), center=at)
        mesh = Mesh(CORNERS + at, FACES, spacing=0.02)
        found = mass_properties(mesh, 1000.0)
        assert found.error == 0
        bound = 1e-12 if at[0] < 10 else 1e-7
        assert off(found, *same(box)) < bound
        both = np.concatenate([CORNERS, 0.5 * CORNERS]) + at
        hollow = Mesh(both, np.concatenate([FACES, 8 + FACES[:, ::-1]]), spacing=0.02)
        wanted = less(box, Box(size=(0.1, 0.1, 0.1), center=at))
        assert off(mass_properties(hollow, 1000.0), *wanted) < bound
    both = np.concatenate([CORNERS, CORNERS + np.array((0.1, 0.0, 0.0))])
    overlapping = Mesh(both, np.concatenate([FACES, 8 + FACES]), spacing=0.02)
    found = mass_properties(overlapping, 1000.0)
    long = Box(size=(0.3, 0.2, 0.2), center=(0.05, 0.0, 0.0))
    assert off(found, *same(long)) <= found.error <= 2e-3 and found.error > 0
    third = np.concatenate([both, CORNERS + np.array((0.5, 0.0, 0.0))])
    far = Mesh(third, np.concatenate([FACES, 8 + FACES, 16 + FACES]), spacing=0.02)
    wanted = same(long)[0] + same(Box(size=(0.2, 0.2, 0.2)))[0]
    assert abs(mass_properties(far, 1000.0).mass / wanted - 1) <= found.error
    square = Mesh(CORNERS[4:], FACES[2:4] - 4, spacing=0.005, thickness=0.01)
    sheet = mass_properties(square, 1000.0)
    volume = 0.01 * 0.04 + 0.8 * math.pi / 2 * 0.005**2 + 4 / 3 * math.pi * 0.005**3
    assert abs(sheet.mass / (1000 * volume) - 1) <= sheet.error <= 2e-3


NOTHING = {
    "apart": Intersection((Box(size=(0.1, 0.1)), Box(size=(0.1, 0.1), center=(1.0, 0.0)))),
    "all cut out": Difference(Box(size=(0.1, 0.1, 0.1)), Sphere(0.1, center=(0.0,) * 3)),
    "offset too far": Offset(Sphere(0.1, center=(0.0,) * 3), by=-0.11),
}


@pytest.mark.parametrize("shape", NOTHING.values(), ids=NOTHING)
def test_bodies_of_nothing_are_refused(shape):
    for make in (lambda: mass_properties(shape, 1.0), lambda: Body(shape, (0.0,) * shape.dim)):
        with pytest.raises(ValueError, match="must have an inside: it is empty"):
            make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: mass_properties(gr.shapes.HalfSpace((0.0, 1.0)), 1.0), "finite size"),
        (lambda: mass_properties(Box(size=(1.0, 1.0)), -1.0), "density = -1.0"),
        (lambda: mass_properties(Box(size=(1.0, 1.0)), 1.0, tolerance=0.1), "tolerance = 0.1"),
        (
            lambda: mass_properties(Difference(Box(size=(1.0, 1.0)), Box(size=(1.1, 1.1))), 1.0),
            "must have an inside",
        ),
        (
            lambda: mass_properties(
                Intersection((Box(size=(1.0,) * 3), Box(size=(1.0,) * 3, center=APART))), 1.0
            ),
            "it is empty",
        ),
        (lambda: mass_properties(Shell(Box(size=(0.4, 0.3, 0.2)), thickness=5e-5), 1.0), "% only"),
    ],
)
def test_what_is_refused(make, message):
    """Also what is empty, and what is too thin for the cells: walls of 0.05 mm on a box."""
    with pytest.raises(ValueError, match=message):
        make()
