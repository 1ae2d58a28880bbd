"""Triangle meshes as bodies: their sampled distance, their contact, and refused input."""

import builtins

import numpy as np
import pytest

import granular as gr
from granular import _core
from granular.geometry import Box as Region
from granular.geometry import Fill, Grid
from granular.gravity import Gravity
from granular.materials import MuI
from granular.mpm.bodies import Body, Box, Mesh, Motion, Union
from granular.mpm.walls import Wall

CUBE = tuple((x, y, z) for z in (-0.1, 0.1) for y in (-0.1, 0.1) for x in (-0.1, 0.1))
FACES = (
    (0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4),
    (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5),
)  # fmt: skip


@pytest.fixture
def trimesh():
    """The package, if it and the tree that it needs are installed."""
    pytest.importorskip("rtree")
    return pytest.importorskip("trimesh")


@pytest.mark.usefixtures("trimesh")
def test_samples_are_signed_distances():
    """Distance to a cube: exact at samples where it is linear; elsewhere within its curvature."""
    mesh = Body(Mesh(CUBE, FACES, spacing=0.02), (0.3, 0.0, 0.0))
    box = Body(Box((0.2, 0.2, 0.2)), (0.3, 0.0, 0.0))
    x = np.random.default_rng(3).uniform(-0.15, 0.15, (400, 3))
    found, normal = mesh.distance(x + mesh.position)
    wanted, outward = box.distance(x + mesh.position)
    assert abs(found - wanted).max() < 0.01
    face = np.sort(abs(x), axis=1)  # over the middle of a face: linear
    plain = (face[:, 2] > 0.06) & (face[:, 1] < 0.03)
    assert plain.sum() > 3
    np.testing.assert_allclose(found[plain], wanted[plain], rtol=0, atol=1e-12)
    np.testing.assert_allclose(normal[plain], outward[plain], rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, rtol=0, atol=1e-12)
    far = np.array([[1.3, 0.0, 0.0], [0.3, 2.0, 0.01]])
    found, normal = mesh.distance(far)
    np.testing.assert_allclose(found, [0.9, 1.9], rtol=0, atol=1e-12)
    np.testing.assert_allclose(normal, [[1, 0, 0], [0, 1, 0]], rtol=0, atol=1e-12)


