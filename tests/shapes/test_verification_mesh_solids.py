"""Solids of meshes of several parts, as CAD gives them: signs, mending, thickness, files."""

import warnings
import zipfile
from functools import partial

import numpy as np
import pytest
from cube import CORNERS, FACES
from scenes_by_hand import scene_with
from scipy.spatial.transform import Rotation

import granular as gr
from granular import Body, Box, Mesh, Union
from granular.shapes import MeshWarning

TURN = Rotation.from_rotvec((0.3, 0.5, 0.7)).as_matrix()


def joined(*parts):
    """One mesh of several: vertices and faces."""
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [faces + n for (_, faces), n in zip(parts, counts, strict=False)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def block(size, center=(0.0,) * 3, turn=None, *, inside_out=False):
    vertices = 5 * CORNERS * np.broadcast_to(size, 3)
    vertices = vertices if turn is None else vertices @ turn.T
    return vertices + center, FACES[:, ::-1] if inside_out else FACES


def disc(radius, length, sides=48):
    """A prism of many sides about z."""
    angle = 2 * np.pi * np.arange(sides) / sides
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rims = [np.column_stack([ring, np.full(sides, z)]) for z in (-length / 2, length / 2)]
    vertices = np.concatenate([*rims, [[0, 0, -length / 2], [0, 0, length / 2]]])
    k, n = np.arange(sides), (np.arange(sides) + 1) % sides
    low, high = np.full(sides, 2 * sides), np.full(sides, 2 * sides + 1)
    faces = [
        (k, n, n + sides),
        (k, n + sides, k + sides),
        (n, k, low),
        (k + sides, n + sides, high),
    ]
    return vertices, np.concatenate([np.stack(three, axis=1) for three in faces])


def ring(radius, tube, major=40, minor=24):
    """A torus about z, which crosses itself where the tube is wider than the hole."""
    u, v = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in (major, minor)), indexing="ij")
    away = radius + tube * np.cos(v)
    vertices = np.stack([away * np.cos(u), away * np.sin(u), tube * np.sin(v)], axis=2)
    i, j = np.indices((major, minor))
    a, b = i * minor + j, (i + 1) % major * minor + j
    c, d = (i + 1) % major * minor + (j + 1) % minor, i * minor + (j + 1) % minor
    faces = np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 3)
    return vertices.reshape(-1, 3), faces


def winding(vertices, faces, x):
    """Winding numbers by the sum over all triangles."""
    a, b, c = (vertices[faces[:, k]] - x[:, None] for k in range(3))
    p, q, r = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    over = np.einsum("nfi,nfi->nf", a, np.cross(b, c))
    below = p * q * r + (a * b).sum(2) * r + (b * c).sum(2) * p + (c * a).sum(2) * q
    return np.arctan2(over, below).sum(axis=1) / (2 * np.pi)


def goes_around(vertices, faces, x):
    return winding(vertices, faces, x) > 0.5


def places(count, far, seed=1):
    return np.random.default_rng(seed).uniform(-far, far, (count, 3))


def in_block(x, size, center=(0.0,) * 3, turn=None):
    own = x - center
    own = own if turn is None else own @ turn
    return (abs(own) < np.broadcast_to(size, 3) / 2).all(axis=1)


def lug(k):
    """Size, place and rotation of one of 12 blocks that are sunk in the rim of a wheel."""
    turn = Rotation.from_rotvec((0, 0, k * np.pi / 6)).as_matrix()
    return (0.08, 0.03, 0.1), turn @ (0.2, 0.0, 0.0), turn


def on_wheel(x):
    angle = np.arctan2(x[:, 1], x[:, 0]) % (2 * np.pi / 48) - np.pi / 48
    away = np.hypot(x[:, 0], x[:, 1]) * np.cos(angle)
    hub = (away < 0.2 * np.cos(np.pi / 48)) & (abs(x[:, 2]) < 0.05)
    return hub | np.any([in_block(x, *lug(k)) for k in range(12)], axis=0)


