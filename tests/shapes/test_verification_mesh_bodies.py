"""Triangle meshes as bodies: their sampled distance, their contact, and refused input."""

import pickle
import sys

import numpy as np
import pytest
from cube import CORNERS, FACES
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, Box, Fill, Grid, Mesh, Motion, Union, Wall, _core
from granular.shapes import mesh_samples

CUBE, FACES = tuple(map(tuple, CORNERS)), tuple(map(tuple, FACES))
SOUP = np.arange(36).reshape(-1, 3)
WITH_A_WALL = (*FACES, (2, 4, 5), (2, 5, 3))  # from edge to edge, through the middle
TURN, ACROSS = np.repeat(np.linspace(0, 2 * np.pi, 12, endpoint=False), 2), np.tile((-0.3, 0.3), 12)
AWAY = 1 + ACROSS * np.cos(TURN / 2)
STRIP = np.stack([AWAY * np.cos(TURN), AWAY * np.sin(TURN), ACROSS * np.sin(TURN / 2)], axis=1)
MOEBIUS = [
    face
    for k in range(12)
    for a, b, c, d in [(2 * k, 2 * k + 1, *((2 * k + 2, 2 * k + 3) if k < 11 else (1, 0)))]
    for face in [(a, c, b), (b, c, d)]
]


@pytest.fixture
def trimesh():
    """The package, if it is installed."""
    return pytest.importorskip("trimesh")


def in_shell(low, high, n=500):
    """Places at random directions and distances from 0, (n, 3)."""
    x = np.random.default_rng(1).normal(size=(n, 3))
    at = np.random.default_rng(2).uniform(low, high, (n, 1))
    return x * at / np.linalg.norm(x, axis=1)[:, None]


def test_samples_are_signed_distances():
    """Distance to a cube: exact at samples where it is linear; elsewhere within its curvature."""
    mesh = Body(Mesh(CUBE, FACES, spacing=0.02), (0.3, 0.0, 0.0))
    box = Body(Box(size=(0.2, 0.2, 0.2)), (0.3, 0.0, 0.0))
    x = np.random.default_rng(3).uniform(-0.15, 0.15, (400, 3))
    found, normal = mesh.distance(x + mesh.position)
    wanted, outward = box.distance(x + mesh.position)
    assert abs(found - wanted).max() < 0.01
    face = np.sort(abs(x), axis=1)  # over the middle of a face: linear
    plain = (face[:, 2] > 0.06) & (face[:, 1] < 0.03)
    assert plain.sum() > 3
    # samples are floats of 24 bits: 0.03 m to 1e-9 m
    np.testing.assert_allclose(found[plain], wanted[plain], rtol=0, atol=4e-9)
    np.testing.assert_allclose(normal[plain], outward[plain], rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, rtol=0, atol=1e-12)


def test_far_away_the_distance_is_a_lower_bound():
    """Beyond the band it is one, but for the curvature between samples: 2 h^2/8 over 6 h."""
    mesh, box = (
        Body(Mesh(CUBE, FACES, spacing=0.005), (0.0,) * 3),
        Body(Box(size=(0.2,) * 3), (0.0,) * 3),
    )
    x = np.random.default_rng(5).uniform(-0.6, 0.6, (5000, 3))
    found, wanted = mesh.distance(x)[0], box.distance(x)[0]
    assert (np.sign(found) == np.sign(wanted)).all()
    off = (abs(found) - abs(wanted))[abs(wanted) > 6 * 0.005]
    assert off.max() < 0.005 / 24
    near = (abs(wanted) > 6 * 0.005) & (abs(wanted) < 0.06)
    assert (abs(wanted) - abs(found))[near].max() < 5 * 0.005


