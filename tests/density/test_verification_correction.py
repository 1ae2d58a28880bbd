"""The table of the density correction: errors that its measures detect."""

import numpy as np
import pytest

from granular import Simulation, measure, scenes, schemes, theory
from granular.verify import density_correction, density_correction_budget, layers, silo
from granular.verify.incline import mean_speed


def test_the_published_scheme_fails_the_quick_rows():
    rows = list(
        density_correction.density_correction_shear_quick(
            schemes.dunatunga_kamrin_2015.replace(dt=None)
        )
    )
    assert [row.passed for row in rows[:2]] == [False, False]


@pytest.mark.parametrize("across", [0, 2])
def test_a_steady_layer_starts_in_balance(across):
    """The stress balances gravity and satisfies the law; no error has developed yet."""
    points = 8 if across else 4
    sim = layers.layer(steady=True, columns=2, across=across, height=0.1, points=points)
    state = sim.state
    flow = layers.measured(sim, state, steady=True, readings=1)
    assert flow.error == pytest.approx(0.0, abs=1e-12)
    assert flow.disconnected == 0.0 and flow.height == 1.0 and flow.pressure < 0.05
    assert state.mu == pytest.approx(np.tan(np.radians(25.0)), rel=1e-12)
    sim.step(20)
    free_fall = sim.scene.gravity.at(0.0)[0] * sim.time
    assert abs(mean_speed(sim.state) - mean_speed(state)) < 0.1 * free_fall


def loudest(sim, crossings=4):
    """Largest kinetic energy of a layer over some crossings by sound, read eight times in each."""
    crossing = layers.HEIGHT / sim.scene.material.wave_speed
    times = sim.time + crossing * np.arange(1, 8 * crossings + 1) / 8
    return max(
        measure.energy(sim.run(until=float(time), monitor=False).state).kinetic for time in times
    )


def test_elastic_waves_of_a_layer_at_rest_die_out():
    """A layer of 0.1 m below its flow angle oscillates as a quarter wave and gains no energy.

    An earlier density correction, driven by the strain of the waves, made the energy grow threefold
    from 1 s to 3 s.
    """
    sim = layers.layer(15.0, height=0.1)
    early = loudest(sim.run(until=1.0, monitor=False))
    assert loudest(sim.run(until=3.0, monitor=False)) < 1.1 * early


def test_the_error_sees_the_profile_and_what_goes_across_it():
    sim = layers.layer(steady=True, columns=2, height=0.1)
    start, v = sim.state, sim.buffers["v"]
    v[0] *= 1.01
    assert layers.measured(sim, start, True, readings=1).error == pytest.approx(0.01, rel=1e-9)
    v[0] /= 1.01
    v[1] = 0.01 * v[0]
    assert layers.measured(sim, start, True, readings=1).error == pytest.approx(0.01, rel=1e-9)


def test_the_worst_seed_counts():
    good = layers.Flow(error=0.01, height=1.0, disconnected=0.0, pressure=0.01)
    bad = layers.Flow(error=0.03, height=0.98, disconnected=0.01, pressure=0.06)
    rows = list(layers.rows("both", [good, bad], 0.02, pressure=0.05))
    assert [row.passed for row in rows] == [False, False, False, False, None]
    assert all(row.passed for row in layers.rows("one", [good], 0.02, pressure=0.05))
    assert [row.passed for row in layers.rows("told", [good], 0.02)] == [True, True, True, None]


def test_filling_by_hand():
    """A seeded column is full everywhere; with points of twice the mass it is twice as full."""
    sim = Simulation(scenes.column_collapse(cell=0.025), threads=1)
    assert [density_correction.over_compression(sim.state, k) for k in (1, 3, 5)] == pytest.approx(
        [1.0] * 3, rel=1e-12
    )
    sim.buffers["mass"][..., sim.buffers["x"][1] < 0.2] *= 2.0
    assert density_correction.over_compression(sim.state) == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize(("name", "more"), [("dunatunga_kamrin_2015", 0.0), ("default", 0.01)])
def test_free_opening(name, more):
    """From the first to the last free node: the paper's D, or a cell more with splines."""
    scheme = getattr(schemes, name)
    assert silo.free_opening(0.1, 0.01, scheme) == pytest.approx(0.1 + more, abs=1e-12)


def test_stop_time():
    """A block at 20 degrees, pushed to 1 m/s."""
    g, angle = 9.8, np.radians(20.0)
    a = g * (density_correction.SOFT.mu_s * np.cos(angle) - np.sin(angle))
    assert density_correction.stop_time(20.0, 1.0) * a == pytest.approx(1.0)


def test_an_idle_correction_gives_nothing():
    """The comparison of two steps is exact, and it detects the particle shifting."""
    sim = layers.layer(
        steady=True,
        scheme=schemes.Scheme(density=schemes.SmoothedDensity(**density_correction_budget.IDLE)),
    )
    sim.step(200)
    nothing = density_correction_budget.given(sim)
    assert nothing.momentum == nothing.angular == 0.0
    assert nothing.plastic > 0.0 and abs(nothing.energy) < 1e-9 * nothing.plastic  # round-off
    sim = Simulation.from_checkpoint(
        sim.scene.replace(scheme=schemes.default), sim.checkpoint(), threads=1
    )
    something = density_correction_budget.given(sim)
    assert something.energy != 0.0 and something.angular != 0.0


def test_pde_is_the_reference_from_rest():
    sim = layers.layer(columns=1)
    sim.run(until=0.3, monitor=False)
    y = np.array([0.05, 0.15])
    exact = theory.transient(25.0, 0.2, sim.scene.material, [sim.time], 9.8)
    assert layers.reference(sim, False, y) == pytest.approx(np.interp(y, exact.y, exact.v[0]))