PLATES = [  # a bucket: a floor, a back, two sides, and three teeth that are sunk in the floor
    ((0.4, 0.3, 0.03), (0.0, 0.0, -0.1)),
    ((0.03, 0.3, 0.2), (-0.185, 0.0, 0.0)),
    ((0.4, 0.03, 0.2), (0.0, -0.14, 0.0)),
    ((0.4, 0.03, 0.2), (0.0, 0.14, 0.0)),
    *(((0.08, 0.03, 0.02), (0.22, y, -0.1)) for y in (-0.1, 0.0, 0.1)),
]


def in_plates(x):
    return np.any([in_block(x @ TURN, *plate) for plate in PLATES], axis=0)


IDLE = "1 of 2 closed parts lie"
RING = ring(0.1, 0.14, 24, 12)
WHEEL = joined(disc(0.2, 0.1), *(block(*lug(k)) for k in range(12)))
BUCKET = joined(*(block(size, TURN @ at, TURN) for size, at in PLATES))
SOLIDS = {
    "overlap": (
        joined(block(0.2), block(0.2, (0.1, 0.05, 0.03))),
        lambda x: in_block(x, 0.2) | in_block(x, 0.2, (0.1, 0.05, 0.03)),
        None,
    ),
    "nested": (
        joined(block(0.2), block(0.1)),
        lambda x: in_block(x, 0.2),
        "1 of 2 closed parts lie",
    ),
    "cavity": (
        joined(block(0.3), block(0.1, inside_out=True)),
        lambda x: in_block(x, 0.3) & ~in_block(x, 0.1),
        None,
    ),
    "part in a cavity": (
        joined(block(0.4), block(0.3, inside_out=True), block(0.1, inside_out=True)),
        lambda x: in_block(x, 0.4) & ~in_block(x, 0.3) | in_block(x, 0.1),
        "reversed 1 of 3 closed parts",
    ),
    "filled cavity": (
        joined(block(0.3), block(0.1, inside_out=True), block(0.2, (0.2, 0.0, 0.0))),
        lambda x: in_block(x, 0.3) & ~in_block(x, 0.1) | in_block(x, 0.2, (0.2, 0.0, 0.0)),
        None,
    ),
    "all inside out": (
        joined(block(0.3, inside_out=True), block(0.1)),
        lambda x: in_block(x, 0.3) & ~in_block(x, 0.1),
        "reversed 2 of 2 closed parts",
    ),
    "one of three": (
        joined(block(0.2), block(0.2, (0.15, 0, 0), inside_out=True), block(0.2, (0.3, 0, 0))),
        lambda x: in_block(x, (0.5, 0.2, 0.2), (0.15, 0.0, 0.0)),
        "reversed 1 of 3 closed parts",
    ),
    "touching": (
        joined(block(0.2), (np.array([(0.2, 0, 0)]) + CORNERS, FACES)),
        lambda x: in_block(x, (0.4, 0.2, 0.2), (0.1, 0.0, 0.0)),
        "left out 4 of 24 triangles",
    ),
    "wheel": (WHEEL, on_wheel, None),
    "bucket": (BUCKET, in_plates, None),
    "crossing itself": (RING, None, None),
}


def made(vertices, faces, warning=None, **options):
    """A mesh of merged vertices, with a warning or none."""
    vertices, same = np.unique(vertices.round(12), axis=0, return_inverse=True)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        mesh = Mesh(vertices, same.ravel()[faces], **options)
    assert [str(w.message) for w in said if w.category is not MeshWarning] == []
    assert (warning in str(said[0].message)) if warning else not said
    return mesh


@pytest.mark.parametrize(("surface", "contains", "warning"), SOLIDS.values(), ids=SOLIDS)
def test_signs_are_those_of_the_solid(surface, contains, warning):
    """Exact ones of random places, and sampled ones but for edges rounded by a spacing.

    The distance is that of the nearest surface that is not within the solid: outside exact, inside
    a bound, which walls within other parts do not bring to zero.
    """
    mesh, count = made(*surface, warning, spacing=0.01), 4000 if contains else 600
    if contains is None:
        contains = partial(goes_around, *surface)
    x, away = places(count, 0.35), places(count, 1.0, seed=2)
    inside, exact = contains(x), mesh.triangles().distance(x)
    assert np.array_equal(exact < 0, inside)
    wrong = (mesh.distance(x)[0] < 0) != inside
    assert abs(exact[wrong]).max(initial=0.0) < 0.01 and wrong.mean() < 0.005
    # no place of other sign is nearer than the distance says
    away *= (0.999 * abs(exact) / np.linalg.norm(away, axis=1))[:, None]
    assert np.array_equal(contains(x + away), inside)
    # what was mended stays as it is
    again = made(mesh.vertices, mesh.faces, warning if warning == IDLE else None, spacing=0.01)
    assert len(again.faces) == len(mesh.faces)
    assert np.array_equal(again.triangles().distance(x), exact)


