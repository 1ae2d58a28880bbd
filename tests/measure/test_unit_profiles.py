"""Profiles, health, energy and kinetic estimates of states that are known by hand."""

import numpy as np
import pytest
from refusals import refused
from synthetic import RHO_C, RHO_S, XI, isotropic, material, regular_points, scene, state

import granular as gr
from granular import measure
from granular.measure import (
    depth_average,
    friction,
    friction_profile,
    inertial_number,
    profile,
    scaled_inertial_number,
    velocity_profile,
)
from granular.papers import silo_clogging

CELL = 0.01


def layer(height=0.2, *, angle_deg=25.0, grains=None, v=None, headroom=4):
    """A periodic layer on an incline with the stress of steady flow."""
    angle = np.radians(angle_deg)
    g = 9.8 * np.array([np.sin(angle), -np.cos(angle)])
    rows = round(height / CELL) + headroom
    s = scene((4, rows), CELL, periodic=(True, False), gravity=tuple(g), grains=grains)
    x = regular_points(s, 2, lambda x: x[:, 1] < height)
    p = RHO_C * 9.8 * np.cos(angle) * (height - x[:, 1])
    stress = isotropic(p)
    stress[:, 3] = p * np.tan(angle)
    speed = np.zeros_like(x) if v is None else v(x)
    return state(s, x, stress=stress, v=speed, shear_rate=3.0)


def test_a_linear_velocity_profile_by_rows_of_cells():
    flow = layer(v=lambda x: np.stack([2 + 5 * x[:, 1], 0 * x[:, 0] - 1], axis=1))
    rows = velocity_profile(flow)
    assert np.allclose(rows.y, CELL * (np.arange(20) + 0.5))
    assert np.allclose(rows.value, 2 + 5 * rows.y)
    assert np.allclose(rows.centroid, rows.y)
    assert np.allclose(rows.weight, RHO_C * 4 * CELL**2)
    assert np.allclose(velocity_profile(flow, component=1).value, -1)
    assert depth_average(flow, flow.v[:, 0]) == pytest.approx(2 + 5 * 0.1)
    assert np.allclose(depth_average(flow, "v"), [2.5, -1])


def test_rows_are_weighted_by_mass():
    s = scene((1, 3), 0.1)
    points = state(
        s, [[0.02, 0.03], [0.07, 0.08], [0.05, 0.25]], mass=[1.0, 3.0, 2.0],
        v=[[4.0, 0], [8.0, 0], [1.0, 0]],
    )  # fmt: skip
    rows = velocity_profile(points)
    assert rows.value[0] == pytest.approx((4 + 24) / 4)
    assert np.isnan(rows.value[1])
    assert rows.value[2] == 1
    assert rows.centroid[0] == pytest.approx((0.03 + 0.24) / 4)
    assert depth_average(points, points.v[:, 0]) == pytest.approx(30 / 6)
    two = velocity_profile(points, bins=2)
    assert np.allclose(two.y, [0.0625, 0.1875])
    edges = velocity_profile(points, bins=[0.05, 0.1, 0.3])
    assert np.allclose(edges.value, [8, 1])


def test_friction_of_the_layer_is_the_tangent_of_its_slope():
    flow = layer(angle_deg=27.0)
    tangent = np.tan(np.radians(27.0))
    assert np.allclose(friction(flow), tangent)
    assert np.allclose(friction_profile(flow).value, tangent)
    # in three dimensions every shear counts twice
    s = scene((1, 1, 1), 1.0)
    stress = [[-10.0, -10, -10, 3, 4, 0], [-13.0, -10, -7, 0, 0, 0], [0, 0, 0, 0, 0, 0]]
    points = state(s, np.full((3, 3), 0.5), stress=stress)
    mu = friction(points)
    # tau = sqrt(sxy^2 + syz^2) = 5; tau = sqrt((9 + 9)/2) = 3
    assert np.allclose(mu[:2], [0.5, 0.3])
    assert np.isnan(mu[2])
    # of a row it is that of the mean stress
    flow = layer()
    sign = (-1.0) ** np.arange(flow.n)
    stress = flow.stress.copy()
    stress[:, 3] += 300 * sign
    noisy = state(flow.scene, flow.x, stress=stress)
    deep = slice(0, 15)
    assert np.allclose(friction_profile(noisy).value[deep], np.tan(np.radians(25)), rtol=1e-9)
    assert np.nanmax(np.abs(friction(noisy) - np.tan(np.radians(25)))) > 0.1


def test_inertial_numbers():
    d = 0.005
    I0 = XI * d * np.sqrt(RHO_S)
    flow = layer(grains=material(I0=I0, d=d))
    expected = 3.0 * d * np.sqrt(RHO_S / flow.pressure)
    assert np.allclose(inertial_number(flow), expected)
    assert np.allclose(inertial_number(flow, d=2 * d), 2 * expected)
    assert np.allclose(inertial_number(flow, rho_s=4 * RHO_S), 2 * expected)
    assert np.allclose(inertial_number(flow) / I0, scaled_inertial_number(flow))
    loose = state(flow.scene, flow.x, shear_rate=3.0)
    assert np.isnan(scaled_inertial_number(loose)).all()


def test_bad_profiles_are_refused():
    flow = layer()
    refused(
        ("d = None", lambda: inertial_number(flow)),
        ("rho_s = None", lambda: inertial_number(layer(grains=gr.Elastic()), d=0.01)),
        ("has no xi", lambda: scaled_inertial_number(layer(grains=material(xi=None)))),
        ("increasing edges", lambda: velocity_profile(flow, bins=[0.2, 0.1])),
        ("hold no point", lambda: velocity_profile(flow, bins=[0.5, 0.6])),
        ("component = 2", lambda: velocity_profile(flow, component=2)),
        ("bins = 0", lambda: velocity_profile(flow, bins=0)),
        ("0 points", lambda: scaled_inertial_number(state(flow.scene, np.empty((0, 2))))),
        ("weight = 'count'", lambda: profile(flow, "pressure", weight="count")),
    )


def test_every_public_name_has_a_docstring():
    for module in (measure, silo_clogging, measure.soil_tools):
        for name, value in vars(module).items():
            if getattr(value, "__module__", "").startswith("granular.measure") and name[0] != "_":
                assert isinstance(value.__doc__, str)


def test_profiles_by_volume_weigh_with_the_quadrature_volume():
    """As cell_average does: in each row of cells one point counts three times another."""
    flow = layer()
    left = flow.x[:, 0] % CELL < CELL / 2
    flow.quadrature_volume = flow.volume * np.where(left, 1.5, 0.5)
    side = np.where(left, 1.0, -1.0)
    rows = profile(flow, side, weight="volume")
    assert np.allclose(rows.value, 0.5)
    assert np.allclose(rows.weight, 4 * CELL**2)
    cells = measure.cell_average(flow, side, weight="volume").value
    assert np.allclose(cells, 0.5)
    assert np.allclose(profile(flow, side).value, 0.0)
