"""Bodies of a record in the reader of ParaView: where the signed distance is zero."""

import h5py
import numpy as np
import pytest
from oracle_body_shapes import SOLIDS
from paraview_reader import as_array, paraview
from scenes_by_hand import scene_with
from scipy.stats import qmc

import granular as gr
from granular import Body, Fill, Grid, Motion
from granular.export.surfaces import marked_surface, surface
from granular.shapes import (
    Box,
    Capsule,
    Complement,
    Cylinder,
    Difference,
    Frustum,
    HalfSpace,
    Mesh,
    Polygon,
    Revolve,
    Sphere,
    Union,
)


def bodies_of(dim):
    """One body of each kind, some of them moving."""
    turning = (0.0, 3.0) if dim == 2 else ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    velocity = ((0.0,) * dim, (0.5,) * dim)
    motion = Motion(times=(0.0, 0.05), velocity=velocity, angular_velocity=turning)
    axis = None if dim == 2 else (1.0, 1.0, 0.3)
    length = np.inf if dim == 2 else 0.2
    tilt = 20.0 if dim == 2 else (20.0, 0.0, 10.0)
    parts = (
        Box(size=(0.1, 0.2, 0.15)[:dim], center=(0.05,) * dim, rotation_deg=tilt),
        Cylinder(0.05, center=(0.3,) * dim, axis=axis, length=length),
    )
    return (
        Body(Union(parts), (0.2,) * dim, motion=motion),
        Body(Cylinder(0.9, center=(0.0,) * dim, axis=axis, inside=True), (0.3,) * dim),
        Body(HalfSpace((0.0,) * (dim - 1) + (1.0,)), (0.0,) * dim),
    )


@pytest.fixture
def recorded(tmp_path):
    def run(dim, bodies):
        scene = scene_with(
            grid=Grid((0.0,) * dim, 0.1, (6,) * dim),
            fills=(Fill(Box((0.0,) * dim, (0.5,) * dim), 2**dim),),
            scheme=gr.Scheme(transfer="apic", density=gr.ParticleDensity()),
            bodies=bodies,
        )
        sim = gr.Simulation(scene, threads=1)
        sim.run(until=0.05, save=tmp_path / "a.h5", every=0.02, overwrite=True)
        return gr.open(tmp_path / "a.h5")

    return run


