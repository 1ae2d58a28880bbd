"""Slopes, retaining walls and footings beside limit equilibrium, Rankine and Prandtl."""

import math

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr

factor_of_safety, reduced = gr.stability.factor_of_safety, gr.stability.reduced


def force(scene, path, every, window):
    gr.Simulation(scene, threads=1).run(save=path, every=every)
    return gr.measure.body_force(gr.open(path), window=window).force


def test_factor_of_safety_of_a_slope():
    """1.38 by Bishop & Morgenstern's charts, 1.4 by the finite elements of Griffiths & Lane."""
    found = factor_of_safety(gr.scenes.slope(cell=0.5), tolerance=0.05, start=1.2)
    assert 1.30 < found.lower < found.upper < 1.47
    assert found.upper / found.lower <= 1.05
    assert found.lower < found.value < found.upper
    assert np.all(np.diff(found.factors) > 0)
    assert np.array_equal(found.failed, found.factors >= found.upper)
    assert np.all(found.displacements[~found.failed] < 0.05)


def test_factor_of_safety_of_an_endless_slope():
    """mu_s/tan(slope) of a layer without cohesion: exact."""
    angle = math.radians(15.0)
    grid = gr.Grid((0.0, 0.0), 0.1, (4, 14), periodic=(True, False))
    layer = gr.Fill(gr.Box((0.0, 0.0), (0.4, 1.0)), 4)
    full = (9.8 * math.sin(angle), -9.8 * math.cos(angle))
    scene = scene_with(
        grid=grid,
        fills=(layer,),
        walls=(gr.Wall(1, 0.0),),
        gravity=gr.Gravity((0.0, 0.5), ((0.0, 0.0), full)),
        material=gr.MuI(E=1e7, mu_s=0.4, mu_2=0.6),
        duration=2.0,
    )
    found = factor_of_safety(scene, tolerance=0.03, start=1.5)
    exact = 0.4 / math.tan(angle)
    assert found.lower / 1.02 < exact < found.upper * 1.02


def test_reduced_materials_and_bad_arguments():
    soil = gr.DruckerPrager(E=1e6, mu=0.4, cohesion=100.0)
    weak = reduced(soil, 2.0)
    assert (weak.mu, weak.cohesion, weak.E) == (0.2, 50.0, 1e6)
    assert weak.tensile_strength == pytest.approx(soil.tensile_strength / 2)
    with pytest.raises(ValueError, match="must have a friction coefficient to reduce"):
        reduced(gr.Elastic(E=1e6), 2.0)
    with pytest.raises(ValueError, match=r"factor = 0\.0"):
        reduced(soil, 0.0)
    scene = gr.scenes.slope(cell=0.5, duration=1.5)
    for options, message in (
        ({"tolerance": 0.0}, "tolerance = 0.0"),
        ({"start": -1.0}, "start = -1.0"),
        ({"moved": 0.0}, "moved = 0.0"),
        ({"after": 1.5}, "after = 1.5 must be less than the duration of 1.5 s"),
    ):
        with pytest.raises(ValueError, match=message):
            factor_of_safety(scene, **options)
    with pytest.raises(TypeError, match="scene"):
        factor_of_safety(gr.scenes.slump_sph())


@pytest.mark.parametrize(("speed", "travel"), [(0.04, 0.03), (-0.04, 0.015)])
def test_walls_have_rankines_pressures(speed, travel, tmp_path):
    """With smooth walls and base all of the ground yields: 3 and 1/3 at 30 degrees."""
    scene = gr.scenes.retaining_wall(speed=speed, travel=travel, cell=0.125)
    found = force(scene, tmp_path / "a.h5", 0.02, 5)[-3:, 0].mean()
    known = gr.theory.earth_pressure(scene.material.mu)
    wanted = known.passive_coaxial if speed > 0 else known.active_coaxial
    assert abs(found) / (0.5 * 1600.0 * 9.8) == pytest.approx(wanted, rel=0.03)


@pytest.mark.parametrize(
    ("mu", "numbers", "near"),
    [
        (0.02, {"cohesion": 2e4, "tensile_strength": 2e4, "E": 1e8}, 0.06),
        (math.sin(math.radians(20.0)), {}, 0.12),
    ],
)
def test_footings_have_the_bearing_capacity_of_limit_analysis(mu, numbers, near, tmp_path):
    """N_c of soil with hardly any friction, 5.2, and N_gamma; 16 cells across are 4 and 9 % above.

    The force at the beginning is that of the line through the later ones, as the footing sinks in.
    """
    scene = gr.scenes.footing(mu=mu, length=2.5, soil=1.5, speed=0.01, settlement=0.02, **numbers)
    gr.Simulation(scene, threads=1).run(save=tmp_path / "a.h5", every=0.02)
    record = gr.open(tmp_path / "a.h5")
    found, motion = gr.measure.body_force(record, window=5), gr.measure.body_motion(record)
    sunk = np.interp(found.times, motion.times, -motion.position[:, 1])
    later = sunk > 0.008
    pressure = np.polyfit(sunk[later], found.force[later, 1], 1)[1]
    if "cohesion" in numbers:
        N_q = math.exp(math.pi * mu) * math.tan(math.pi / 4 + math.atan(mu) / 2) ** 2
        known = numbers["cohesion"] * (N_q - 1) / mu
    else:
        known = gr.theory.bearing_capacity(20.0).pressure(1.0, rho=1600.0)
    assert pressure == pytest.approx(known, rel=near)


def test_displacement_is_that_of_the_points(tmp_path):
    """By their ids, across periodic ends, and nan for points that have entered."""
    grid = gr.Grid((0.0, 0.0), 0.1, (6, 6), periodic=(True, False))
    fill = gr.Fill(gr.Box((0.0, 0.2), (0.6, 0.4)), 4, velocity=(1.0, 0.0))
    sim = gr.Simulation(scene_with(grid=grid, fills=(fill,), gravity=0.0))
    start = sim.state
    sim.run(until=0.1)
    moved = gr.measure.displacement(sim.state, start)
    np.testing.assert_allclose(moved, [[sim.time, 0.0]] * start.n, atol=1e-9)
    part = start.within(gr.Box((0.0, 0.0), (0.3, 1.0)))
    assert np.isnan(gr.measure.displacement(sim.state, part)).all(axis=1).sum() == start.n // 2
    other = gr.Simulation(gr.scenes.column_collapse(cell=0.05)).state
    with pytest.raises(ValueError, match="must be a state of the same run"):
        gr.measure.displacement(sim.state, other)
