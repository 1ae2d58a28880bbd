"""Measures of hoppers and drums on states made by hand, and the theory beside them."""

import math

import numpy as np
import pytest
import synthetic

import granular as gr
from granular import theory

R, SLOPE, OMEGA = 0.2, math.radians(25.0), 1.5


def drum_state(sign, *, base=-0.05, steep=20.0, time=0.0):
    """A bed in rigid rotation below a layer in which the slip grows linearly."""
    scene = synthetic.scene((44, 44), 0.01, lower=(-0.22, -0.22))
    along = np.array([math.cos(SLOPE), sign * math.sin(SLOPE)])
    across = np.array([-along[1], along[0]])
    x = synthetic.regular_points(scene, 4, lambda x: (np.hypot(*x.T) < R) & (x @ across < 0.0))
    slip = steep * np.maximum(x @ across - base, 0.0)
    turned = sign * OMEGA * np.stack([-x[:, 1], x[:, 0]], axis=1)
    v = turned - sign * slip[:, None] * along
    return synthetic.state(scene, x, per_cell=16, v=v, time=time)


@pytest.mark.parametrize("sign", [1, -1])
def test_flow_of_a_drum(sign):
    flow = gr.measure.drum_flow(drum_state(sign), radius=R, omega=sign * OMEGA)
    assert flow.slope_deg == pytest.approx(sign * 25.0, abs=0.3)
    assert flow.frames == 1 and math.isnan(flow.slope_spread_deg)
    middle = abs(flow.s) < 0.1
    assert middle.sum() == 20
    # 1 mm is 2 % of the slip at the surface, where the layer begins; bins are 5 mm.
    assert flow.thickness[middle] == pytest.approx(0.05, abs=0.004)
    assert flow.surface[middle] == pytest.approx(0.0, abs=1e-12)
    flux = (20.0 - OMEGA) * 0.05**2 / 2
    # Rows of points are at 25 degrees to the sections: these have four points more or less.
    assert flow.flux[middle] == pytest.approx(flux, rel=0.05)
    assert flow.flux[middle].mean() == pytest.approx(flux, rel=0.01)
    assert flow.flux == pytest.approx(flow.thickness * flow.speed)
    carried = 0.5 * OMEGA * (R**2 - flow.s**2 - 0.05**2)
    assert flow.balance[middle] == pytest.approx(carried[middle], rel=0.01)


def test_what_the_slope_of_a_drum_stores_is_taken_off():
    first, last = drum_state(1), drum_state(1, time=0.5)
    heavier = last.x @ (math.cos(SLOPE), math.sin(SLOPE)) > 0.11
    last.mass = np.where(heavier, 1.1, 1.0) * last.mass
    added = (last.mass - first.mass).sum() / synthetic.RHO_C / 0.5
    known = {"radius": R, "omega": OMEGA}
    still, grown = (
        gr.measure.drum_flow(first, **known),
        gr.measure.drum_flow([first, last], **known),
    )
    below = abs(still.s) < 0.08
    lost = (still.balance - grown.balance)[: len(below)][below]
    assert lost == pytest.approx(added, rel=1e-3)
    with pytest.raises(ValueError, match="radius = None: the scene has no parameter radius"):
        gr.measure.drum_flow(first)
    with pytest.raises(ValueError, match=r"omega = 0.0 must be finite and not 0"):
        gr.measure.drum_flow(first, radius=R, omega=0.0)


def test_index_of_mass_flow():
    scene = gr.scenes.hopper()
    points = scene.points()
    gap = np.min([body.distance(points.x)[0] for body in scene.bodies], axis=0)
    v = np.zeros_like(points.x)
    v[:, 1] = np.where(points.x[:, 0] < 0.02, -1.0, 0.0)
    v[gap < 0.01] = (0.15, -0.2)
    state = synthetic.state(scene, points.x, mass=points.volume * 1500.0, v=v)
    flow = gr.measure.hopper_flow(state)
    filled = flow.z < 0.6
    assert flow.axis[filled] == pytest.approx(1.0) and flow.wall[filled] == pytest.approx(0.25)
    assert flow.index[filled] == pytest.approx(0.25) and not flow.mass_flow
    assert np.isnan(flow.index[~filled]).all()
    with pytest.raises(ValueError, match="'silo' has no bodies"):
        gr.measure.hopper_flow(synthetic.state(gr.scenes.silo(), [[0.1, 0.1]]))


def test_theory_of_hoppers():
    # sin w/sin d = 0.4465 and (1 - sin d)/(2 sin d) = 0.1527, by hand
    assert theory.mass_flow_limit(20.0, 50.0, dim=3) == pytest.approx(26.1, abs=0.1)
    assert theory.mass_flow_limit(20.0, 30.0) == pytest.approx((42.52 - 20) / 0.725, abs=0.01)
    # K = 3: v^2 = g r (K + 1)/(K - 2) below a high surface, and the arc is 2 a r = D
    angle, orifice = 0.01, 0.1
    r = orifice / (2 * math.sin(math.radians(angle)))
    high = theory.hourglass_rate(orifice, angle, 1e12, mu=0.5, rho=1500.0)
    assert high == pytest.approx(1500.0 * orifice * math.sqrt(4 * 9.81 * r), rel=1e-3)
    # without friction between the arcs: Bernoulli with v r constant
    smooth = theory.hourglass_rate(orifice, angle, 1500.0 * 0.5 * orifice, mu=0.0, rho=1500.0)
    far = math.sqrt(r**2 + orifice * 0.5 / math.radians(2 * angle) * 2)
    head = 2 * 9.81 * (far - r) / (1 - (r / far) ** 2)
    assert smooth == pytest.approx(1500.0 * orifice * math.sqrt(head), rel=1e-6)
    # the exponent of r is -1 at mu = 1/3, where rates on both sides meet
    around = [
        theory.hourglass_rate(0.06, 20.0, 20.0, mu=mu, rho=1500.0)
        for mu in (1 / 3 - 1e-6, 1 / 3, 1 / 3 + 1e-6)
    ]
    assert around == pytest.approx([around[1]] * 3, rel=1e-5)
    factor = theory.rose_tanaka_factor([15.0, 45.0, 80.0], 45.0)
    assert factor == pytest.approx([math.tan(math.radians(15.0)) ** -0.35, 1.0, 1.0])
    wall = {"friction": 0.3, "ratio": 0.5, "rho": 1500.0}
    deep = 1500.0 * 9.81 * 0.2 / (2 * 0.3 * 0.5)
    assert theory.janssen_pressure([0.0, 1e3], 0.2, **wall) == pytest.approx([0.0, deep])
    assert theory.janssen_pressure(1e3, 0.2, **wall, dim=3) == pytest.approx(deep / 2)
    shallow = theory.janssen_pressure(1e-6, 0.2, **wall)
    assert shallow == pytest.approx(1500.0 * 9.81e-6)
    assert theory.janssen_pressure(2.0, 0.2, friction=0.0, ratio=0.5, rho=1.0) == 19.62
    for call, words in (
        (lambda: theory.mass_flow_limit(30.0, 25.0), "wall_deg = 30"),
        (lambda: theory.hourglass_rate(0.1, 10.0, 1.0, mu=1.0, rho=1.0), "mu = 1"),
        (lambda: theory.rose_tanaka_factor(0.0, 45.0), "angle_deg = 0"),
        (lambda: theory.janssen_pressure(-1.0, 0.2, **wall), "depth = -1"),
    ):
        with pytest.raises(ValueError, match=words):
            call()