def moved(body, numbers, dim):
    """The body as if it started from its position in a frame."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(numbers[[4, 5, 6, 3]]).as_rotvec(degrees=True)
    rotation = float(turn[2]) if dim == 2 else tuple(turn)
    return Body(body.shape, tuple(numbers[:dim]), rotation_deg=rotation)


def test_paraviews_reader_sees_the_bodies_where_they_are(recorded, tmp_path, dim):
    with recorded(dim, bodies_of(dim)) as record:
        path = gr.export.write_bodies(record, tmp_path / "b.vtkhdf")
        assert len(record) == 4
        frames = zip(record.times, paraview(path), strict=True)
        for i, (time, (seen_at, data)) in enumerate(frames):
            assert seen_at == time
            owner = as_array(data.GetCellData().GetArray("body"))
            assert data.GetNumberOfPolys() == len(owner) and set(owner) == {0, 1, 2}
            for k, body in enumerate(record.scene.bodies):
                ids = set()
                for c in np.flatnonzero(owner == k):
                    cell = data.GetCell(int(c))  # the reader reuses this object for the next cell
                    ids |= {cell.GetPointId(j) for j in range(cell.GetNumberOfPoints())}
                x = np.array([data.GetPoint(j) for j in sorted(ids)])
                at = np.ascontiguousarray(x[:, :dim])
                distance, _ = moved(body, record.bodies[i, k], dim).distance(at)
                # the far side of 2D strips is in the solid
                assert distance.max() == pytest.approx(0.0, abs=1e-9)
                if dim == 3 and k != 0:
                    assert np.abs(distance).max() < 1e-9


def test_faces_of_a_box_are_its_sides(recorded, tmp_path):
    """Each face lies in one plane, and all six together have the area of the box."""
    box = Body(Box(size=(0.1, 0.2, 0.3)), (0.3, 0.3, 0.8))
    with recorded(3, (box,)) as record:
        path = gr.export.write_bodies(record, tmp_path / "b.vtkhdf")
    _, data = next(paraview(path))
    area = 0.0
    for c in range(data.GetNumberOfCells()):
        cell = data.GetCell(c)
        a, b, _, d = (np.array(data.GetPoint(cell.GetPointId(j))) for j in range(4))
        area += np.linalg.norm(np.cross(b - a, d - a))
    assert area == pytest.approx(2 * (0.02 + 0.03 + 0.06))


@pytest.mark.parametrize(
    ("shape", "area", "dim"),
    [
        (gr.shapes.wheel(0.2, 0.1, grousers=8, height=0.02, thickness=0.02), None, 3),
        (gr.Sphere(0.1, center=(0.0, 0.0, 0.0)), 4 * np.pi * 0.1**2, 3),
        (Box(size=(0.1, 0.2)), 0.1 * 0.2, 2),
    ],
    ids=["wheel", "ball", "box"],
)
def test_every_other_sector_of_a_body_that_turns_is_marked(shape, area, dim):
    """The surface stays what it is, and half of it is marked, in parts that meet in the middle."""
    turning = 1.0 if dim == 2 else (0.0, 1.0, 0.0)
    still = Body(shape, (0.0,) * dim)
    body = still.replace(motion=Motion(angular_velocity=turning))
    before, mark = marked_surface(still, dim, 1.0)
    assert not still.turns and not mark.any() and len(mark) == len(before[1])
    (vertices, polygons), mark = marked_surface(body, dim, 1.0)
    areas = np.array([area_of(vertices[list(polygon)]) for polygon in polygons])
    whole = sum(area_of(before[0][list(polygon)]) for polygon in before[1])
    assert areas.sum() == pytest.approx(whole, rel=1e-12)
    assert area is None or whole == pytest.approx(area, rel=3e-3)
    assert areas[mark == 1].sum() == pytest.approx(whole / 2, rel=1e-9)
    for polygon in polygons:
        ends = np.sign(np.round(vertices[list(polygon)], 9))
        assert (ends.min(axis=0) * ends.max(axis=0) >= 0).all()


def area_of(corners):
    """Area of a plane polygon."""
    arms = corners - corners[0]
    return np.linalg.norm(np.cross(arms[1:-1], arms[2:]).sum(axis=0)) / 2


def test_a_mesh_is_drawn_as_it_is():
    """A mesh is drawn with its own triangles, also in a union with a box."""
    corner = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    mesh = Mesh(corner, faces, spacing=0.1)
    vertices, polygons = surface(mesh, 3, 1.0)
    assert vertices.tolist() == [list(place) for place in corner] and polygons == list(faces)
    vertices, polygons = surface(Union((Box(size=(1.0, 1.0, 1.0)), mesh)), 3, 1.0)
    assert len(vertices) == 12 and polygons[6:] == [tuple(8 + i for i in face) for face in faces]


def test_a_run_for_paraview_writes_its_bodies_beside_the_record(tmp_path, monkeypatch):
    """They are there when the run ends, also after Ctrl-C and for a run that goes on."""
    monkeypatch.chdir(tmp_path)
    scene = gr.scenes.penetration(cell=0.04, duration=0.06, headroom=0.2)
    with pytest.raises(KeyboardInterrupt):
        gr.Simulation(scene).run(save="a.vtkhdf", every=0.02, hooks=[interrupt_after(0.03)])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.vtkhdf", "a_bodies.vtkhdf"]
    assert len(list(paraview("a_bodies.vtkhdf"))) == 3
    gr.Simulation.resume("a.vtkhdf").run(0.06)
    heights = [data.GetBounds()[2] for _, data in paraview("a_bodies.vtkhdf")]
    with gr.open("a.vtkhdf") as record:
        assert len(heights) == len(record) == 4
        assert np.ptp(heights - record.bodies[:, 0, 1]) < 1e-12 < np.ptp(heights)
    with pytest.raises(FileExistsError, match=r"a_bodies\.vtkhdf exists already"):
        (tmp_path / "a.vtkhdf").unlink()
        gr.Simulation(scene).run(until=0.01, save="a.vtkhdf")
    gr.Simulation(scene).run(until=0.01, save="a.h5")
    gr.Simulation(scene.replace(bodies=())).run(until=0.01, save="b.vtkhdf")
    assert not list(tmp_path.glob("b_*"))


def interrupt_after(time):
    def hook(sim):
        if sim.time > time:
            raise KeyboardInterrupt

    return hook


def test_bodies_that_stand_still_are_stored_once(recorded, tmp_path):
    with recorded(2, (bodies_of(2)[2],)) as record:
        path = gr.export.write_bodies(record, tmp_path / "b.vtkhdf")
        assert len(list(paraview(path))) == len(record) == 4
    shown = {tuple(data.GetBounds()) for _, data in paraview(path)}
    assert len(shown) == 1
    with h5py.File(path) as file:
        assert len(file["VTKHDF/Points"]) == 4


def test_what_is_refused(recorded, tmp_path):
    with recorded(2, bodies_of(2)) as record:
        gr.export.write_bodies(record, tmp_path / "b.vtkhdf")
        with pytest.raises(FileExistsError):
            gr.export.write_bodies(record, tmp_path / "b.vtkhdf")
        gr.export.write_bodies(record, tmp_path / "b.vtkhdf", overwrite=True)
    with recorded(2, ()) as record, pytest.raises(ValueError, match="must have bodies"):
        gr.export.write_bodies(record, tmp_path / "c.vtkhdf")


HOLLOW = Difference(Box(size=(0.3, 0.3, 0.2)), Sphere(0.1, center=(0.05, 0.0, 0.1)))
RING = Revolve([(0.1, 0), (0.2, 0.1)], center=(0.0, 0.0), axis=(0.3, 1.0), thickness=0.04)
FLAT = {
    "polygon": Polygon([(0, 0), (0.3, 0), (0.3, 0.3), (0.15, 0.1), (0, 0.3)], rotation_deg=20.0),
    "wall": Polygon([(-0.2, 0.2), (0, 0), (0.3, 0.1)], thickness=0.05),
    "hopper": Frustum((0.05, 0.2), 0.3, center=(0.0, 0.0), axis=(0.2, 1.0), thickness=0.04),
    "ring": RING,
    "capsule": Capsule(0.1, 0.2, center=(0.1, 0.1), axis=(1.0, 1.0)),
    "vessel": Difference(Box(size=(0.5, 0.5)), Union((RING, Cylinder(0.1, center=(0.15, 0.1))))),
}
DRAWN = {name: solid.shape for name, solid in SOLIDS.items()} | FLAT | {"hollow": HOLLOW}


@pytest.mark.parametrize("shape", DRAWN.values(), ids=DRAWN)
def test_what_is_drawn_is_the_surface_of_the_solid(shape):
    """Its vertices lie on it, and it encloses the volume (in 2D it has the area) of the solid."""
    dim = shape.dim
    vertices, polygons = surface(shape, dim, 2.0)
    distance = shape.distance(np.ascontiguousarray(vertices[:, :dim]))[0]
    inner = dim == 2 and shape is FLAT["vessel"]  # its area is made of small cells
    assert (distance.max() if inner else abs(distance).max()) < 1e-9
    triangles = np.array([(p[0], *p[k : k + 2]) for p in polygons for k in range(1, len(p) - 1)])
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    drawn = (
        np.cross(b - a, c - a)[:, 2] / 2
        if dim == 2
        else np.einsum("nd,nd->n", a, np.cross(b, c)) / 6
    )
    x = qmc.Sobol(dim, rng=1).random_base2(18) - 0.5
    share = (shape.distance(x)[0] < 0).mean()
    found = abs(drawn).sum() if dim == 2 else abs(drawn.sum())
    assert found == pytest.approx(share, rel=0.01)


def test_unbounded_solids_are_drawn_as_a_skin():
    vertices, polygons = surface(Complement(FLAT["polygon"]), 2, 1.0)
    distance = Complement(FLAT["polygon"]).distance(np.ascontiguousarray(vertices[:, :2]))[0]
    assert distance.max() < 1e-9 and distance.min() > -0.06 and len(polygons) > 100
