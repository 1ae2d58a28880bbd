"""Froude scaling: the same flow at another size, to the last bit for powers of two."""

import dataclasses
import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import (
    Body,
    Elastic,
    Fill,
    Gravity,
    Grid,
    Motion,
    Solid,
    SpongeLayer,
    Wall,
    scaling,
)
from granular.mpm.scaling import POWERS, Froude
from granular.shapes import Box, Cylinder, Difference, HalfSpace, Sphere, Union

FIELDS = {
    **{"x": "length", "v": "velocity", "stress": "stress"},
    **{"shear_rate": "rate", "log_density": "none", "mass": "mass"},
}


def scene_3d():
    """A 3D silo that drains, with a blade that is pushed, rotated and free to sink."""
    motion = Motion(
        times=(0.0, 0.1),
        velocity=((0.0, 0.0, 0.0), (0.1, 0.0, -0.3)),
        angular_velocity=((0.0, 0.0, 0.0), (0.0, 2.0, 0.0)),
    )
    given = {"motion": motion, "friction": 0.3, "free": "z", "mass": 0.5}
    blade = Body(Box(size=(0.03, 0.025, 0.2)), (0.12, 0.0125, 0.21), **given)
    fluidity = gr.schemes.Fluidity(floor=1e-4, reconnect_fluidity=True)
    scheme = gr.schemes.default.replace(fluidity=fluidity)
    scene = gr.scenes.silo_3d(cell=0.0125, width=0.025, scheme=scheme)
    return scene.replace(bodies=(blade,))


def scene_2d():
    """A 2D scene with all other parts that have a length or a time."""
    shapes = (Cylinder(0.05, center=(0.0, 0.1)), Box(size=(0.1, 0.1), rotation_deg=20.0))
    region = Difference(Box((0.0, 0.0), (0.8, 0.4)), Sphere(0.1, center=(0.4, 0.4)))
    return scene_with(
        grid=Grid((0.0, 0.0), 0.05, (20, 14)),
        fills=(Fill(region, 4, velocity=(0.1, 0.0), jitter=0.5),),
        scheme=gr.Scheme(transfer="flip", density=gr.ParticleDensity(), flip_decay=3.0, dt=2e-4),
        walls=(
            Wall(1, 0.0, kind="no_slip", span=((0.0, 0.5),)),
            Wall(0, 0.0, kind="coulomb", friction=0.3, opens_at=0.05),
            Solid((0.8, 0.0), (1.0, 0.1)),
        ),
        sponge_layers=(SpongeLayer(1, 0.35, damping=30.0),),
        bodies=(
            Body(Union(shapes), (0.4, 0.35), friction=0.2, free="y", mass=20.0),
            Body(HalfSpace((-1.0, 0.0), (0.05, 0.0)), (0.9, 0.0)),
        ),
        gravity=Gravity((0.0, 0.05), ((0.0, 0.0), (1.0, -9.8))),
        seed=3,
    )


@pytest.mark.parametrize("make", [scene_3d, scene_2d])
def test_the_same_flow_to_the_last_bit(make):
    scene, ratio = make(), Froude(1 / 4)
    dim = scene.dim
    small = ratio.scene(scene)
    assert small.grid.cell == scene.grid.cell / 4
    real, model = (gr.Simulation(s, threads=1) for s in (scene, small))
    for sim in (real, model):
        sim.step(400)
    assert real.time / 2 == model.time and real.n_points == model.n_points
    here, there = real.state, model.state
    assert np.abs(here.v).max() > 0.1
    for name, quantity in FIELDS.items():
        value = ratio.real(quantity, getattr(there, name), dim=dim)
        assert np.array_equal(value, getattr(here, name)), name
    if scene.material.has_fluidity:
        assert np.array_equal(ratio.real("rate", there.g), here.g)
    felt, model_felt = real.bodies[0], model.bodies[0]
    assert np.linalg.norm(felt.impulse) > 0
    for name in ("position", "velocity", "impulse", "angular_impulse"):
        quantity = "length" if name == "position" else name
        value = ratio.real(quantity, getattr(model_felt, name), dim=dim)
        assert np.array_equal(value, getattr(felt, name)), name


