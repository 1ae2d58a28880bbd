"""Fluidity at bodies, images in periodic directions, and the time step with fast bodies."""

import dataclasses

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular import NGF, Body, Fill, Fluidity, Gravity, Grid, Motion, Wall
from granular.shapes import Box, Cylinder, HalfSpace

CELL, HEIGHT, BELOW = 0.01, 8, 3
TIME_STEP = 1e-4
SWEEPS = 1e-2
"""Error of contact: sweeps over the feet end when they change velocities by less than this part of
what contact changes in the step (csrc/contact/contact.c)."""
GRAINS = NGF(
    E=1e6, mu_s=0.38, mu_2=0.64, I0=0.28, d=5e-3, rho_s=2450.0, A=0.5, t0=1e-3
)  # fmt: skip


def layer(dim, stencil, elasticity, **scene):
    """A periodic layer on a slope of 24 degrees, linear functions: nodes lie on the grid lines."""
    length = (2,) * (dim - 1)
    lower = (0.0,) * (dim - 1)
    upper = tuple(n * CELL for n in length)
    tilted = 9.8 * np.array([np.sin(np.radians(24)), *(0,) * (dim - 2), -np.cos(np.radians(24))])
    down = (0.0,) * (dim - 1) + (-9.8,)  # at first, for the lithostatic fill
    below = scene.pop("below", 0)
    return scene_with(
        grid=Grid(
            (*lower, -below * CELL), CELL, (*length, HEIGHT + 2 + below),
            periodic=(True,) * (dim - 1) + (False,),
        ),
        fills=(Fill(Box((*lower, 0.0), (*upper, HEIGHT * CELL)), 2**dim, lithostatic=True),),
        material=GRAINS.replace(elasticity=elasticity),
        scheme=gr.Scheme(
            basis="linear", transfer="apic", density=gr.ParticleDensity(), dt=TIME_STEP,
            fluidity=Fluidity(method="implicit", stencil=stencil, initial=1.0),
        ),
        gravity=Gravity((0.0, 1e-6), (down, tuple(tilted))),
        **scene,
    )  # fmt: skip


def flow(scene):
    sim = gr.Simulation(scene, threads=1)
    sim.step(400)
    return sim.state


@pytest.mark.parametrize("stencil", ["faces", "isotropic"])
@pytest.mark.parametrize(("dim", "elasticity"), [(2, "hypoelastic"), (3, "hencky")])
def test_a_no_slip_body_is_a_no_slip_wall(dim, elasticity, stencil):
    """On common nodes and faces a rough body acts as a no-slip wall; a smooth one differs.

    Contact holds the velocity at the base to a part of what gravity adds in a step. The fluidity
    follows the flow, with the same relative error.
    """
    up = (0.0,) * (dim - 1) + (1.0,)
    ground = HalfSpace(up, (0.0,) * (dim - 1) + (1e-9,))
    wall = flow(layer(dim, stencil, elasticity, walls=(Wall(dim - 1, 0.0, kind="no_slip"),)))
    body = {}
    for rough in (True, False):
        ground_body = Body(ground, (0.0,) * dim, contact="sticky", rough=rough)
        body[rough] = flow(layer(dim, stencil, elasticity, below=BELOW, bodies=(ground_body,)))
    fastest = wall.v[:, 0].max()
    error = SWEEPS * 9.8 * TIME_STEP / fastest
    assert fastest > 0.03
    assert error < 3e-4
    for name in ("v", "g"):
        reference, found = (getattr(state, name) for state in (wall, body[True]))
        np.testing.assert_allclose(found, reference, rtol=0, atol=error * abs(reference).max())
        assert abs(getattr(body[False], name) - reference).max() > 0.1 * abs(reference).max()


# ---- periodic directions ----


def pool(shift, *, dim=2, height=0.15, turning=None, **body):
    """A periodic bed with a paddle whose position is `shift` cells along x."""
    length = (10,) * (dim - 1)
    # no face on a node, no node as near to one face as to another
    position = (0.26 + 0.1 * shift, *(0.27,) * (dim - 2), 0.33)
    motion = Motion(
        velocity=((0.4, *(0.0,) * (dim - 2), -0.2),),
        angular_velocity=None if turning is None else (turning,),
    )
    paddle = Box(size=(0.15,) * (dim - 1) + (height,))
    return scene_with(
        grid=Grid((0.0,) * dim, 0.05, (*length, 10), periodic=(True,) * (dim - 1) + (False,)),
        fills=(Fill(Box((0.0,) * dim, (0.5,) * (dim - 1) + (0.3,)), 2**dim),),
        scheme=gr.Scheme(basis="quadratic", transfer="apic", density=gr.ParticleDensity(), dt=4e-4),
        walls=(Wall(dim - 1, 0.0, kind="no_slip"),),
        bodies=(Body(paddle, position, motion=motion, friction=0.3, **body),),
    )


