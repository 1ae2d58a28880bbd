"""Scenes with bodies, and the 3D silo: shapes, motions and beds against values by hand."""

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

import granular as gr
from granular import scenes
from granular.mpm.engine import initial_points


def test_silo_drains_through_a_slot_in_the_corner():
    scene = scenes.silo_3d()
    assert scene.n_points == 40 * 20 * 10 * 8 and scene.duration == 12.0
    assert (scene.material.mu_s, scene.material.E) == (0.3819, 0.15e6)
    floor, hole, *sides = scene.walls
    assert floor.span == ((0.025, 0.25), (0.0, 0.0625)) and floor.kind == "no_slip"
    assert hole.span == ((0.0, 0.025), (0.0, 0.0625)) and hole.opens_at == 0.0
    assert {wall.kind for wall in sides} == {"free_slip"} and len(sides) == 4
    assert scene.grid.open_sides == {"z-"}


def test_couette_of_the_paper():
    scene = scenes.couette(cell=0.02)
    inner, outer = scene.bodies
    assert scene.grid.shape == (28, 28, 9)
    assert inner.shape.radius == pytest.approx(0.0999)
    assert outer.shape.radius == pytest.approx(0.2001) and outer.shape.inside
    assert inner.motion.angular_velocity == ((0.0, 0.0, 0.025),)
    assert outer.motion.angular_velocity == ((0.0, 0.0, 0.0),)
    assert inner.contact == outer.contact == "sticky"
    # a hundredth of S = 1 MPa, B = 10 MPa
    assert (scene.material.G, scene.material.K) == pytest.approx((1e4, 1e5))
    r = np.hypot(*scene.points().x[:, :2].T)
    assert r.min() >= 0.0999 and r.max() < 0.2001
    assert scene.walls[0].kind == "free_slip" and len(scene.walls) == 1


def test_couette_in_2d_is_under_its_pressure():
    scene = scenes.couette(cell=0.01, pressure=700.0)
    assert scene.dim == 2 and not scene.walls and not any(scene.gravity.at(1.0))
    sim = gr.Simulation(scene, threads=1)
    assert sim.state.log_density * scene.material.K == pytest.approx(700.0)


@pytest.mark.parametrize("half", [True, False])
def test_blade_begins_at_the_surface_and_goes_where_it_should(half):
    scene = scenes.excavation(cell=0.025, half=half)
    (blade,) = scene.bodies
    assert scene.grid.upper[1] == pytest.approx(0.35 if half else 0.7)
    assert scene.duration == pytest.approx(20.4)
    # the front edge is at the surface, the back 6 mm behind; the top leans back by 3.8 deg
    lean = math.tan(math.radians(3.8))
    places = np.array([[0.3, 0.0], [0.3 - 0.2 * lean, 0.2]])
    middle = 0.0 if half else 0.35
    at = np.stack([places[:, 0], np.full(2, middle), places[:, 1]], axis=1)
    distance, normal = blade.distance(at)
    assert distance == pytest.approx(0.0, abs=1e-12)
    assert normal[1, 0] == pytest.approx(math.cos(math.radians(3.8)))
    assert blade.distance(at[1:] - [0.006, 0.0, 0.0])[0] == pytest.approx(0.0, abs=2e-5)
    # trapezoids: 0.05 m down and forward, 0.64 m forward, 0.05 m up and forward
    times = np.array(blade.motion.times)
    velocity = np.array(blade.motion.velocity)
    way = cumulative_trapezoid(velocity, times, axis=0, initial=0)
    assert way[-1] == pytest.approx([0.74, 0.0, 0.0])
    assert way[:, 2].min() == pytest.approx(-0.05)
    # 0.05 m of the dive and the first 0.05 s of the forward motion
    assert np.interp(2.25, times, way[:, 0]) == pytest.approx(0.05 + 0.05 * 0.04)


