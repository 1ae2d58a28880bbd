"""Scenes and measurements of the figures of Haeri & Skonieczny (2021), by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

import granular as gr
from granular.measure.soil_tools import FailureSurface
from granular.papers.haeri2021 import blades, cylinders, strains, wheels
from granular.theory import couette_quasi_static


def test_means_of_forces_are_those_at_depth():
    """The blade is at its depth of 5 cm from 2 s on; the force grows by 1 N in each second."""
    times = np.arange(0.0, 4.0, 0.1)
    height = -0.05 * np.minimum(times / 2.0, 1.0)
    course = blades.BladeForces(times, height, times, 2 * times, 0 * times)
    assert course.level.sum() == 20
    mean = course.means()
    assert mean["forward"] == pytest.approx(2.95) and mean["vertical"] == pytest.approx(5.9)
    assert mean["deviation"] == pytest.approx(np.arange(20).std() / 10)
    forward, vertical = course.arrival()
    assert forward == pytest.approx(2.2) and vertical == pytest.approx(4.4)
    assert course.scaled(6.1).means()["forward"] == pytest.approx(6.1 * 2.95)


def test_coulombs_force_on_a_level_bed():
    """The numbers of the page; Rankine's force, without friction on the blade, is less."""
    soil = blades.SOIL
    assert blades.coulomb(soil, 0.02) == pytest.approx(14.0, abs=0.5)
    assert blades.coulomb(soil, 0.05) == pytest.approx(85.0, abs=0.6)
    rankine = math.tan(math.radians(45.0) + math.atan(soil.mu_s) / 2) ** 2
    assert 0.5 * soil.rho_c * 9.81 * 0.05**2 * blades.WIDTH * rankine == pytest.approx(
        23.9, abs=0.1
    )


def test_a_scene_ends_with_the_way_of_the_blade():
    scene = blades.blade_scene(0.05, cell=0.025)
    assert scene.duration == pytest.approx(0.2 + 2.0 + 2.5)
    assert gr.scenes.excavation(cell=0.025).duration == pytest.approx(20.4)


def test_the_moving_soil_before_a_blade():
    """Columns of 1 cm, of which three before the blade move, over 1, 2 and 1 cm."""
    scene = blades.blade_scene(0.05, cell=0.025)
    state = gr.Simulation(scene, threads=1).state
    x = 0.25 + 0.025 * np.arange(6)
    z = np.array([-0.05, -0.05, -0.025, -0.05, np.nan, np.nan])
    surface = FailureSurface(x=x, z=z, top=np.zeros(6), speed=0.004)
    soil = blades.MovedSoil(state, state.speed, np.array([0.26, 0.0, -0.05]), surface)
    assert soil.area() == pytest.approx(0.025 * (0.05 + 0.025 + 0.05))
    assert soil.reach() == pytest.approx(0.325 - 0.26)
    assert soil.heap() == pytest.approx(-0.025 / 4)


@pytest.fixture(scope="module")
def ring():
    """A state between cylinders at the start."""
    scene = gr.scenes.couette(inner=0.05, outer=0.1, height=0.03, omega=1.0, cell=0.01)
    return gr.Simulation(scene, threads=1).state


def turned(state, time, omega):
    """A state whose points have turned with an angular velocity that depends on the radius."""
    fields = {name: array.copy() for name, array in state.fields.items()}
    r = np.hypot(*state.x[:, :2].T)
    c, s = np.cos(omega(r) * time), np.sin(omega(r) * time)
    x, y = state.x[:, 0].copy(), state.x[:, 1].copy()
    fields["x"][:, 0], fields["x"][:, 1] = c * x - s * y, s * x + c * y
    return gr.State(scene=state.scene, time=time, step=1, dt=1e-3, fields=fields)


def test_a_flow_by_the_theory_has_no_error(ring):
    material = ring.scene.material
    slow = couette_quasi_static(0.05, 0.1, material, walls="smooth")

    def omega(r):
        return np.interp(r, slow.r, slow.omega)

    found = cylinders.CylinderFlow.measured(turned(ring, t, omega) for t in (0.0, 0.1, 0.2, 0.3))
    assert len(found.windows) == 3 and found.each.shape == (1, len(found.r))
    # The mean over a ring is not the value at its mean radius.
    assert found.errors(found.slow).max() < 0.1
    assert found.errors(found.slow, found.each) == pytest.approx(found.errors(found.slow)[None])
    weight = material.rho_c * 9.81 * 0.03
    usual = 2 * np.pi * 0.05**2 * 0.03 * weight / 2  # without the friction
    assert found.moment_of_theory / usual == pytest.approx(material.mu_s, rel=0.5)
    assert found.moment == 0
    with pytest.raises(ValueError, match="at least two"):
        cylinders.CylinderFlow.measured([ring])


def test_the_length_of_a_tail():
    r = np.linspace(0.1, 0.2, 50)
    omega = np.exp(-(r - 0.1) / 0.0054)
    assert cylinders.decay_length(r, omega) == pytest.approx(0.0054)
    assert math.isnan(cylinders.decay_length(r, 0.5 * np.ones(50)))


def test_the_plastic_volume_of_stored_fields(ring):
    """It is 1; and a state whose density does not fit its pressure shows by how much."""
    assert np.abs(strains.plastic_volume(ring)).max() < 1e-15
    denser = {**ring.fields, "log_density": ring.log_density + 1e-3}
    state = gr.State(scene=ring.scene, time=0.0, step=0, dt=1e-3, fields=denser)
    assert strains.plastic_volume(state) == pytest.approx(
        np.full(state.dense.sum(), -1e-3), rel=0.02
    )


def test_the_published_step_along_a_flow(ring):
    """A shear rate of 2 1/s over 3 s with steps of 1e-4 s: dt gdot^2 t/4."""
    rate = {**ring.fields, "shear_rate": np.full(ring.n, 2.0)}
    states = [
        gr.State(scene=ring.scene, time=t, step=0, dt=1e-3, fields=rate) for t in (0.0, 1.0, 3.0)
    ]
    found = strains.PlasticVolume.measured(states, 1e-4)
    assert found.published[:, 0] == pytest.approx([0.0, -1e-4, -3e-4])
    assert found.published[:, 1] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(found.stored).max() < 1e-15
    assert found.occupied == pytest.approx(np.full(3, found.occupied[0]))


def test_means_of_quarters():
    assert strains.quarter(np.arange(8.0), 3) == 6.5 and strains.quarter(np.arange(8.0), 1) == 2.5


def test_a_slice_of_a_wheel_has_its_share_of_the_load():
    size = {"cell": 0.025, "soil": 0.1, "length": 0.5, "headroom": 0.1, "start": 0.2}
    scene = wheels.wheel_slice(20, **size, omega=0.4, duration=2.0)
    (body,) = scene.bodies
    assert body.mass * 9.81 == pytest.approx(164.0 * 0.05 / 0.125)
    assert scene.grid.shape[1] == 2 and body.shape.length == pytest.approx(0.2)
    whole = wheels.wheel_scene(20, **size, width=0.15, omega=0.4, duration=2.0).bodies[0]
    assert replace(body, shape=whole.shape, mass=whole.mass) == whole