@pytest.mark.parametrize(
    ("dim", "options"),
    [
        (2, {}),
        (3, {}),
        # posts longer than the period, which only have to fit along the periodic axes
        (2, {"height": 0.7}),
        (3, {"height": 0.7}),
        (3, {"height": 0.7, "turning": (0.0, 0.0, 4.0)}),
    ],
)
def test_bodies_have_images(dim, options):
    """The result is independent of where the period ends and how often a body has passed it.

    Shifts change the order of the feet, and by round-off which of the points of a regular pattern
    have one: points at one distance from an edge, and on the faces of cells.
    """
    impulses = {}
    for shift in (0, 2, -3, 30):
        sim = gr.Simulation(pool(shift, dim=dim, **options), threads=1)
        sim.step(60)  # before round-off decides whether a point is disconnected
        impulses[shift] = np.append(sim.bodies[0].impulse, sim.bodies[0].angular_impulse)
    assert np.linalg.norm(impulses[0][:dim]) > 0.1
    for shift in (30, 2, -3):
        np.testing.assert_allclose(
            impulses[shift], impulses[0], rtol=0, atol=0.01 * abs(impulses[0]).max()
        )


def test_bodies_whose_images_meet_are_refused():
    scene = pool(0)
    for body, message in (
        (Body(Box(size=(0.6, 0.1)), (0.2, 0.3)), r"bodies\[0\] reaches 0.3\d* m .* <= 0.25 m"),
        (Body(HalfSpace((0.1, 1.0)), (0.2, 0.3)), "reaches inf m"),
        (Body(Cylinder(0.3, center=(0, 0), inside=True), (0.2, 0.3)), "reaches inf m"),
    ):
        with pytest.raises(ValueError, match=message):
            scene.replace(bodies=(body,))
    space = pool(0, dim=3)
    axle = Cylinder(0.1, center=(0, 0, 0), axis=(0, 1, 0))
    space.replace(bodies=(Body(axle, (0.2, 0.2, 0.3)),))  # endless along y, fits along x
    wide = Cylinder(0.3, center=(0, 0, 0), axis=(0, 1, 0))
    with pytest.raises(ValueError, match=r"reaches 0.3 m .* along x .* <= 0.25 m"):
        space.replace(bodies=(Body(wide, (0.2, 0.2, 0.3)),))
    post = Body(Box(size=(0.1, 0.1, 2.0)), (0.2, 0.2, 0.3))
    for turn in ((0, 0, 1), (0, 0, 0)):
        upright = Motion(velocity=((0,) * 3,), angular_velocity=(turn,))
        space.replace(bodies=(dataclasses.replace(post, motion=upright),))
    tilting = Motion(velocity=((0,) * 3,), angular_velocity=((0, 1, 0),))
    with pytest.raises(ValueError, match=r"reaches 1.00125 m .* along x in its motion"):
        space.replace(bodies=(dataclasses.replace(post, motion=tilting),))
    narrow = Grid((0.0,) * 3, 0.05, (10, 10, 10), periodic=(False, True, False))
    turning = [Motion(velocity=((0,) * 3,), angular_velocity=(w,)) for w in ((0, 1, 0), (0, 0, 1))]
    walled = space.replace(grid=narrow, bodies=(Body(axle, (0.2, 0.2, 0.3), motion=turning[0]),))
    walled.replace(bodies=(Body(Box(size=(0.1, np.inf, 0.1)), (0.2, 0.2, 0.3)),))
    with pytest.raises(ValueError, match="turn about no other axis"):
        walled.replace(bodies=(Body(axle, (0.2, 0.2, 0.3), motion=turning[1]),))


# ---- the time step ----


def test_time_step_knows_the_speed_of_bodies():
    """The step uses the fastest place: a corner, a rim; in the domain if a body is infinite."""
    scene = pool(0).replace(
        scheme=gr.Scheme(transfer="apic", density=gr.ParticleDensity(), cfl=0.4)
    )
    wave = scene.material.wave_speed
    walled = scene.replace(grid=Grid((0.0, 0.0), 0.05, (10, 10)))
    spin = Motion(velocity=((0.0, 3.0),), angular_velocity=(50.0,))
    for shape, speed in (
        (Box(size=(0.6, 0.8)), np.hypot(50.0 * 0.4, 50.0 * 0.3 + 3.0)),
        # corner of the square domain
        (Cylinder(0.2, center=(0, 0)), np.hypot(50.0 * 0.2, 50.0 * 0.2 + 3.0)),
        (HalfSpace((0.0, 1.0)), 3.0 + 50.0 * np.hypot(0.25, 10.5)),
    ):
        far = Body(shape, (0.25, -10.0), motion=spin)
        sim = gr.Simulation(walled.replace(bodies=(far,)), threads=1)
        assert sim.dt == pytest.approx(0.4 * 0.05 / (wave + speed), rel=1e-12)
        limit = 0.64 * 0.05 / (wave + speed)
        fixed = gr.Scheme(transfer="apic", density=gr.ParticleDensity(), dt=1.01 * limit)
        with pytest.raises(ValueError, match=r"dt = .* points or bodies of"):
            gr.Simulation(walled.replace(bodies=(far,), scheme=fixed))
        gr.Simulation(walled.replace(bodies=(far,), scheme=fixed.replace(dt=0.99 * limit)))