def test_thick_blades_stay_as_they_are():
    (blade,) = scenes.excavation(cell=0.0125, blade=(0.04, 0.305, 0.457)).bodies
    assert blade.shape.size == (0.04, 0.305, 0.457)
    (blade,) = scenes.excavation(cell=0.0125, width=0.3, blade=(0.04, 0.3, 0.4)).bodies
    ends = blade.distance(np.array([[0.29, 0.0, 0.1], [0.29, 0.15, 0.1]]))[0]
    assert (ends < 0).all()  # from wall to wall, nodes on the wall included
    # the sides are separated by a particle density
    (blade,) = scenes.excavation(cell=0.0125).bodies
    assert blade.shape.size == (0.006, 0.305, 0.457)
    (blade,) = scenes.excavation(cell=0.0125, scheme=gr.schemes.default).bodies
    assert blade.shape.size == (0.025, 0.305, 0.457)


@pytest.mark.parametrize(("slip", "speed"), [(0.2, 0.0156), (0.4, 0.0117), (0.7, 0.00585)])
def test_wheel_slips_as_in_the_paper(slip, speed):
    scene = scenes.wheel(slip=slip)
    (wheel,) = scene.bodies
    assert wheel.motion.velocity[-1] == pytest.approx((speed, 0.0, 0.0))
    assert wheel.motion.angular_velocity[-1] == (0.0, 0.13, 0.0)
    assert wheel.mass * 9.81 == pytest.approx(164.0) and wheel.free == "z"
    # touches the surface along a line of 0.125 m
    lowest = [[0.25, y, 0.0] for y in (0.0, 0.12)]
    assert wheel.distance(np.array(lowest))[0] == pytest.approx(0.0, abs=1e-12)
    assert wheel.distance(np.array([[0.25, 0.13, 0.1]]))[0] == pytest.approx(0.005)


def test_bucket_is_open_above_and_before():
    scene = scenes.excavator()
    (bucket,) = scene.bodies
    assert scene.material.K == pytest.approx(1e5) and scene.material.G == pytest.approx(6e4)
    lean = math.radians(30.0)
    axes = np.array(
        [[math.cos(lean), 0.0, -math.sin(lean)], [0, 1, 0], [math.sin(lean), 0, math.cos(lean)]]
    )
    inner = np.array([[-0.15, 0.0, 0.2], [-0.15, 0.0, 0.5], [0.1, 0.0, 0.2]]) @ axes
    sheets = np.array([[-0.15, 0.0, 0.01], [-0.3, 0.0, 0.2], [-0.15, 0.13, 0.2]]) @ axes
    where = np.array([0.35, 0.0, 0.0])  # position of the edge
    assert bucket.distance(where[None])[0] == pytest.approx(0.0, abs=1e-12)
    assert (bucket.distance(inner + where)[0] > 0).all()
    assert (bucket.distance(sheets + where)[0] < 0).all()
    # 90 degrees in all, at a constant rate
    times = np.array(bucket.motion.times)
    turning = np.array(bucket.motion.angular_velocity)[:, 1]
    turned = np.trapezoid(turning, times)
    turned += (scene.duration - times[-1]) * turning[-1]
    assert math.degrees(turned) == pytest.approx(-90.0)


def test_beds_are_in_balance_from_the_start():
    """dp/dz = -k rho g with p = K c exp(c), c = ln(rho/rho_c): c + c^2/2 = k rho_c g z/K."""
    scene = scenes.excavation(cell=0.025)
    K, rho = scene.material.K, scene.material.rho_c
    k = (1 + 2 * scene.material.K0) / 3
    c = np.sqrt(1 + 2 * k * rho * 9.81 * 0.15 / K) - 1
    column = K * c * np.exp(c) / (9.81 * k)  # mass per square metre
    mass = initial_points(scene)["mass"].sum()
    # by the midpoint rule over 12 points
    assert mass == pytest.approx(1.6 * 0.35 * column, rel=1e-5)
    assert mass > 1.6 * 0.35 * 0.15 * rho * (1 + 5e-4)
