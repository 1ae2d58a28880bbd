"""Scenes of Haeri & Skonieczny 2021 against results that need no digitised figure."""

import math

import numpy as np
import pytest

import granular as gr
from granular.theory import couette_flow, couette_quasi_static

FRICTION_ANGLE = math.degrees(math.atan(0.3819))


# ---- silo ----


def drained(until, **size):
    """A silo that has drained, and the fraction of its mass that is left."""
    sim = gr.Simulation(gr.scenes.silo_3d(**size), threads=1)
    begin = sim.state.mass.sum()
    sim.run(until=until, every=until)
    return sim, sim.state.mass.sum() / begin


def slope(sim):
    return gr.measure.repose_angle(sim.state, along="x", side="left").mean_deg


def wedge(scene):
    """Fraction of the mass below a plane from the edge of the slot at the friction angle.

    More is left in the run: the material at the edge is about half a cell high and leaves last.
    """
    size = scene.parameters
    rest = size["length"] - size["slot"]
    return rest**2 * math.tan(math.radians(FRICTION_ANGLE)) / 2 / (size["length"] * size["height"])


def test_silo_drains_to_the_friction_angle():
    """While it drains, until about 6 s, the slope is up to 3 degrees steeper."""
    sim, left = drained(8.0, cell=0.0125, width=0.0125)
    assert slope(sim) == pytest.approx(FRICTION_ANGLE, abs=2.0)
    assert wedge(sim.scene) < left < 1.25 * wedge(sim.scene)
    assert np.abs(sim.state.v).max() < 0.5
    assert sim.state.dense.mean() > 0.9


@pytest.mark.slow
def test_silo_in_finer_cells():
    sim, left = drained(12.0, width=0.0125)
    assert slope(sim) == pytest.approx(FRICTION_ANGLE, abs=2.0)
    assert wedge(sim.scene) < left < 1.12 * wedge(sim.scene)


# ---- between cylinders ----

D = 0.016
"""Grain size [m], large enough for 3D runs in cells of a quarter of it."""


def beads(**changes):
    grains = gr.materials.couette_beads.replace(E=1.4e5, nu=0.3, mu_2=math.inf, b=0.941, d=D)
    return grains.replace(**changes)


def turning(until, material, *, begin=None, frames=10, above=None, **size):
    """Profile between two times, half of the last and the last, and the moments."""
    scene = gr.scenes.couette(**({"inner": 0.1} | size), material=material)
    sim = gr.Simulation(scene)
    begin = until / 2 if begin is None else begin
    sim.run(until=begin, every=until)
    kept, start, felt = [sim.state], sim.time, sim.bodies
    hooks = (lambda sim: kept.append(sim.state),)
    sim.run(until=until, every=(until - begin) / frames, hooks=hooks)
    span = sim.time - start
    profile = gr.measure.cylinder_profile(kept, above=above)
    torque = [
        (now.angular_impulse - before.angular_impulse) / span
        for now, before in zip(sim.bodies, felt, strict=True)
    ]
    return profile, torque


def error(profile, omega, flow):
    """Differences of the speed, relative to that of the wall, and of omega alone."""
    expected = np.interp(profile.r, flow.r, flow.omega)
    return np.abs(profile.omega / omega - expected) * profile.r / 0.1


def tail(r, omega):
    """Length over which omega falls by a factor e, outside of the flow at the inner cylinder."""
    far = (r > 0.11) & (r < 0.135)
    return -1 / np.polyfit(r[far], np.log(omega[far]), 1)[0]


PLANE = {"outer": 0.15, "height": 0.08, "cell": 0.004, "pressure": 5e3, "omega": 1.0}


def test_flow_between_cylinders_in_2d():
    """Grains and cells of 4 mm, as in the paper: within 3 % of the wall's speed, with the tail.

    At the beginning, as the pressure of a closed ring falls: by 6 % until then.
    """
    material = beads(d=0.004)
    profile, torque = turning(0.15, material, **PLANE)
    smooth, rough = (
        couette_flow(0.1, 0.15, material, rate=1.0, pressure=5e3, walls=walls)
        for walls in ("smooth", "rough")
    )
    assert error(profile, 1.0, smooth).max() < 0.03
    assert error(profile, 1.0, rough).max() > 0.2  # cylinders do not hold the fluidity
    # the tail is hardly longer than a ring is wide
    assert tail(profile.r, profile.omega) == pytest.approx(tail(smooth.r, smooth.omega), rel=0.15)
    # steady: the two cylinders have equal and opposite moments
    assert torque[0] == pytest.approx(-torque[1], rel=0.02)
    # in cells of 2 mm within 1 %
    moment = 2 * np.pi * 0.1**2 * smooth.mu_wall * 5e3
    assert torque[1] == pytest.approx(moment, rel=0.04)


