"""Conservation of mass and momentum, and the energy budget of the grid, line by line."""

import dataclasses
import math

import numpy as np
import pytest
from scenes_by_hand import scene_with
from schemes_by_name import scheme_of

import granular as gr
from granular import Box, Elastic, Fill, Grid, MuI
from granular.verify.invariants import momentum


def closed_box(combination, *, material=None, gravity=(0.0, 0.0), **options):
    """Two streams that meet, without walls, periodic along both axes."""
    basis, transfer, density = combination
    count = 4 if basis == "ugimp" else 9  # whose points are boxes of one size
    return scene_with(
        grid=Grid((0.0, 0.0), 0.1, (5, 4), periodic=(True, True)),
        fills=(
            Fill(
                Box((0.0, 0.0), (0.2, 0.4)), count, jitter=1.0, density=1510.0, velocity=(0.7, -0.3)
            ),
            Fill(Box((0.2, 0.0), (0.5, 0.4)), 4, jitter=1.0, density=1505.0, velocity=(-0.2, 0.4)),
        ),
        material=material or MuI(E=1e6),
        scheme=scheme_of(basis, transfer, density, **options),
        gravity=gravity,
        seed=1,
    )


@pytest.mark.parametrize("dt", [None, 5e-4])
def test_momentum_of_a_closed_system(combination, dt):
    """After 10 000 steps, and in the next, before which points may carry a shift momentum."""
    sim = gr.Simulation(closed_box(combination, dt=dt), threads=1)
    before = momentum(sim.state)
    scale = np.sum(sim.state.mass * np.linalg.norm(sim.state.v, axis=1))
    bears = []
    for _ in range(10):
        sim.step(10)
        bears.append(sim.state.stress.any())
    assert any(bears)  # the streams have met
    for steps in (9_900, 1):
        sim.step(steps)
        assert sim.n_points == len(sim.state.mass)
        assert abs(momentum(sim.state) - before).max() <= 1e-12 * scale


def test_momentum_under_gravity(combination):
    g = np.array([1.0, -9.8])
    sim = gr.Simulation(closed_box(combination, gravity=tuple(g)), threads=1)
    mass, before = math.fsum(sim.state.mass), momentum(sim.state)
    for _ in range(5):
        sim.step(201)
        expected = before + mass * g * sim.time
        assert abs(momentum(sim.state) - expected).max() <= 1e-12 * (
            mass * 9.8 * sim.time + abs(before).max()
        )


def test_mass_is_exact(small_scene, combination, dim):
    scene = small_scene("outlet", dim, combination, E=1e5)
    sim = gr.Simulation(scene, threads=1)
    start = sim.state
    sim.step(150)
    end, scalars = sim.state, sim._engine.scalars()
    assert len(start.id) == len(end.id) + scalars["dropped"]
    assert len(set(end.id)) == len(end.id)
    np.testing.assert_array_equal(end.mass, start.mass[np.searchsorted(start.id, end.id)])
    gone = np.setdiff1d(start.id, end.id)
    assert len(gone) > 0
    lost = math.fsum(start.mass[np.searchsorted(start.id, gone)])
    assert scalars["dropped_mass"] == pytest.approx(lost, rel=1e-14)


def test_energy_of_the_grid(small_scene, combination, dim):
    check_energy_of_the_grid(small_scene("walls", dim, combination, E=1e5))


@pytest.mark.parametrize("kind", ["periodic", "outlet"])
def test_energy_of_the_grid_of_other_domains(small_scene, typical_combination, dim, kind):
    check_energy_of_the_grid(small_scene(kind, dim, typical_combination, E=1e5))


def check_energy_of_the_grid(scene):
    """The work of forces and walls is the change of the grid's kinetic energy, to round-off."""
    sim = gr.Simulation(scene, threads=1)
    sim.step(40)
    works = np.zeros(3)
    for _ in range(8):
        budget = gr.measure.step_budget(sim)
        works += abs(np.array([budget.internal_work, budget.external_work, budget.wall_work]))
        assert abs(budget.grid_residual) <= 1e-13 * budget.grid_kinetic_after
    assert (works[:2] > 0).all()
    assert works[2] > 0 or scene.name == "outlet"


def test_the_budget_closes_and_is_the_step(small_scene, combination):
    """Kinetic energies agree from line to line, and the step has the bits of a plain one."""
    scene = small_scene("outlet", 2, combination, E=1e5)
    sim, plain = gr.Simulation(scene, threads=1), gr.Simulation(scene, threads=1)
    sim.step(30)
    plain.step(30)
    for _ in range(10):
        b = gr.measure.step_budget(sim)
        plain.step()
        kinetic = b.kinetic_before - b.p2g_loss + b.internal_work + b.external_work + b.wall_work
        kinetic += b.grid_residual - b.g2p_loss - b.kinetic_outflow
        assert kinetic == pytest.approx(b.kinetic_after, rel=1e-12)
        elastic = b.elastic_before - b.internal_work - b.plastic_dissipation - b.elastic_outflow
        elastic -= b.disconnection_loss + b.strain_residual
        assert elastic == pytest.approx(b.elastic_after, rel=1e-11, abs=1e-12)
        assert b.kinetic_after == pytest.approx(gr.measure.energy(sim.state).kinetic, rel=1e-12)
        assert b.elastic_after == pytest.approx(gr.measure.energy(sim.state).elastic, rel=1e-12)
    one, other = sim.checkpoint(), plain.checkpoint()
    for name, number in one.scalars.items():  # the stages alone make no tallies
        assert number == other.scalars[name] or name.startswith("tally_"), name
    assert all(a.tobytes() == other.arrays[k].tobytes() for k, a in one.arrays.items())


