"""Axisymmetric grids refuse by name what has no axis of symmetry, or is not available."""

import re

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr

GRID = gr.Grid((0.0, 0.0), 0.1, (8, 8), axisymmetric=True)
FILL = gr.Fill(gr.Box((0.0, 0.0), (0.8, 0.4)), 4)


def scene_of(**parts):
    return scene_with(**{"grid": GRID, "fills": (FILL,)} | parts)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0.0, 0.0, 0.0), 0.1, (4, 4, 4)), "needs a grid in 2D"),
        (((-0.1, 0.0), 0.1, (4, 4)), "lower[0] = -0.1 is a radius, must be >= 0"),
        (((0.1, 0.0), 0.1, (4, 4), (True, False)), "must be False along the radius"),
        (((0.0, 0.0), 0.1, (4, 4), (), {"x-"}), "'x-' must not be the axis of symmetry"),
    ],
)
def test_grids_without_an_axis(arguments, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        gr.Grid(*arguments, axisymmetric=True)


def test_a_grid_takes_true_or_false():
    with pytest.raises(TypeError, match="axisymmetric = 1 must be True or False"):
        gr.Grid((0.0, 0.0), 0.1, (4, 4), axisymmetric=1)
    assert not gr.Grid((0.5, 0.0), 0.1, (4, 4), axisymmetric=True).has_axis


def halving(dt, parameters, gradient, log_density, stress, shear_rate, history):
    stress *= 0.5


DISC = gr.Cylinder(0.1, center=(0.0, 0.0))


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"gravity": (1.0, -9.8)}, "gravity = (1.0, -9.8) must have no radial component"),
        ({"walls": (gr.Wall(0, 0.0),)}, "must not stand at r = 0, the axis of symmetry"),
        (
            {"material": gr.materials.from_function(halving)},
            "the law 'halving' must be made with axisymmetric=True",
        ),
        ({"scheme": gr.Scheme(basis="ugimp", density=gr.ParticleDensity())}, 'basis = "ugimp"'),
        ({"bodies": (gr.Body(DISC, (0.3, 0.6), free="x", mass=1.0),)}, "must not name x"),
        ({"bodies": (gr.Body(DISC, (0.0, 0.6), free="y", mass=1.0, inertia=1.0),)}, "not turn"),
        ({"bodies": (gr.Body(DISC, (0.05, 0.6)),)}, "must be symmetric about r = 0"),
        (
            {"bodies": (gr.Body(DISC, (0.3, 0.6), motion=gr.Motion(velocity=((1.0, 0.0),))),)},
            "has the radial velocity 1 m/s",
        ),
    ],
)
def test_scenes_without_an_axis(parts, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        scene_of(**parts)


def test_bodies_stay_on_the_axis_during_a_run():
    sim = gr.Simulation(scene_of(bodies=(gr.Body(DISC, (0.0, 0.6)),)), threads=1)
    for change in ({"velocity": (1.0, 0.0)}, {"angular_velocity": 1.0}):
        with pytest.raises(ValueError, match="must be along the axis of symmetry"):
            sim.set_motion(0, **change)
    sim.set_motion(0, velocity=(0.0, -0.1))


def test_measures_that_need_a_plane():
    sim = gr.Simulation(scene_of(), threads=1)
    for use in (
        lambda: gr.measure.deposit(sim.state),
        lambda: gr.measure.mass_balance_error(sim.state, restitution=0.5),
        lambda: gr.measure.step_budget(sim),
    ):
        with pytest.raises(ValueError, match="not available in an axisymmetric grid"):
            use()


def test_scenes_take_one_of_dimension_and_axis():
    with pytest.raises(ValueError, match="dim = 3 must be 2 or None with axisymmetric = True"):
        gr.scenes.penetration(axisymmetric=True, dim=3)


def test_sph_has_no_rings():
    scene = gr.scenes.column_collapse(method="sph", cell=0.1)
    with pytest.raises(ValueError, match="axisymmetric"):
        scene.replace(grid=gr.Grid((0.0, 0.0), 0.05, (20, 10), axisymmetric=True))


def test_masses_and_measures_are_those_of_whole_rings():
    """Of a cylinder of the radius R = 0.8 m and the height H = 0.4 m."""
    sim = gr.Simulation(scene_of(), threads=1, wall_forces=True)
    state, rho = sim.state, sim.scene.material.rho_c
    volume = np.pi * 0.8**2 * 0.4
    assert state.mass.sum() == pytest.approx(rho * volume, rel=1e-13)
    np.testing.assert_allclose(state.section, 0.05**2, rtol=1e-13)
    assert gr.measure.occupied_area(state) == pytest.approx(volume, rel=1e-13)
    assert gr.measure.layer_height(state) == pytest.approx(0.4, rel=1e-13)
    top = gr.measure.surface(state)
    np.testing.assert_allclose(top.height, 0.4, rtol=1e-13)
    np.testing.assert_allclose(gr.measure.nodal_density(state), rho, rtol=0.35)
    assert gr.measure.cell_density(state).value == pytest.approx(rho, rel=1e-13)