@pytest.mark.slow
def test_no_slip_cylinders_hold_the_fluidity():
    """As in the figure: the fluidity should be 0 in the material held by an overlap."""
    material = beads(d=0.004)
    profile, _ = turning(0.4, material, rough=True, **PLANE)
    flow = couette_flow(0.1, 0.15, material, rate=1.0, pressure=5e3, walls="rough")
    assert error(profile, 1.0, flow).max() < 0.05


def test_local_flow_between_cylinders_has_no_tail():
    profile, _ = turning(0.1, beads(d=0.004, A=0.0), **PLANE)
    flow = couette_flow(0.1, 0.15, beads(d=0.004), rate=1.0, pressure=5e3, walls="smooth")
    far = profile.r > 0.112
    assert np.abs(profile.omega[far]).max() < 0.01
    assert np.interp(0.114, flow.r, flow.omega) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("omega", [0.25, 0.5])
def test_top_of_a_taylor_couette_cell(omega):
    """Under gravity, in cells of d/4, the profile has the shape of the slow limit at both rates.

    It is within 3 % of the wall's speed, and the moment is that of each rate.
    """
    material = beads()
    size = {"outer": 0.15, "height": 0.02, "cell": 0.004}
    profile, torque = turning(0.4, material, omega=omega, above=0.014, **size)
    flow = couette_quasi_static(0.1, 0.15, material, walls="smooth")
    assert error(profile, omega, flow).max() < 0.03
    height = size["height"]
    weight = material.rho_c * 9.81 * height
    driven = couette_flow(0.1, 0.15, material, rate=omega, pressure=weight / 2, walls="smooth")
    moment = 2 * np.pi * 0.1**2 * driven.mu_wall * weight / 2 * height
    assert -torque[0][2] == pytest.approx(moment, rel=0.05)
    assert torque[1][2] == pytest.approx(-torque[0][2], rel=0.03)


PAPER = {"inner": 0.0999, "outer": 0.2001, "cell": 0.004, "frames": 4}
"""Radii and cells of the paper; 4 mm are one diameter."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("height", "omega", "begin", "until"),
    [
        pytest.param(0.024, 0.025, 0.3, 0.6, id="24mm"),
        pytest.param(0.1, 0.1, 0.3, 0.5, id="100mm"),
    ],
)
def test_top_of_the_papers_taylor_couette_cell(height, omega, begin, until):
    """Radii, grains and cells of the paper; measured after all of it has yielded, not after its 22
    s.

    The elastic twist before yield at the bottom is mu_w p/S (1 - (R_i/R_o)^2)/2: 0.26 s and 0.27 s
    of rotation. Then the ring swings for a while, with a period of 0.08 s, in which a shear wave
    crosses the gap twice, so that the profile is a mean over more than two periods. A height of
    24 mm at the rate of the paper takes 4 minutes on one core; its 100 mm at 4 times the rate take
    13 minutes. The reference is the flow at this rate under the pressure of the two cells that are
    measured; at 4 times the rate it differs by 0.02 from the slow limit.
    """
    material = gr.scenes.couette().material
    above = height - 2 * PAPER["cell"]
    turned = {"height": height, "omega": omega, "begin": begin, "above": above}
    profile, torque = turning(until, material, **PAPER, **turned)
    linear = material.replace(mu_2=math.inf, b=material.b)
    weight = material.rho_c * 9.81 * height
    profile_at, moment_at = (
        couette_flow(PAPER["inner"], PAPER["outer"], linear, rate=omega, pressure=p, walls="smooth")
        for p in (material.rho_c * 9.81 * PAPER["cell"], weight / 2)
    )
    assert error(profile, omega, profile_at).max() < 0.03
    moment = 2 * np.pi * PAPER["inner"] ** 2 * moment_at.mu_wall * weight / 2 * height
    # 3 % less in cells of d; in finer cells, above, within 4 %
    assert -torque[0][2] == pytest.approx(moment, rel=0.08)
    assert torque[1][2] == pytest.approx(-torque[0][2], rel=0.05)
