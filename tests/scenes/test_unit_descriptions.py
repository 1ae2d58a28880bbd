"""Descriptions of scenes: copies with changes, and short ways to make usual ones."""

import dataclasses
import inspect
import math

import numpy as np
import pytest

import granular as gr
from granular import sph

MADE = [
    gr.Grid((0.0, 0.0), 0.1, (3, 3)),
    gr.Fill(gr.Box((0.0, 0.0), (0.1, 0.1)), 4),
    gr.Wall(0, 0.0),
    gr.Solid((0.0, 0.0), (0.1, 0.1)),
    gr.Gravity.constant(9.8),
    gr.Motion(velocity=(0.0, 1.0)),
    gr.Body(gr.Sphere(0.1, center=(0.0, 0.0)), (0.0, 0.0), free="y", mass=1.0),
    gr.Box(size=(0.1, 0.1), rotation_deg=30.0),
    gr.HalfSpace((0.0, 1.0)),
    gr.shapes.wheel(0.1, grousers=3, height=0.02),
    gr.MuI(E=1e6, mu_s=0.4),
    gr.DruckerPrager(E=1e6, cohesion=10.0),
    gr.NGF(E=1e6),
    gr.schemes.default,
    gr.scenes.silo(),
    sph.Numerics(),
]


@pytest.mark.parametrize("made", MADE, ids=lambda made: type(made).__name__)
def test_every_description_has_copies_with_changes(made):
    assert made.replace() == made and made.replace() is not made
    with pytest.raises(TypeError, match="nothing"):
        made.replace(nothing=1)


def test_no_description_lacks_replace():
    """Frozen dataclasses at the top of the package, and shapes; results of runs are not made."""
    results = {"GasState"}
    for module in (gr, gr.shapes, gr.materials, gr.schemes, sph):
        for name, kind in vars(module).items():
            if inspect.isclass(kind) and dataclasses.is_dataclass(kind) and name not in results:
                assert hasattr(kind, "replace"), name


def test_a_constant_gravity():
    moon = gr.Gravity((0.0,), ((0.0, -1.62),))
    assert gr.Gravity.constant(1.62) == gr.Gravity.constant((0.0, -1.62)) == moon
    assert gr.Gravity.constant(np.array([0.0, -1.62])) == moon
    assert gr.Gravity.constant(3.7, dim=3).vectors == ((0.0, 0.0, -3.7),)
    scene = gr.scenes.column_collapse(cell=0.05)
    assert scene.replace(gravity=(0.0, -1.62)).gravity == moon
    with pytest.raises(ValueError, match=r"take Gravity.constant\(\(0.0, -1.62\)\)"):
        gr.Gravity((0.0, -1.62))
    with pytest.raises(ValueError, match="value = -9"):
        gr.Gravity.constant(-9.8)


def test_a_grid_that_covers_a_box():
    grid = gr.Grid.covering((-0.1, 0.0), (1.0, 0.55), 0.1, open_sides={"y+"})
    assert grid == gr.Grid((-0.1, 0.0), 0.1, (11, 6), open_sides={"y+"})
    assert gr.Grid.covering((0.0, 0.0), (0.3, 0.3), 0.1).shape == (3, 3)  # 0.3/0.1 is below 3
    with pytest.raises(ValueError, match=r"upper\[1\] = 0.0 must exceed lower\[1\] = 0.0"):
        gr.Grid.covering((0.0, 0.0), (1.0, 0.0), 0.1)


def test_friction_from_an_angle():
    tangent = math.tan(math.radians(30.0))
    grains = gr.MuI(phi_deg=30.0)
    assert (grains.mu_s, grains.mu_2) == pytest.approx((tangent, tangent + 0.2616))
    assert gr.MuI(phi_deg=30.0, mu_2=0.7).mu_2 == 0.7
    assert gr.DruckerPrager(phi_deg=30.0).mu == pytest.approx(tangent)
    assert gr.MuI().mu_2 == 0.6435 and grains.replace(E=1e6).mu_s == grains.mu_s
    for angle in (0.0, 60.0, math.nan):
        with pytest.raises(ValueError, match="phi_deg"):
            gr.MuI(phi_deg=angle)


def test_a_mesh_in_millimetres_is_asked_about():
    """As the surface of a body by a warning, and in the message of a fill."""
    corners = np.array([[x, y, z] for x in (0, 80) for y in (0, 80) for z in (0, 80)], dtype=float)
    faces = [
        *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
        *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ]
    cube = gr.Mesh(corners, np.array(faces), spacing=10.0)
    grid = gr.Grid((0.0, 0.0, 0.0), 0.05, (10, 10, 10))
    soil = gr.Fill(gr.Box((0.0, 0.0, 0.0), (0.5, 0.5, 0.1)), 8)
    parts = {"grid": grid, "gravity": (0.0, 0.0, -9.8), "material": gr.MuI(E=1e6), "duration": 1.0}
    body = gr.Body(cube, (0.0, 0.0, 0.2))
    scene = gr.Scene(name="mm", fills=(soil,), bodies=(body,), **parts)
    assert any(
        "a mesh of 80 m in a domain of 0.5 m: did you" in w for w in gr.scene_warnings(scene)
    )
    with pytest.raises(ValueError, match=r"did you mean Mesh.read\(..., scale=1e-3\)"):
        gr.Scene(name="mm", fills=(gr.Fill(cube, 8),), **parts)
