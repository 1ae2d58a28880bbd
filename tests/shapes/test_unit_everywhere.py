"""Every shape as fill, inflow, body, place of a measure, picture and part of a record."""

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.export.surfaces import surface

CELLS = {2: 0.05, 3: 0.1}
CORNERS = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)])
FACES = [
    (0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4),
    (2, 6, 7), (2, 7, 3), (0, 4, 6), (0, 6, 2), (1, 3, 7), (1, 7, 5),
]  # fmt: skip


def shapes_of(dim):
    """Shapes about the middle of a box of edge 1, by name; none reaches beyond it."""
    middle, up = (0.5,) * dim, (0.0,) * (dim - 1) + (1.0,)
    about = {"center": middle, "axis": up}
    box = gr.Box((0.2,) * dim, (0.8,) * dim)
    ball = gr.Sphere(0.3, center=middle)
    level = np.full((3,) * (dim - 1), 0.5)
    found = {
        "box": box,
        "turned box": gr.Box(
            size=(0.5, 0.3, 0.4)[:dim],
            center=middle,
            rotation_deg=30.0 if dim == 2 else (0.0, 30.0, 10.0),
        ),
        "ball": ball,
        "capsule": gr.Capsule(0.2, 0.3, **about),
        "cone": gr.Frustum((0.1, 0.3), 0.5, **about),
        "hopper": gr.Frustum((0.1, 0.2), 0.5, thickness=0.15, **about),
        "revolved": gr.Revolve([(0.0, -0.3), (0.3, -0.1), (0.1, 0.3), (0.0, 0.3)], **about),
        "half-space": gr.Intersection((gr.HalfSpace(up, through=middle), box)),
        "height map": gr.Intersection((gr.HeightMap(level, 0.5, origin=(0.0,) * (dim - 1)), box)),
        "difference": gr.Difference(box, gr.Sphere(0.2, center=middle)),
        "offset": gr.Offset(gr.Box((0.4,) * dim, (0.6,) * dim), by=0.2),
        "shell": gr.Shell(gr.Sphere(0.2, center=middle), thickness=0.15),
    }
    if dim == 2:
        corners = [(0.2, 0.2), (0.8, 0.2), (0.8, 0.6), (0.5, 0.4), (0.2, 0.8)]
        return found | {
            "disc": gr.Cylinder(0.3, center=middle),
            "polygon": gr.Polygon(corners),
            "union": gr.Union((box, gr.Sphere(0.2, center=(0.8, 0.5)))),
            "complement": gr.Intersection((gr.Complement(ball), box)),
            "bent wall": gr.Polygon([(0.3, 0.3), (0.5, 0.6), (0.7, 0.3)], thickness=0.15),
        }
    triangle = [(-0.3, -0.3), (0.3, -0.3), (0.0, 0.3)]
    return found | {
        "cylinder": gr.Cylinder(0.3, length=0.5, **about),
        "torus": gr.Torus(0.25, 0.12, **about),
        "prism": gr.Prism(triangle, 0.5, axis="y", center=middle),
        "mesh": gr.Mesh(0.2 + 0.6 * CORNERS, FACES, spacing=0.0125),
    }


CASES = [
    pytest.param(shape, id=f"{name} in {dim}D")
    for dim in (2, 3)
    for name, shape in shapes_of(dim).items()
]


def scene_of(dim, fills, **more):
    return scene_with(
        grid=gr.Grid((0.0,) * dim, CELLS[dim], (round(1.0 / CELLS[dim]),) * dim),
        fills=fills,
        **more,
    )


@pytest.mark.parametrize("shape", CASES)
def test_every_shape_everywhere(shape):
    dim = shape.dim
    volume = gr.bodies.mass_properties(shape, 1.0).mass
    fill = gr.Fill(shape, 2**dim)
    scene = scene_of(dim, (fill,))
    assert gr.Scene.from_json(scene.to_json()) == scene
    state = gr.Simulation(scene, threads=1).state
    assert state.mass.sum() == pytest.approx(volume * scene.material.rho_c, rel=0.01)
    assert (shape.distance(state.x)[0] < 1e-3 * CELLS[dim]).all()
    low, high = shape.bounds
    assert (state.x > low).all() and (state.x < high).all()
    assert state.within(shape).n >= 0.99 * state.n
    bed = gr.Fill(gr.Box((0.0,) * dim, (*(1.0,) * (dim - 1), 0.2)), 2**dim)
    inflow = gr.Inflow(shape, (0.0,) * (dim - 1) + (-1.0,), 2**dim, driven=False)
    fed = scene_of(dim, (bed,), inflows=(inflow,))
    assert gr.Scene.from_json(fed.to_json()) == fed
    across = [high[axis] - low[axis] for axis in range(dim - 1)]
    assert 0.5 * np.prod(across) < inflow.area(fed.grid) < 1.2 * np.prod(across)

    moved = scene_of(dim, (bed,), bodies=(gr.Body(shape, (0.0,) * (dim - 1) + (0.02,)),))
    sim = gr.Simulation(moved, threads=1)
    sim.step(2)
    assert np.isfinite(sim.state.v).all()
    vertices, polygons = surface(shape, dim, 1.0)
    assert len(vertices) and len(polygons)
    for drawn in (scene, moved):
        assert gr.plot.scene(drawn).axes