def test_error_falls_with_the_spacing(trimesh):
    """The distance of a triangulated ball is curved: the error is of second order."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    vertices = tuple(map(tuple, ball.vertices.tolist()))
    faces = tuple(map(tuple, ball.faces.tolist()))
    x = np.random.default_rng(1).normal(size=(500, 3))
    x *= np.random.default_rng(2).uniform(0.08, 0.12, (500, 1)) / np.linalg.norm(x, axis=1)[:, None]
    errors = []
    for spacing in (0.04, 0.02):
        found, _ = Body(Mesh(vertices, faces, spacing=spacing), (0.0,) * 3).distance(x)
        errors.append(abs(found - (np.linalg.norm(x, axis=1) - 0.1)).mean())
    assert errors[1] < 0.35 * errors[0], errors


def bed(shape):
    motion = Motion(velocity=((0.3, 0.0, -0.4),))
    return gr.Scene(
        name="bed",
        grid=Grid((0.0,) * 3, 0.05, (10, 8, 10)),
        fills=(Fill(Region((0.0,) * 3, (0.5, 0.4, 0.25)), 8),),
        material=MuI(E=1e6),
        scheme=gr.Scheme(transfer="apic", density=gr.ParticleDensity(), dt=4e-4),
        walls=(Wall(2, 0.0, kind="no_slip"),),
        bodies=(Body(shape, (0.2, 0.2, 0.33), motion=motion, friction=0.3),),
        gravity=Gravity((0.0,), ((0.0, 0.0, -9.8),)),
        duration=1.0,
    )


def test_a_mesh_moves_through_a_bed_as_the_box_it_is(tmp_path, trimesh):
    """The mesh moves alone, as a part of a union, and in a record; momentum is tested elsewhere."""
    mesh = Mesh(CUBE, FACES, spacing=0.0125)  # a quarter of a cell
    scenes = [bed(shape) for shape in (mesh, Box((0.2, 0.2, 0.2)), Union((mesh,)))]
    assert gr.Scene.from_json(scenes[0].to_json()) == scenes[0]
    sims = [gr.Simulation(scene, threads=1) for scene in scenes]
    for sim in sims:
        sim.step(100)
    mine, box, union = (sim.bodies[0].impulse for sim in sims)
    assert np.linalg.norm(box) > 1
    assert np.linalg.norm(mine - box) < 0.005 * np.linalg.norm(box)
    assert np.array_equal(mine, union)
    gr.Simulation(scenes[0], threads=1).run(until=0.01, save=tmp_path / "m.h5", every=0.005)
    again = gr.Simulation.resume(tmp_path / "m.h5").run(until=0.02)
    whole = gr.Simulation(scenes[0], threads=1).run(until=0.02, every=0.005)
    assert np.array_equal(again.state.x, whole.state.x)


def test_a_mesh_is_scaled():
    mesh = Mesh(CUBE, FACES, spacing=0.02)
    small = gr.scaling.Froude(length=0.25).scene(bed(mesh)).bodies[0].shape
    assert small == Mesh(tuple(tuple(0.25 * x for x in v) for v in CUBE), FACES, spacing=0.005)


def test_a_file_is_read(tmp_path, trimesh):
    path = tmp_path / "cube.stl"
    trimesh.Trimesh(1000 * np.array(CUBE), FACES).export(path)
    mesh = Mesh.read(path, spacing=0.05, scale=1e-3)
    assert np.abs(mesh.vertices).max() == pytest.approx(0.1)
    assert len(mesh.faces) == 12


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"faces": FACES[:-1]}, "the surface must be closed"),
        ({"faces": (*FACES, FACES[0])}, "the surface must be closed"),
        ({"faces": tuple(face[::-1] for face in FACES)}, "volume -0.008"),
        ({"faces": (FACES[0][::-1], *FACES[1:])}, "closed"),
        ({"faces": ((0, 1, 1), *FACES)}, r"faces\[0\] = \(0, 1, 1\)"),
        ({"faces": ((0, 1, 9), *FACES)}, r"faces\[0\] = 9"),
        ({"vertices": ((0.0, np.nan, 0.0), *CUBE[1:])}, r"vertices\[0\]"),
        ({"spacing": 0.0}, "spacing = 0.0"),
        ({"spacing": 1e-4}, "spacing = 0.0001 must leave"),
    ],
)
def test_bad_surfaces_are_refused(change, message):
    given = {"vertices": CUBE, "faces": FACES, "spacing": 0.02} | change
    with pytest.raises(ValueError, match=message):
        Mesh(**given)


def test_without_trimesh_the_extra_is_named(monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **more):
        if name == "trimesh":
            raise ModuleNotFoundError("No module named 'trimesh'")
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    body = Body(Mesh(CUBE, FACES, spacing=0.031), (0.0,) * 3)
    with pytest.raises(ModuleNotFoundError, match=r"pip install granular\[meshes\]"):
        body.distance(np.zeros((1, 3)))


def test_core_refuses_bad_samples():
    row = Box((0.2, 0.2, 0.2)).rows()
    row[0, 0] = 3
    good, x = np.zeros((3, 4, 5)), np.zeros((2, 3))
    _core.body_distance(row, (good,), x)
    bad_size = row.copy()
    bad_size[0, 14] = 0.0
    for rows, samples in (
        (row, ()), (row, (good, good)), (row, [good]), (row, (good.astype(np.float32),)),
        (row, (good[::2],)), (row, (good * np.nan,)), (row, (np.zeros((1, 4, 5)),)),
        (row, (np.zeros((4, 5)),)), (bad_size, (good,)), (Box((1.0, 1.0)).rows(), (good,)),
    ):  # fmt: skip
        with pytest.raises((TypeError, ValueError)):
            _core.body_distance(rows, samples, x)