def test_there_and_back_numbers_without_dimension_stay():
    scene = scene_2d()
    back = Froude(16.0).scene(Froude(1 / 16).scene(scene))
    assert back.parameters["froude_length"] == 1.0
    assert back.replace(parameters=scene.parameters) == scene
    assert Froude(0.25).scene(Froude(0.25).scene(scene)).parameters["froude_length"] == 1 / 16
    grains = gr.materials.grc_1
    small = Froude(0.25).scene(gr.scenes.silo_3d(material=grains)).material
    assert (small.E, small.d, small.t0) == (grains.E / 4, grains.d / 4, grains.t0 / 2)
    kept = ("nu", "mu_s", "mu_2", "I0", "b", "A", "rho_c", "rho_s")
    assert all(getattr(small, name) == getattr(grains, name) for name in kept)


def test_factors_are_those_of_dimensions():
    """Factors of m, kg, s: at one gravity and density [time^2] = [length], [mass] = [length^3]."""
    ratio = Froude(0.36)
    f = {name: ratio.factor(name) for name in POWERS}
    assert (f["length"], f["time"]) == pytest.approx((0.36, 0.6))
    assert f["velocity"] == pytest.approx(f["length"] / f["time"])
    assert f["acceleration"] == pytest.approx(f["velocity"] / f["time"])
    assert f["force"] == pytest.approx(f["mass"] * f["acceleration"])
    assert f["stress"] == pytest.approx(f["force"] / f["length"] ** 2)
    assert f["density"] == pytest.approx(f["mass"] / f["length"] ** 3)
    assert f["impulse"] == pytest.approx(f["force"] * f["time"])
    assert f["torque"] == pytest.approx(f["force"] * f["length"]) == f["energy"]
    assert f["angular_impulse"] == pytest.approx(f["torque"] * f["time"])
    assert f["power"] == pytest.approx(f["energy"] / f["time"])
    assert f["rate"] == f["angular_velocity"] == pytest.approx(1 / f["time"])
    assert ratio.factor("force", dim=2) == pytest.approx(f["force"] / f["length"])
    # the scripts of the paper: time and velocity x 1/2, omega x 2, force x 1/64
    quarter = Froude(0.25)
    factors = [quarter.factor(q) for q in ("time", "velocity", "angular_velocity", "force")]
    assert factors == [0.5, 0.5, 2.0, 1 / 64]


NUMBERS = {
    *("nu", "mu_s", "mu_2", "mu", "rho_c", "rho_s", "I0", "b", "A", "xi", "friction", "density"),
    *("rotation_deg", "seed", "jitter", "vectors", "normal", "axis", "points_per_cell", "shape"),
    *("faces", "h0_deg", "h1_deg", "h2", "h3_deg", "alpha", "mu_inf", "restitution", "K0"),
    *("phi_c", "phi_fast", "dilatancy", "csl_slope", "csl_exponent", "packing"),
}
"""Fields without a dimension, or determined by gravity and density alone (xi by itself)."""


def test_every_number_of_a_scene_was_thought_of():
    """A new field with a dimension must be named in granular.mpm.scaling."""
    for kind, quantities in scaling._QUANTITIES.items():
        for field in dataclasses.fields(kind):
            number = any(word in str(field.type) for word in ("float", "int", "Vector", "Span"))
            declared = getattr(kind, "units", {})  # with their units, in the core
            known = field.name in {*quantities, *declared, *NUMBERS}
            assert known or not number, (kind.__name__, field.name)
        assert set(quantities.values()) <= set(POWERS)


def test_bad_ratios_and_quantities():
    for value in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ValueError, match="length"):
            Froude(value)
    with pytest.raises(ValueError, match="quantity = 'colour'"):
        Froude(0.25).factor("colour")
    with pytest.raises(ValueError, match="dim = 4"):
        Froude(0.25).real("force", [1.0], dim=4)
    with pytest.raises(TypeError, match="scene = None"):
        Froude(0.25).scene(None)

    class Odd(Elastic):
        pass

    with pytest.raises(TypeError, match="cannot be scaled"):
        Froude(0.25).scene(scene_2d().replace(material=Odd()))
    own = gr.materials.from_function(own_law, parameters={"cohesion": 100.0})
    with pytest.raises(TypeError, match="the units of its numbers are not known"):
        Froude(0.25).scene(scene_2d().replace(material=own))


def own_law(dt, numbers, gradient, log_density, stress, shear_rate, history):
    """Leave the stress of the elastic predictor."""