def test_a_state_within_a_shape_is_that_of_its_points():
    scene = scene_of(2, (gr.Fill(gr.Box((0.0, 0.0), (1.0, 0.5)), 4),))
    state = gr.Simulation(scene, threads=1).state
    part = state.within(gr.Box((0.0, 0.0), (0.5, 0.5)))
    assert part.n == state.n // 2 and part.mass.sum() == pytest.approx(0.5 * state.mass.sum())
    assert part.time == state.time and set(part.fields) == set(state.fields)
    with pytest.raises(ValueError, match=r"must have the shape \(n, 3\)"):
        state.within(gr.Sphere(0.1, center=(0.0, 0.0, 0.0)))
    with pytest.raises(TypeError, match="region = 'x' must be a Region"):
        state.within("x")


def strip(low, high):
    return gr.Polygon([(0.1, low), (0.9, low), (0.9, high), (0.1, high)])


def seeded(*regions):
    return scene_of(2, [gr.Fill(region, 4) for region in regions]).points().volume.sum()


def test_fills_that_overlap_by_less_than_a_spacing_are_refused():
    """Points have 0.025 m; fills that touch, also on a slope or by rounding, do not overlap."""
    assert seeded(strip(0.1, 0.5), strip(0.5, 0.9)) == pytest.approx(0.64, rel=1e-6)
    third = 1.0 / 3.0
    a, b, c, d = ((third + x, third + y) for x, y in ((0, 0), (0.4, 0), (0.4, 0.4), (0, 0.4)))
    assert seeded(gr.Polygon([a, b, c]), gr.Polygon([a, c, d])) == pytest.approx(0.16, rel=0.01)
    discs = (gr.Sphere(0.2, center=(x, 0.5)) for x in (0.3, 0.695))
    for regions in (
        (strip(0.1, 0.51), strip(0.49, 0.9)),
        (strip(0.1, 0.2), strip(0.1, 0.2)),
        discs,
    ):
        with pytest.raises(ValueError, match="must not overlap"):
            seeded(*regions)


def test_operations_follow_boxes_that_end_between_grid_lines():
    sphere = gr.Sphere(0.15, center=(0.5, 0.41))
    cut = gr.Intersection((gr.Box((0.0, 0.0), (1.0, 0.41)), sphere))
    assert seeded(cut) == pytest.approx(gr.bodies.mass_properties(cut, 1.0).mass, rel=1e-3)
    cloud = gr.Cloud(np.array([[0.5, 0.5]]), 0.04)
    assert seeded(gr.Intersection((cloud, gr.Box((0.0, 0.0), (1.0, 1.0))))) == pytest.approx(0.04)


def test_what_is_not_known_of_a_shape_is_refused():
    heights = gr.HeightMap(np.array([0.2, 0.4, 0.3]), 0.25, origin=(0.0,))
    with pytest.raises(ValueError, match="a larger map or extended=True"):
        seeded(gr.Intersection((heights, gr.Box((0.0, 0.0), (1.0, 1.0)))))
    cube = gr.Mesh(0.2 + 0.6 * CORNERS, FACES, spacing=0.0125)
    with pytest.raises(ValueError, match=r"by = 0.2 must be at most 0.075 m from a mesh"):
        gr.Offset(cube, by=0.2)


def test_a_shape_without_a_drawing_of_its_own_is_drawn_from_its_distance():
    capsule = gr.Capsule(0.1, 0.3, center=(0.5, 0.5, 0.5), axis=(0.0, 1.0, 1.0))

    class Pill(gr.shapes.Shape):
        """A new shape: all that is known of it are its rows and boxes."""

        dim = 3
        rows = staticmethod(capsule.rows)
        covers = staticmethod(capsule.covers)

    vertices, polygons = surface(Pill(), 3, 2.0)
    assert len(polygons) > 100
    assert np.abs(capsule.distance(vertices)[0]).max() < 1e-3