def lost(transfer, cfl, time=0.08):
    """Fraction of the kinetic energy lost in transfers, and the losses of P2G alone."""
    scene = closed_box(("quadratic", transfer, "particle"), material=Elastic(E=1e6), cfl=cfl)
    sim, budgets = gr.Simulation(scene, threads=1), []
    while sim.time < time:
        budgets.append(gr.measure.step_budget(sim))
    p2g = np.array([b.p2g_loss for b in budgets])
    return (p2g.sum() + sum(b.g2p_loss for b in budgets)) / budgets[0].kinetic_before, p2g


def test_transfers_lose_energy_of_their_own_kind():
    """P2G of velocities alone cannot gain energy; the loss of FLIP vanishes with the step."""
    coarse, p2g = lost("flip", 0.5)
    fine, _ = lost("flip", 0.05)
    assert (p2g >= 0).all()
    assert 0 < fine < coarse / 2
    picked, p2g = lost("apic", 0.5)
    assert picked > coarse
    assert p2g[0] > 0


def test_energy_of_a_disconnection_is_reported_once():
    """Disconnected points under stress lose its energy in one step, shown in one line only."""
    scene = closed_box(("linear", "flip", "particle"))
    sim = gr.Simulation(scene, threads=1)
    at = np.flatnonzero(sim.buffers["id"] >= 0)
    sim.buffers["v"][:] = 0.0
    sim.buffers["stress"][:3, at] = -100.0
    sim.buffers["log_density"][0, at] = -1e-2
    material, state = scene.material, sim.state
    expected = float(np.sum(state.volume) * 100.0**2 / (2 * material.K))
    first, second = gr.measure.step_budget(sim), gr.measure.step_budget(sim)
    assert first.disconnection_loss == pytest.approx(expected, rel=1e-12)
    assert first.elastic_after == 0.0
    assert second.disconnection_loss == 0.0
    assert first.plastic_dissipation == 0.0
    assert first.strain_residual == pytest.approx(-first.internal_work, rel=1e-9, abs=1e-15)


def test_strain_residual_falls_with_the_step():
    """An error of the time integration: of first order when summed over a given time."""
    totals = []
    for steps in (20, 40, 80):
        dt = 0.02 / steps
        scene = closed_box(
            ("quadratic", "apic", "particle"), material=Elastic(E=1e4, rho_c=1500.0), dt=dt
        )
        sim = gr.Simulation(scene, threads=1)
        budgets = [gr.measure.step_budget(sim) for _ in range(steps)]
        totals.append(abs(sum(b.strain_residual for b in budgets)))
        assert budgets[-1].elastic_after > 0
    assert totals[1] < 0.65 * totals[0]
    assert totals[2] < 0.65 * totals[1]


def test_every_line_of_the_budget_is_a_finite_number(small_scene):
    sim = gr.Simulation(small_scene("walls", 3, ("quadratic", "tpic", "smoothed")), threads=1)
    assert all(math.isfinite(v) for v in dataclasses.astuple(gr.measure.step_budget(sim)))


def test_the_budget_of_a_step_refuses_inflows():
    sim = gr.Simulation(gr.scenes.silo_fed(), threads=1)
    with pytest.raises(ValueError, match="scene 'silo_fed' must have no inflows"):
        gr.measure.step_budget(sim)
    assert sim.steps == 0


@pytest.mark.parametrize("wide", [(1, 1), (2, 1)])
def test_a_narrow_column_falls_as_a_whole(wide):
    """With 9 active cells in a layer, a vector of 8 begins and ends in rows of two layers."""
    cell, high, speed, g = 0.02, 6, -0.5, 9.81
    lower = (2 * cell, 2 * cell, 0.5)
    upper = (*(low + n * cell for low, n in zip(lower, wide, strict=False)), 0.5 + high * cell)
    scene = scene_with(
        grid=Grid((0.0, 0.0, 0.0), cell, (10, 10, 40)),
        fills=(Fill(Box(lower, upper), 8, jitter=0.2, velocity=(0.0, 0.0, speed)),),
        gravity=g,
    )
    sim = gr.Simulation(scene, threads=1)
    sim.step(40)
    expected = np.array([0.0, 0.0, speed - g * sim.time])
    assert abs(sim.state.v - expected).max() < 1e-12
    assert abs(sim.state.stress).max() < 1e-6  # round-off of the density