def test_error_falls_with_the_spacing(trimesh):
    """The distance of a triangulated ball is curved: the error is of second order."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    x, errors = in_shell(0.09, 0.11), []
    for spacing in (0.02, 0.01, 0.005):
        mesh = Body(Mesh(ball.vertices, ball.faces, spacing=spacing), (0.0,) * 3)
        found, normal = mesh.distance(x)
        errors.append(abs(found - (np.linalg.norm(x, axis=1) - 0.1)).mean())
    assert errors[1] < 0.3 * errors[0] and errors[2] < 0.3 * errors[1] + 2e-5, errors
    assert (normal * x).sum(axis=1).min() > 0.999 * 0.09
    assert not mesh.shape.samples()[0][4].any()  # smooth: a ball of 20 spacings has no edges


def test_exact_distances_of_triangles(trimesh):
    """The tree finds what a search through all triangles finds, with the sign of a ray count."""
    torus = trimesh.creation.torus(0.1, 0.04, major_sections=24, minor_sections=12)
    vertices, faces = np.array(torus.vertices), np.array(torus.faces, dtype=np.int32)
    tree = _core.mesh_tree(vertices, faces)
    x = np.random.default_rng(0).uniform(-0.16, 0.16, (300, 3)) * [1, 1, 0.4]
    nearest = [
        np.linalg.norm(
            trimesh.triangles.closest_point(vertices[faces], [place] * len(faces)) - place, axis=1
        ).min()
        for place in x
    ]
    found = _core.mesh_distance(tree, x, True)
    np.testing.assert_allclose(abs(found), nearest, rtol=0, atol=1e-12)
    inside = np.hypot(np.hypot(x[:, 0], x[:, 1]) - 0.1, x[:, 2])
    clear = abs(inside - 0.04) > 0.003  # facets are up to 0.002 m within the torus
    assert ((found < 0) == (inside < 0.04))[clear].all()
    back = np.ascontiguousarray(x[::-1])
    assert np.array_equal(found[::-1], _core.mesh_distance(tree, back, True))


def test_edges_are_known():
    """Samples beside the edges of a cube are marked, those over its faces are not."""
    _, _, block, fine, sharp = Mesh(CUBE, FACES, spacing=0.01).samples()[0]
    assert sharp.any() and sharp.shape == fine.shape and (block >= 0).sum() == len(fine)
    grid, *_ = Mesh(CUBE, FACES, spacing=0.01).samples()[0]
    number, k, j, i = np.nonzero(sharp)
    cell = np.argwhere(block >= 0)[number]
    places = grid[:3] + 0.01 * np.stack(
        [8 * cell[:, 2] + i, 8 * cell[:, 1] + j, 8 * cell[:, 0] + k], axis=1
    )
    off = np.sort(0.1 - abs(places), axis=1)  # the second smallest: distance from the nearest edge
    assert off[:, 1].max() < 0.0201
    for t in np.linspace(-0.1, 0.1, 21):  # all along an edge
        assert np.linalg.norm(places - [0.1, 0.1, t], axis=1).min() < 0.02


def test_a_sheet_has_a_thickness(trimesh):
    """Half a sphere without a lid, as a sheet: the distance from it less half its thickness."""
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.1)
    faces = ball.faces[ball.triangles_center[:, 2] < 0]
    sheet = Body(Mesh(ball.vertices, faces, spacing=0.005, thickness=0.02), (0.0,) * 3)
    x = in_shell(0.085, 0.12)
    x = x[(x[:, 2] < -0.02) & (abs(np.linalg.norm(x, axis=1) - 0.1) > 0.006)]
    found, normal = sheet.distance(x)
    radius = np.linalg.norm(x, axis=1)
    assert abs(found - (abs(radius - 0.1) - 0.01)).max() < 3e-4
    outward = np.sign(radius - 0.1)[:, None] * x / radius[:, None]
    assert (normal * outward).sum(axis=1).min() > 0.99
    within, rim = sheet.distance(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.03]]))[0]
    assert 0.03 <= within <= 0.09  # in a focus: a lower bound
    assert rim == pytest.approx(0.02, abs=0.003)


def bed(shape):
    motion = Motion(velocity=((0.3, 0.0, -0.4),))
    return scene_with(
        grid=Grid((0.0,) * 3, 0.05, (10, 8, 10)),
        fills=(Fill(Box((0.0,) * 3, (0.5, 0.4, 0.25)), 8),),
        scheme=gr.Scheme(transfer="apic", density=gr.ParticleDensity(), dt=4e-4),
        walls=(Wall(2, 0.0, kind="no_slip"),),
        bodies=(Body(shape, (0.2, 0.2, 0.33), motion=motion, friction=0.3),),
    )


def test_a_mesh_moves_through_a_bed_as_the_box_it_is(tmp_path):
    """The mesh moves alone, as a part of a union, and in a record; momentum is tested elsewhere."""
    mesh = Mesh(CUBE, FACES, spacing=0.0125)  # a quarter of a cell
    scenes = [bed(shape) for shape in (mesh, Box(size=(0.2, 0.2, 0.2)), Union((mesh,)))]
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
    whole = gr.Simulation(scenes[0], threads=1).run(until=0.02, every=0.005, monitor=False)
    assert np.array_equal(again.state.x, whole.state.x)


def test_a_mesh_is_scaled():
    mesh = Mesh(CUBE, FACES, spacing=0.02)
    assert mesh != Mesh(CUBE, FACES, spacing=0.03) and hash(mesh) == hash(
        Mesh(CUBE, FACES, spacing=0.02)
    )
    small = gr.scaling.Froude(length=0.25).scene(bed(mesh)).bodies[0].shape
    assert small == Mesh(tuple(tuple(0.25 * x for x in v) for v in CUBE), FACES, spacing=0.005)


@pytest.mark.parametrize("ending", ["stl", "obj", "ply"])
def test_a_file_is_read(tmp_path, trimesh, ending):
    path = tmp_path / f"cube.{ending}"
    trimesh.Trimesh(1000 * np.array(CUBE), FACES).export(path)
    mesh = Mesh.read(path, spacing=0.05, scale=1e-3)
    assert abs(mesh.vertices).max() == pytest.approx(0.1)
    assert len(mesh.vertices) == 8 and len(mesh.faces) == 12
    assert Mesh.read(path, spacing=0.05, scale=1e-3, thickness=0.1).thickness == 0.1
    again = pickle.loads(pickle.dumps(mesh))
    assert again == mesh


def test_samples_are_kept_in_a_folder(tmp_path, monkeypatch):
    """A second process reads them; a damaged file is written anew."""
    monkeypatch.setenv("GRANULAR_CACHE", str(tmp_path / "kept"))
    mesh = Mesh(CUBE, FACES, spacing=0.0271)
    first = mesh.samples()[0]
    (path,) = (tmp_path / "kept").iterdir()
    monkeypatch.setattr(mesh_samples, "_sample", lambda _: pytest.fail("sampled again"))
    for damage in (None, b"x" * 300):
        mesh_samples._KEPT.clear()
        if damage:
            path.write_bytes(damage)
            monkeypatch.undo()
            monkeypatch.setenv("GRANULAR_CACHE", str(tmp_path / "kept"))
        assert all(map(np.array_equal, mesh.samples()[0], first))
    assert path.stat().st_size > 1000


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"faces": FACES[:-1]}, "the surface must be closed"),
        ({"faces": (FACES[0], FACES[0][::-1])}, "a sheet needs a thickness"),
        ({"faces": (*FACES, (0, 1, 8)), "vertices": (*CUBE, (0.0, 0.0, 0.0))}, "one triangle"),
        ({"vertices": np.array(CUBE)[np.ravel(FACES)], "faces": SOUP}, "28 vertices lie where"),
        ({"vertices": STRIP, "faces": MOEBIUS}, "no common orientation"),
        ({"faces": WITH_A_WALL}, "belongs to 3 triangles, . of them in this direction"),
        ({"spacing": 0.11}, r"spacing = 0.11 must be <= 0.1 m, half the least edge"),
        ({"faces": ((0, 1, 1), *FACES)}, r"faces\[0\] = \[0, 1, 1\]"),
        ({"faces": ((0, 1, 9), *FACES)}, r"faces\[0\] = \[0, 1, 9\]"),
        ({"faces": ()}, "must hold a surface"),
        ({"faces": ((0.0, 1.0, 2.0),)}, "must hold indices"),
        ({"vertices": ((0.0, np.nan, 0.0), *CUBE[1:])}, r"vertices\[0, 1\] = nan"),
        ({"vertices": np.zeros((8, 2))}, r"shape \(8, 2\)"),
        ({"vertices": [["a"] * 3] * 8}, "real numbers"),
        ({"spacing": 0.0}, "spacing = 0.0"),
        ({"spacing": 1e-5}, "spacing = 1e-05 must leave"),
        ({"thickness": 0.03}, "thickness = 0.03 must be >= 2 spacings"),
        ({"thickness": -1.0}, "thickness = -1.0"),
    ],
)
def test_bad_surfaces_are_refused(change, message):
    given = {"vertices": CUBE, "faces": FACES, "spacing": 0.02} | change
    with pytest.raises((TypeError, ValueError), match=message):
        Mesh(**given)


@pytest.mark.parametrize("share", [0.5, 0.0])
def test_flat_triangles_do_no_harm(share):
    """A vertex on an edge or at its end, with a triangle without area that closes the surface."""
    vertices = (*CUBE, (0.2 * share - 0.1, -0.1, -0.1))  # on the edge from 0 to 1
    faces = [face for face in FACES if face != (0, 2, 1)] + [(0, 2, 8), (8, 2, 1), (0, 8, 1)]
    flat, box = (
        Body(Mesh(vertices, faces, spacing=0.01), (0.0,) * 3),
        Body(Box(size=(0.2,) * 3), (0.0,) * 3),
    )
    x = np.random.default_rng(3).uniform(-0.15, 0.15, (2000, 3))
    found, wanted = flat.distance(x)[0], box.distance(x)[0]
    assert abs(found - wanted).max() < 0.005


def test_without_trimesh_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    (tmp_path / "a.stl").write_bytes(b"solid")
    with pytest.raises(ModuleNotFoundError, match=r"pip install granular-flow\[meshes\]"):
        Mesh.read(tmp_path / "a.stl", spacing=0.1)


def test_core_refuses_bad_tables():
    row = Mesh(CUBE, FACES, spacing=0.02).rows()
    good, x = Mesh(CUBE, FACES, spacing=0.05).samples()[0], np.zeros((2, 3))
    _core.body_distance(row, (good,), x)
    wild = good[2].copy()
    wild[:] = 10**9  # numbers of blocks that there are not
    assert np.isfinite(_core.body_distance(row, ((*good[:2], wild, *good[3:]),), x)[0]).all()
    for k, table in enumerate(good):
        for bad in (
            table[:-1],
            table.astype(np.int16),
            table.tolist(),
            table[..., None],
            table * 1j,
        ):
            with pytest.raises((TypeError, ValueError)):
                _core.body_distance(row, ((*good[:k], bad, *good[k + 1 :]),), x)
        if k in (0, 1, 3):
            with pytest.raises(ValueError):
                _core.body_distance(
                    row, ((*good[:k], table * np.float32(np.nan), *good[k + 1 :]),), x
                )
    for samples in ((), (good, good), [good], (list(good),), (good[:4],), good):
        with pytest.raises((TypeError, ValueError)):
            _core.body_distance(row, samples, x)
    v, f = np.array(CUBE), np.array(FACES, dtype=np.int32)
    for given in (
        (v, f + 1), (v, f - 1), (v * np.nan, f), (v, f[:0]), (v, f.astype(np.int64)), (v[:, :2], f),
        (None, f), (v,),
    ):  # fmt: skip
        with pytest.raises((TypeError, ValueError)):
            _core.mesh_tree(*given)
    tree, r = _core.mesh_tree(v, f), np.ones(len(x))
    for function, given in (
        (_core.mesh_distance, (object(), x, True)), (_core.mesh_distance, (tree, x * np.nan, True)),
        (_core.mesh_winding, (object(), x)), (_core.mesh_winding, (tree, x[:, :2])),
        (_core.mesh_clear, (tree, x, r[1:])), (_core.mesh_clear, (tree, x, -r)),
        (_core.mesh_clear, (tree, x, r * np.nan)), (_core.mesh_clear, (object(), x, r)),
    ):  # fmt: skip
        with pytest.raises((TypeError, ValueError)):
            function(*given)
