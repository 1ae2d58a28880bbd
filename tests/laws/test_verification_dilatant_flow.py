"""DilatantMuI in flow: layers against theory, rest, conservation, the same bits, refusals."""

import math

import numpy as np
import pytest
from same_bits import bits, same_bits, stepped
from scenes_by_hand import scene_with

import granular as gr
from granular.measure.energy import plastic_power
from granular.measure.profiles import inertial_number
from granular.mpm.scaling import Froude

BEADS = gr.DilatantMuI(E=1e6, d=0.005)
DENSE, LOOSE = 0.6, 0.57


def layer(angle_deg, packing, height=0.05, scheme=gr.schemes.default):
    """A layer of ten cells on a rough slope."""
    scene = gr.scenes.incline(
        angle_deg=angle_deg, height=height, cell=0.005, columns=4, jitter=0.5, material=BEADS
    ).replace(scheme=scheme)
    fills = tuple(fill.replace(packing=packing) for fill in scene.fills)
    return scene.replace(fills=fills)


PLAIN, AVERAGED = gr.schemes.default, gr.schemes.cell_averaged


@pytest.mark.parametrize(
    ("angle_deg", "packing", "until", "scheme"),
    [(24.0, LOOSE, 3.0, PLAIN), (26.0, 0.6, 6.0, PLAIN), (26.0, 0.6, 6.0, AVERAGED)],
)
def test_a_steady_layer_has_packing_and_velocity_of_theory(angle_deg, packing, until, scheme):
    """I and phi_eq(I) are uniform: u = 2 I/(3 d) sqrt(phi g cos) (H^1.5 - (H - y)^1.5), with the
    height H to which the layer has dilated or compacted."""
    scene = layer(angle_deg, packing, scheme=scheme)
    state = gr.Simulation(scene, threads=1).run(until=until, monitor=False).state
    angle = math.radians(angle_deg)
    share = (math.tan(angle) - BEADS.mu_s) / (BEADS.mu_2 - BEADS.mu_s)
    inertial = BEADS.I0 * share / (1 - share)
    expected = BEADS.packing(inertial)
    width = scene.grid.shape[0] * scene.grid.cell
    height = state.mass.sum() / (BEADS.rho_s * expected * width)
    y = state.x[:, 1]
    inside = (y > 0.2 * height) & (y < 0.8 * height)
    assert state.packing[inside].mean() == pytest.approx(expected, abs=4e-4)
    assert state.packing[inside].std() < 1e-3  # the noise of single points has a tail
    fall = height**1.5 - (height - y[inside]) ** 1.5
    speed = 2 * inertial / (3 * BEADS.d) * math.sqrt(expected * 9.8 * math.cos(angle)) * fall
    assert state.v[inside, 0].sum() == pytest.approx(speed.sum(), rel=0.03)
    top = np.sort(y)[-8:].mean() + 0.25 * scene.grid.cell
    assert top == pytest.approx(height, rel=0.02)


def test_a_dense_layer_starts_at_a_steeper_slope_than_it_stops():
    """It rests below the angle of its peak friction, at which a critical one flows."""
    peak = math.degrees(math.atan(BEADS.peak_friction(DENSE)))
    critical = math.degrees(math.atan(BEADS.mu_s))
    assert critical + 2 < peak - 0.7
    speeds = [
        np.abs(gr.Simulation(layer(peak + more, packing), threads=1).run(until=1.0).state.v).max()
        for more, packing in ((-0.7, DENSE), (-0.7, BEADS.phi_c), (2.0, DENSE))
    ]
    assert speeds[0] < 2e-3 < 0.05 < min(speeds[1:])


@pytest.mark.parametrize("dim", [2, 3])
def test_a_dense_bed_rests_under_its_weight(dim):
    """Its pressure is that of its own density, and its packing does not change."""
    wide = (0.2,) * (dim - 1)
    scene = scene_with(
        grid=gr.Grid((0.0,) * dim, 0.025, (8,) * (dim - 1) + (12,), (True,) * (dim - 1) + (False,)),
        fills=(
            gr.Fill(gr.Box((0.0,) * dim, (*wide, 0.2)), 2**dim, packing=DENSE, lithostatic=True),
        ),
        material=BEADS,
        walls=(gr.Wall(dim - 1, 0.0, kind="no_slip"),),
    )
    state = gr.Simulation(scene, threads=1).run(until=0.1).state
    assert BEADS.phi_c / state.bulking == pytest.approx(DENSE, rel=1e-6)
    at_rest = BEADS.phi_c / state.bulking
    assert state.packing == pytest.approx(at_rest * np.exp(state.log_density), rel=1e-12)
    assert np.abs(state.v).max() < 1e-3
    low = state.x[:, -1] < 0.05
    load = DENSE * BEADS.rho_s * 9.8 * (0.2 - state.x[low, -1])
    assert -state.stress[low, 1 if dim == 2 else 2] == pytest.approx(load, rel=0.05)


