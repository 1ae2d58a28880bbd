"""The two friction angles of laws without dilation: by the law itself, and on a pushed wall."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import Body, HalfSpace, Motion, _core
from granular.measure.stress import friction_of
from granular.theory import earth_pressure, reference
from granular.verify.constitutive import law_parameters

MU = 0.7


def test_coefficients_by_hand():
    found = earth_pressure(0.7)
    assert found.coaxial_deg == pytest.approx(44.427, abs=1e-3)
    assert found.band_deg == pytest.approx(34.992, abs=1e-3)
    assert found.passive_coaxial == pytest.approx(1.7 / 0.3)  # (1 + sin)/(1 - sin)
    sine = 0.7 / math.sqrt(1.49)
    assert found.passive_band == pytest.approx((1 + sine) / (1 - sine))
    assert found.triaxial_deg == pytest.approx(math.degrees(math.asin(2.1 / (math.sqrt(12) + 0.7))))
    assert found.active_coaxial * found.passive_coaxial == pytest.approx(1)
    assert found.active_band * found.passive_band == pytest.approx(1)
    still = earth_pressure(0.0)
    assert still.coaxial_deg == 0 and still.passive_band == pytest.approx(1)
    for bad in (-0.1, 1.0, math.nan, "0.7"):
        with pytest.raises((TypeError, ValueError), match="mu = "):
            earth_pressure(bad)


def test_dilation_up_to_that_of_associated_flow():
    """Where psi = mu both angles are that of the cone, and a band has no other."""
    found = earth_pressure(0.5, dilation=0.5)
    assert math.sin(math.radians(found.coaxial_deg)) == pytest.approx(0.5 / math.sqrt(1 - 0.25 / 3))
    assert found.dilation_deg == pytest.approx(found.coaxial_deg)
    assert found.band_deg == pytest.approx(found.coaxial_deg)
    loose, none, dense = (earth_pressure(0.5, dilation=psi) for psi in (-0.1, 0.0, 0.1))
    assert loose.dilation_deg < 0 == none.dilation_deg < dense.dilation_deg
    assert loose.passive_coaxial < none.passive_coaxial < dense.passive_coaxial
    for mu, bad in ((0.5, 1.0), (0.99, 0.9), (0.5, math.nan), (0.5, "0.1")):
        with pytest.raises((TypeError, ValueError), match="dilation = "):
            earth_pressure(mu, bad)


def test_stress_at_yield_is_coaxial_or_along_a_band():
    """Principal stresses p (1 +- mu) in 2D and p across, where the flow has no strain."""
    state = -100.0 * np.array([[1 + MU, 1 - MU, 1.0, 0.0]])
    assert friction_of(state)[0] == pytest.approx(MU)
    assert state[0, 0] / state[0, 1] == pytest.approx(earth_pressure(MU).passive_coaxial)
    # slow simple shear well beyond yield
    material = gr.MuI(E=1e6, mu_s=MU, mu_2=MU + 0.01)
    shear, times = np.array([[0.0, 2e-3], [0.0, 0.0]]), np.linspace(0.0, 1.0, 11)
    result = reference(material, 100.0, times, velocity_gradient=lambda t: shear)
    _, yy, _, xy = result.stress[-1]
    assert abs(xy / yy) == pytest.approx(MU, rel=1e-3)
    assert math.degrees(math.atan(abs(xy / yy))) == pytest.approx(
        earth_pressure(MU).band_deg, rel=1e-3
    )


def test_triaxial_compression_has_the_third_angle():
    """A point in 3D that is shortened along z and widens in x and y, volume kept, beyond yield."""
    material = gr.DruckerPrager(E=1e6, mu=MU)
    lanes = _core.build_info()["lanes"]
    gradient = np.zeros((1, 9, lanes))
    gradient[0, [0, 4, 8]] = np.array([[0.5], [0.5], [-1.0]]) * 1e-4  # L dt: xx, yy, zz
    density, rate, stress = np.full(lanes, 1e-3), np.zeros(lanes), np.zeros((6, lanes))
    stress[:3] = -material.K * 1e-3
    for _ in range(100):
        _core.law_update(
            material.law, 3, law_parameters(material), 1e-4, 1, gradient, density, stress, rate, ""
        )
    least, largest = -stress[0, 0], -stress[2, 0]
    sine = (largest - least) / (largest + least)
    assert math.degrees(math.asin(sine)) == pytest.approx(earth_pressure(MU).triaxial_deg, rel=1e-6)


def test_a_pushed_smooth_wall_lies_between():
    """A wall pushed at 2 cm/s into level ground 0.1 m high and 0.4 m long, for 1 cm."""
    material, height, speed = gr.DruckerPrager(E=1e6, mu=MU), 0.1, 0.02
    motion = Motion(times=(0.0, 0.05), velocity=((0.0, 0.0), (speed, 0.0)))
    scene = scene_with(
        grid=gr.Grid((0.0, 0.0), 0.01, (45, 16)),
        fills=(gr.Fill(gr.Box((0.05, 0.0), (0.45, height)), 4, lithostatic=True),),
        walls=(gr.Wall(1, 0.0, kind="no_slip"), gr.Wall(0, 0.45, kind="free_slip")),
        material=material,
        duration=0.5,
        bodies=(Body(HalfSpace((1.0, 0.0)), (0.05, 0.0), motion=motion),),
    )
    sim = gr.Simulation(scene, threads=1).run(until=0.4, monitor=False)
    before, begin = sim.bodies[0].impulse[0], sim.time
    sim.run(until=0.5, monitor=False)
    force = (before - sim.bodies[0].impulse[0]) / (sim.time - begin)
    found, weight = earth_pressure(MU), material.rho_c * 9.8 * height**2 / 2
    assert found.passive_band < force / weight < found.passive_coaxial  # 3.69, 4.7, 5.67