def test_distances_of_a_union_are_those_of_its_shapes():
    """Outside to round-off; inside the greatest depth in one of them."""
    parts = (0.2, (0.0, 0.0, 0.0)), (0.2, (0.1, 0.05, 0.03)), (0.1, (-0.1, 0.0, 0.0))
    mesh = made(*joined(*(block(size, at) for size, at in parts)), spacing=0.01)
    union, x = Union([Box(size=(size,) * 3, center=at) for size, at in parts]), places(5000, 0.3)
    np.testing.assert_allclose(mesh.triangles().distance(x), union.distance(x)[0], atol=1e-15)


def test_winding_numbers_of_the_tree():
    """They err by less than 0.1, a fifth of what a sign allows, near surfaces and in all shapes."""
    for surface in (WHEEL, BUCKET, RING, ring(0.2, 0.03, 60, 20)):
        mesh = made(*surface, spacing=0.01)
        near = mesh.triangles().points(150)
        far = 10.0 ** np.random.default_rng(0).uniform(-8, -2, (150, 1))
        x = np.concatenate([places(150, 0.3), near[0] + far * near[1], near[0] - far * near[1]])
        found = mesh.triangles().winding(x)
        assert abs(found - winding(*surface, x)).max() < 0.1


def test_flipped_and_double_triangles_are_mended():
    """Half of them flipped in one part and one in the other, and all of the first twice."""
    good = joined(disc(0.1, 0.1), block(0.1, (0.2, 0.0, 0.0)))
    wanted, faces = made(*good, spacing=0.01), good[1].copy()
    rng, sides = np.random.default_rng(0), len(disc(0.1, 0.1)[1])
    chosen = np.append(rng.permutation(sides)[: sides // 2 - 3], sides + 4)
    faces[chosen] = faces[chosen][:, ::-1]
    mended = made(good[0], faces, f"reversed {len(chosen)} of {len(faces)} triangles", spacing=0.01)
    x = places(1000, 0.3)
    exact = wanted.triangles().distance(x)
    np.testing.assert_allclose(mended.triangles().distance(x), exact, rtol=0, atol=1e-15)
    for copies in (faces[:sides], faces[:sides, ::-1]):
        twice = np.concatenate([faces, copies])
        mended = made(good[0], twice, f"left out {sides} of {len(twice)}", spacing=0.01)
        assert (mended.triangles().distance(x) < 0).sum() == (exact < 0).sum()


# ---- thickness ----


@pytest.mark.parametrize("turn", [np.eye(3), TURN], ids=["along", "askew"])
def test_plates_have_no_holes_or_are_refused(turn):
    """From two spacings on the middle of a plate is inside everywhere."""
    plate = block((0.4, 0.3, 0.01), (0.1, 0.2, 0.0), turn)
    for spacing in (0.0051, 0.008):
        with pytest.raises(ValueError, match=r"spacing = 0.00.* must be <= 0.005 m, half the"):
            Mesh(*plate, spacing=spacing).samples()
    mesh = Mesh(*plate, spacing=0.005)
    x = places(5000, 0.5) * (0.39, 0.29, 0.0) @ turn.T + (0.1, 0.2, 0.0)
    assert mesh.distance(x)[0].max() < 0


HOLLOW = joined(block(0.3), block(0.28, inside_out=True))
TOOL = joined(block(0.2), block((0.2, 0.2, 0.01), (0.15, 0.0, 0.0), TURN))
SPIKE = joined(block(0.2), block((0.004, 0.004, 0.02), (0.0, 0.0, 0.1)))
TETRAHEDRON = 0.1 * np.eye(4)[:, 1:], np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
WEDGE = np.array([(0, 0, 0), (1, 0, 0.1), (1, 0, -0.1), (0, 1, 0), (1, 1, 0.1), (1, 1, -0.1)])
SHARP = 0.3 * WEDGE, np.array([
    (0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (0, 5, 2), (0, 3, 5), (1, 2, 5), (1, 5, 4),
])  # fmt: skip


@pytest.mark.parametrize(
    ("surface", "spacing", "thickness"),
    [
        (HOLLOW, 0.005, 0.01),
        (TOOL, 0.005, 0.01),
        (disc(0.2, 0.01), 0.005, 0.01),
        (disc(0.005, 0.3), 0.0049, 0.01),
        (SPIKE, 0.02, 0.2),
        (TETRAHEDRON, 0.02, 0.0423),
        (SHARP, 0.01, 0.054),
        (WHEEL, 0.01, 0.03),
    ],
    ids=["hollow", "tool", "disc", "rod", "spike", "tetrahedron", "wedge", "wheel"],
)
def test_thickness(surface, spacing, thickness):
    """That of walls; of the largest ball where there are none; edges and what is tiny apart."""
    mesh = Mesh(*surface, spacing=spacing)
    assert mesh.samples()[0][0][4] == pytest.approx(thickness, rel=0.02)
    if thickness < 0.05:
        with pytest.raises(ValueError, match="must be <="):
            Mesh(*surface, spacing=0.55 * thickness).samples()


def scene_of(shape, **scheme):
    return scene_with(
        grid=gr.Grid((-0.5,) * 3, 0.05, (20,) * 3),
        fills=(gr.Fill(gr.Box((-0.5, -0.5, -0.5), (0.5, 0.5, -0.3)), 8),),
        scheme=gr.Scheme(**scheme),
        bodies=(Body(shape, (0.0, 0.0, 0.1)),),
    )


def test_thin_plates_are_refused_as_boxes_are():
    """Below two cells of 0.05 m, and below three they are warned of."""
    for plate in (lambda size: Box(size=size), lambda size: Mesh(*block(size), spacing=0.02)):
        shape = plate((0.4, 0.3, 0.08))
        with pytest.raises(ValueError, match=r"bodies\[0\] has parts of 0.08 m, must be >= 0.1"):
            gr.Simulation(scene_of(shape))
        scene = scene_of(shape, transfer="apic", density=gr.ParticleDensity())
        assert any("bodies[0] has" in told for told in gr.scene_warnings(scene))
        gr.Simulation(scene)
        told = gr.scene_warnings(scene_of(plate((0.4, 0.3, 0.12))))
        assert any("bodies[0] has parts of 0.12 m, thinner than 3 cells" in said for said in told)


def test_forgotten_millimetres_are_told():
    """Also where the spacing is that of metres, and lengths that are scaled twice."""
    with pytest.raises(ValueError, match=r"in millimetres, scale them by 0.001"):
        Mesh(*block(300.0), spacing=0.0125)
    for size, told in ((300.0, "take scale = 0.001"), (0.0003, "take no scale = 0.001")):
        scene = scene_of(Mesh(*block(size), spacing=0.1 * size))
        assert sum(told in sentence for sentence in gr.scene_warnings(scene)) == 1
    assert not any(
        "scale" in s for s in gr.scene_warnings(scene_of(Mesh(*block(0.3), spacing=0.03)))
    )


# ---- files ----


@pytest.fixture
def trimesh():
    """The package, if it is installed."""
    return pytest.importorskip("trimesh")


def test_files_of_strangers(tmp_path, trimesh):
    """Each is refused with its path, whatever is wrong with it; nothing else raises."""
    (tmp_path / "folder.stl").mkdir()
    (tmp_path / "empty.stl").touch()
    (tmp_path / "text.ply").write_text("not a mesh")
    (tmp_path / "no_faces.off").write_text("OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n")
    (tmp_path / "wild.obj").write_text("v 0 0 0\nv 1 0 0\nf 1 2 9\n")
    (tmp_path / "many.ply").write_text(
        "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000\nproperty float x\n"
        "property float y\nproperty float z\nend_header\n"
    )
    (tmp_path / "nan.obj").write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with zipfile.ZipFile(tmp_path / "bomb.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", b"\0" * 10**6)
    for path in sorted(tmp_path.iterdir()):
        with pytest.raises(ValueError, match=f"path = .*{path.name}"):
            Mesh.read(path, spacing=0.1)
    with pytest.raises(FileNotFoundError):
        Mesh.read(tmp_path / "missing.stl", spacing=0.1)
    open_cube = trimesh.Trimesh(CORNERS, FACES[:-1], process=False)
    open_cube.export(tmp_path / "open.ply")
    with pytest.raises(ValueError, match=r"path = .*open.ply.*one triangle, must be two"):
        Mesh.read(tmp_path / "open.ply", spacing=0.02)


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "off"])
def test_damaged_files_are_refused_or_read(tmp_path, trimesh, ending):
    path, rng = tmp_path / f"cube.{ending}", np.random.default_rng(0)
    trimesh.Trimesh(CORNERS, FACES).export(path)
    good, refused = np.frombuffer(path.read_bytes(), np.uint8), 0
    for _ in range(60):
        bad = good.copy()[: rng.integers(1, len(good) + 1) if rng.random() < 0.3 else None]
        at = rng.integers(0, len(bad), rng.integers(1, 4))
        bad[at] = rng.integers(0, 256, len(at))
        path.write_bytes(bad.tobytes())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                Mesh.read(path, spacing=0.02)
            except ValueError as error:
                refused += "path = " in str(error)
    assert refused > 5


def test_nothing_but_the_file_is_read(tmp_path, trimesh):
    """A material library is named in the file; it may be anything."""
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]
    path, library = tmp_path / "cube.obj", tmp_path / "library.mtl"
    path.write_text("\n".join(["mtllib library.mtl", *lines[:8], "usemtl a", *lines[8:]]))
    library.write_text("newmtl a\nmap_Kd picture.png\n")
    mesh = Mesh.read(path, spacing=0.02)
    assert mesh == Mesh(mesh.vertices, mesh.faces, spacing=0.02) and len(mesh.faces) == 12