def test_a_fill_at_rest_is_within_yield_of_its_own_packing():
    """Loose material bears less to the sides than critical material, dense material more."""
    sand = gr.DilatantMuI(E=1e6, dilatancy=8.0)
    for packing, yields in ((0.56, True), (0.64, False)):
        mu = sand.peak_friction(packing)
        least = (math.sqrt(3) - mu) / (math.sqrt(3) + 2 * mu)
        assert (least > 0.3 / 0.7) == yields
        fill = gr.Fill(gr.Box((0, 0), (0.2, 0.2)), 4, packing=packing, lithostatic=True)
        scene = scene_with(grid=gr.Grid((0.0, 0.0), 0.025, (8, 12)), fills=(fill,), material=sand)
        stress = gr.Simulation(scene, threads=1).state.stress
        assert stress[:, 0] / stress[:, 1] == pytest.approx(max(0.3 / 0.7, least), rel=1e-9)
        low = scene.replace(fills=(fill.replace(K0=least * 1.001),))
        assert gr.Simulation(low, threads=1).state.n == 256
        with pytest.raises(ValueError, match=rf"K0 = .* must be from {least:.6g} to .* {mu:.6g}"):
            scene.replace(fills=(fill.replace(K0=least * 0.999),))


def test_a_deep_fill_is_within_yield_at_its_pressure():
    """On a critical-state line the friction falls with the depth, and K0 rises with it: that of
    yield at the vertical stress. Nothing is beyond the yield surface."""
    sand = gr.DilatantMuI(E=1e6, csl_slope=0.3, csl_exponent=0.5)
    fill = gr.Fill(gr.Box((0, 0), (0.2, 0.2)), 4, packing=0.6, lithostatic=True)
    grid = gr.Grid((0.0, 0.0), 0.025, (8, 12), (True, False))
    scene = scene_with(grid=grid, fills=(fill,), material=sand, walls=(gr.Wall(1, 0.0),))
    state = gr.Simulation(scene, threads=1).state
    vertical = -state.stress[:, 1]
    mu = sand.peak_friction(0.6, vertical)
    assert mu.max() - mu.min() > 0.05
    yields = (math.sqrt(3) - mu) / (math.sqrt(3) + 2 * mu)
    ratio = state.stress[:, 0] / state.stress[:, 1]
    assert ratio == pytest.approx(np.maximum(0.3 / 0.7, yields), rel=1e-3)
    most = sand.peak_friction(0.6, state.pressure) * state.pressure
    assert (state.shear_stress <= most * (1 + 1e-9)).all()
    rest = gr.Simulation(scene, threads=1).run(until=0.1).state
    assert rest.bulking == pytest.approx(state.bulking, rel=1e-9) and np.abs(rest.v).max() < 1e-3
    for changes, message in (
        ({"K0": 0.5}, r"fills\[0\].K0 = 0.5 must be from .* yields at .* Pa on the critical"),
        (
            {"packing": 0.5},
            r"fills\[0\].packing = 0.5 must be larger, or csl_slope = 0.3 smaller",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            gr.Simulation(scene.replace(fills=(fill.replace(**changes),)), threads=1)


def test_a_critical_state_line_is_scaled_with_the_stresses():
    """The pressure of the atmosphere is not: the slope changes in its place, and the flow does
    not."""
    scene = collapse(0.62, material=BEADS.replace(csl_slope=0.3))
    model = Froude(1 / 4).scene(scene)
    for p in (1e2, 1e4):
        assert model.material.critical_packing(p / 4) == pytest.approx(
            scene.material.critical_packing(p), rel=1e-12
        )
    states = [stepped(each, 100).state for each in (scene, model)]
    assert states[1].pressure == pytest.approx(states[0].pressure / 4, rel=1e-6, abs=1e-3)
    assert states[1].bulking == pytest.approx(states[0].bulking, rel=1e-9)


def test_dissipation_of_the_core_is_that_of_mu_I():
    """The plastic power that health counts: sum V mu(I) p gdot, less than V tau gdot in dense
    material that dilates, by psi p gdot that is no loss."""
    sim = gr.Simulation(collapse(0.62), threads=1).run(until=0.2)
    while sim._engine.scalars()["tally_time"] < sim.time:  # one is due every few steps
        sim.run(until=np.nextafter(sim.time, 1.0), monitor=False)
        sim.health()
    state, scalars = sim.state, sim._engine.scalars()
    power = plastic_power(state)
    assert scalars["tally_power"] == pytest.approx(power, rel=1e-6)
    flow = state.quadrature_volume * state.shear_rate
    inertial = np.nan_to_num(inertial_number(state))
    psi = BEADS.dilatancy * (BEADS.phi_c / state.bulking - BEADS.packing(inertial))
    dilation = (flow * psi * state.pressure).sum()
    assert 0.02 * power < abs(dilation)
    assert (flow * state.shear_stress).sum() - dilation == pytest.approx(power, rel=0.02)


def collapse(packing, **changes):
    scene = gr.scenes.column_collapse(aspect=1.0, cell=0.025, points_per_cell=4, material=BEADS)
    fills = tuple(fill.replace(packing=packing) for fill in scene.fills)
    return scene.replace(fills=fills, **changes)


@pytest.mark.parametrize("scheme", [PLAIN, AVERAGED], ids=["smoothed", "averaged"])
def test_a_column_keeps_its_mass_and_fills_the_volume_of_its_packing(scheme):
    for packing in (0.56, 0.62):
        scene = collapse(packing, scheme=scheme)
        start = gr.Simulation(scene, threads=1).state
        sim = gr.Simulation(scene, threads=1).run(until=0.8)
        state = sim.state
        assert state.mass.sum() == start.mass.sum()
        assert abs(gr.measure.density_drift(state)) < 0.02
        assert sim.health()["density_drift"].verdict == "ok", sim.health()
        flowed = np.abs(state.packing - packing) > 1e-3
        assert flowed.mean() > 0.3
        held = state.packing[state.dense]
        assert held.min() > BEADS.phi_fast - 0.01 and held.max() < 0.622
        assert np.median(state.packing[flowed]) == pytest.approx(BEADS.phi_c, abs=0.02)


TWO = scene_with(
    grid=gr.Grid((0.0, 0.0), 0.025, (16, 12)),
    fills=(
        gr.Fill(gr.Box((0.0, 0.0), (0.1, 0.2)), 4, jitter=0.4, packing=DENSE),
        gr.Fill(gr.Box((0.1, 0.0), (0.2, 0.2)), 4, material=gr.MuI(E=1e6), jitter=0.4),
    ),
    material=BEADS,
    walls=(gr.Wall(1, 0.0, kind="no_slip"),),
)
SCENES = {
    "plane": collapse(0.62),
    "critical-state line": collapse(0.62, material=BEADS.replace(csl_slope=0.3)),
    "point densities": collapse(
        0.62, scheme=gr.Scheme(basis="linear", transfer="apic", density=gr.ParticleDensity())
    ),
    "averaged cells": collapse(0.62, scheme=gr.schemes.cell_averaged),
    "averaged rings": gr.scenes.cylinder_collapse(
        cell=0.05, axisymmetric=True, material=BEADS, scheme=gr.schemes.cell_averaged
    ),
    "rings": gr.scenes.cylinder_collapse(cell=0.05, axisymmetric=True, material=BEADS),
    "space": gr.scenes.cylinder_collapse(cell=0.1, material=BEADS),
    "two materials": TWO,
}


@pytest.mark.parametrize("name", SCENES)
def test_the_same_bits_with_threads_ranks_restarts_and_vectors(name, tmp_path):
    scene = SCENES[name]
    one = same_bits(scene, 60, 60, path=tmp_path / "run.h5")
    assert np.any(one.state.bulking != gr.Simulation(scene, threads=1).state.bulking)
    with gr.ranks.threads(3) as comm:
        sim = gr.Simulation(scene, comm=comm, threads=1)
        sim.step(120)
        assert bits(sim) == bits(one)
    for isa in ("one_lane", "avx2"):
        try:
            other = gr.Simulation(scene, threads=1, isa=isa)
        except ValueError:
            continue
        other.step(120)
        if one.isa != "baseline":
            assert bits(other) == bits(one)


def test_a_material_beside_it_is_not_changed():
    """Points of a law that does not dilate keep a bulking of 1."""
    state = stepped(TWO, 200).state
    assert (state.bulking[state.material == 1] == 1.0).all()
    assert (state.bulking[state.material == 0] != 1.0).mean() > 0.5


def test_refusals():
    with pytest.raises(ValueError, match=r"must be None for DilatantMuI: .* Take a plate: a Body"):
        collapse(0.6, walls=(gr.Wall(1, 0.0), gr.Wall(1, 0.3, pressure=100.0)))
    with pytest.raises(ValueError, match=r"fills\[0\].packing = 0.4 must exceed 0.4895"):
        collapse(0.4)
    with pytest.raises(ValueError, match=r"packing = 0.6 must be None for MuI, which does not"):
        collapse(0.6).replace(material=gr.MuI(E=1e6))
    with pytest.raises(ValueError, match='"single" must be "double" for the law'):
        collapse(0.6, scheme=gr.Scheme(precision="single"))
