"""Scenes with bodies at any angle: geometry by hand, own terrain, mass."""

import math

import numpy as np
import pytest
from scenes_by_hand import mass

import granular as gr
from granular import HeightMap, scenes


def test_landslide():
    """Slope, arc and flat join smoothly, and the cap has the mass of its parabola."""
    scene = scenes.landslide()
    ground = scene.bodies[0].shape
    x = ground.origin[0] + ground.spacing[0] * np.arange(len(ground.z))
    assert (x[0], ground.upper[0]) == (-1.0, pytest.approx(1.6))
    slope = np.diff(ground.z) / np.diff(x)
    assert slope[0] == pytest.approx(-math.tan(math.radians(35.0))) and slope[-1] == 0.0
    # a circle of 0.3 m turns by h/R/cos^3 in slope over a distance h
    assert (np.diff(slope) > -1e-9).all()
    assert np.diff(slope).max() < 0.005 / 0.3 / math.cos(math.radians(35.0)) ** 3
    assert ground.z[0] == pytest.approx(math.tan(math.radians(35.0)))
    points = scene.points()
    assert points.x[:, 0].min() > -0.95 and points.x[:, 0].max() < -0.55
    density = 1500.0  # the pressure of 0.08 m adds 0.1 %
    assert mass(scene) == pytest.approx(density * 2 / 3 * 0.4 * 0.08, rel=3e-3)
    wide = scenes.landslide(dim=3, cell=0.05, points_per_cell=1, thickness=0.15)
    assert mass(wide) == pytest.approx(density * math.pi / 8 * 0.4**2 * 0.15, rel=0.01)
    assert wide.parameters["dim"] == 3 and wide.grid.lower[:2] == (-1.0, -0.5)


def test_landslide_on_terrain_of_ones_own(tmp_path):
    """Thickness by posts on a plane that falls along y; a file gives the same terrain."""
    z = np.add.outer(0.5 - 0.1 * 0.4 * np.arange(9), np.zeros(7))
    release = np.zeros_like(z)
    release[1:4, 2:5] = 0.15
    scene = scenes.landslide(
        terrain=HeightMap(z, 0.1), release=release, cell=0.05, points_per_cell=1
    )
    assert scene.grid.shape[:2] == (12, 16) and scene.parameters["release"] == "given"
    # pyramids of bilinear heights: each post bears a square of 0.1 m
    assert mass(scene) == pytest.approx(1500.0 * 9 * 0.1**2 * 0.15, rel=0.01)
    points = scene.points()
    assert (points.x[:, 2] > 0.5 - 0.4 * points.x[:, 1] - 1e-9).all()
    again = gr.Scene.from_json(scene.to_json())
    assert again == scene
    rows = "\n".join(" ".join(map(repr, row)) for row in z[::-1].tolist())
    head = "ncols 7\nnrows 9\nxllcenter 0\nyllcenter 0\ncellsize 0.1\n"
    (tmp_path / "hill.asc").write_text(head + rows)
    cap = {"at": (0.3, 0.3), "length": 0.3, "thickness": 0.1}
    read = scenes.landslide(terrain=str(tmp_path / "hill.asc"), cell=0.05, **cap)
    assert read.bodies == scene.bodies
    by_path = scenes.landslide(terrain=tmp_path / "hill.asc", cell=0.05, **cap)
    assert by_path == read == gr.Scene.from_json(by_path.to_json())
    assert by_path.parameters["terrain"] == str(tmp_path / "hill.asc")
    with pytest.raises(ValueError, match="at = None must be a place on the terrain"):
        scenes.landslide(terrain=HeightMap(z, 0.1))
    with pytest.raises(ValueError, match=r"spacing = .* must be the same along x and y"):
        scenes.landslide(terrain=HeightMap(z, (0.1, 0.2)), release=release)


@pytest.mark.parametrize("dim", [2, 3])
def test_obstacle(dim):
    """The obstacle's face is at the gap, its foot on the bed; it does not touch the fill."""
    width = {"width": 0.4, "height": 0.08, "cell": 0.04} if dim == 3 else {}
    for kind, half in (("wall", 0.05), ("cylinder", 0.2 if dim == 2 else 0.1)):
        scene = scenes.obstacle(kind=kind, **width)
        body = scene.bodies[0]
        face = np.array([[0.4, *(0.2,) * (dim - 2), 0.0]])
        assert body.position[0] == pytest.approx(0.4 + half)
        np.testing.assert_allclose(body.distance(face)[0], 0.0, atol=1e-12)
        thick = 0.1 if dim == 2 else 0.08
        expected = 1500.0 * 0.6 * thick * (0.4 if dim == 3 else 1.0)
        assert mass(scene) == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("kind", ["ball", "cone"])
def test_penetration(dim, kind):
    """The lowest place of the intruder is the middle of the surface; its motion ends in the bed."""
    scene = scenes.penetration(kind=kind, dim=dim, cell=0.04)
    body, level = scene.bodies[0], (0.4,) * (dim - 1)
    at = np.array([[*level, -0.01], [*level, 0.01], [0.4 + 0.06, *level[1:], 0.04]])
    below, within, beside = body.distance(at)[0]
    assert below == pytest.approx(0.01) and within < 0 < beside
    assert body.motion.velocity == ((0.0,) * dim, (*(0.0,) * (dim - 1), -0.1))


@pytest.mark.parametrize("dim", [2, 3])
def test_sphere_drop(dim):
    """The ball touches the surface with the speed of its fall; its mass is that of its shape."""
    scene = scenes.sphere_drop(drop=0.2, dim=dim, cell=0.008)
    body, level = scene.bodies[0], (0.08,) * (dim - 1)
    below, within = body.distance(np.array([[*level, -0.01], [*level, 0.01]]))[0]
    assert below == pytest.approx(0.01) and within < 0
    assert body.motion.velocity[0][-1] == pytest.approx(-math.sqrt(2 * 9.81 * 0.2))
    whole = gr.bodies.mass_properties(body.shape, density=2200.0)
    assert body.mass == pytest.approx(whole.mass, rel=1e-3)
    np.testing.assert_allclose(body.inertia, whole.inertia, rtol=2e-3, atol=1e-10)


def test_conveyor():
    """The belt moves along itself; the gate leaves the opening."""
    scene = scenes.conveyor(angle_deg=10.0)
    belt, gate = scene.bodies
    assert belt.motion.velocity[-1] == (0.5, 0.0)
    np.testing.assert_allclose(gate.distance(np.array([[0.03, 0.05], [0.0, 0.2]]))[0], [0.05, 0.0])
    down = scene.gravity.at(0.0)
    assert math.degrees(math.atan2(down[0], down[1])) == pytest.approx(-170.0)
    assert mass(scene) == pytest.approx(1500.0 * 0.4 * 0.3, rel=5e-3)