def test_rounding_far_from_the_origin_is_told(tmp_path, trimesh):
    """Binary STL has 24 bits: 0.25 m at 5,000 km."""
    path = tmp_path / "terrain.stl"
    blocks = trimesh.Trimesh(20 * CORNERS + (5e5 + 0.03, 5.2e6 + 0.03, 0.0), FACES)
    blocks.export(path)
    with pytest.warns(MeshWarning, match="rounds positions by 0.25 m, more than a tenth of"):
        Mesh.read(path, spacing=0.5)
    with pytest.raises(ValueError, match=r"rounds positions by 0.25 m, more than spacing = 0.02"):
        Mesh.read(path, spacing=0.02)


def test_triangles_of_missing_vertices_are_refused(tmp_path, trimesh):
    path = tmp_path / "tetrahedron.obj"
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    path.write_text(corners + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 9\n")
    with pytest.raises(ValueError, match="has triangles of vertices that it does not hold"):
        Mesh.read(path, spacing=0.02)


def test_mutated_surfaces_are_mended_or_refused():
    """Triangles left out, turned, doubled, moved: the solid holds a volume, or a ValueError."""
    rng, taken = np.random.default_rng(0), 0
    for _ in range(150):
        parts = [block(rng.uniform(0.1, 0.3, 3), rng.uniform(-0.2, 0.2, 3)) for _ in range(3)]
        vertices, faces = joined(*parts[: rng.integers(1, 4)])
        for _ in range(rng.integers(0, 4)):
            at, what = rng.integers(len(faces)), rng.integers(5)
            if what == 0:
                faces = np.delete(faces, at, axis=0)
            elif what == 1:
                faces[at] = faces[at][::-1]
            elif what == 2:
                faces = np.concatenate([faces, faces[at : at + 1, :: rng.choice([-1, 1])]])
            elif what == 3:
                faces[at] = rng.choice(len(vertices), 3, replace=False)
            else:
                vertices[rng.integers(len(vertices))] = vertices[rng.integers(len(vertices))]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                mesh = Mesh(vertices, faces, spacing=0.04)
            except ValueError:
                continue
        taken += 1
        assert mesh.triangles().moments().volume > 0
    assert taken > 30
