"""Diagnostics of a run: when they sample, how samples are combined, and where they are stored."""

import warnings

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
import granular.model.grid
from granular import Gravity
from granular.cli import main
from granular.measure.bulk import Bulk
from granular.run import diagnostics, monitor
from granular.run.diagnostics import health
from granular.run.monitor import LEAST, SPACING, Account, Energies, Monitor, later

DEFAULT = ("quadratic", "tpic", "smoothed")


@pytest.fixture
def scene(small_scene):
    return small_scene("periodic", 2, DEFAULT)


def identical(first, second):
    """True if two verdicts are the same to the last digit."""
    return first.samples == second.samples and [repr(i) for i in first] == [repr(i) for i in second]


# ---- how samples are combined ----


def test_the_later_half_is_neither_affected_by_an_impact_nor_by_the_beginning():
    assert later(np.array([1.0, np.nan, 1.0, 0.05, 0.06, 0.05])) == 0.05
    assert later(np.array([0.0, 0.0, 0.2, 0.2])) == 0.2
    assert np.isnan(later(np.array([np.nan])))


@pytest.mark.parametrize(
    ("name", "ok", "suspect"),
    [
        ("disconnected", 0.05, 0.2),
        ("density_drift", 0.04, 0.1),
        ("gaps", 0.0, 0.01),
        ("courant", 0.63, 0.65),
        ("mach", 0.4, 0.6),
        ("compression", 0.29, 0.31),
        ("dilution", 13.0, 14.0),
        ("strain_step", 0.1, 0.3),
        ("energy_created", 0.04, 0.06),
    ],
)
def test_verdicts(scene, name, ok, suspect):
    good, bad = (health(scene, {name: value}) for value in (ok, suspect))
    assert good[name].verdict == "ok"
    assert good.ok
    assert bad[name].verdict == "suspect"
    assert not bad.ok


def test_energy_from_nowhere_is_a_rise_of_the_account():
    """The created energy is relative to the energy turnover: 10 J at the start and 30 J of work."""

    def value(held):
        account = Account()
        account.enter(Energies(10.0, 0.0, 0.0), 0.0)
        for energy, work in zip(held, (10.0, 0.0, 10.0), strict=True):
            account.enter(Energies(energy - 3.0, 3.0, work), 1.0)
        return account.created

    assert value([20.0, 5.0, 10.0]) == 0
    assert value([21.0, 6.0, 18.0]) == pytest.approx(2 / 40)
    assert value([21.0, 14.0, 15.0]) == pytest.approx(4 / 40)


def test_what_has_no_value_has_no_verdict(scene):
    empty = health(scene, {})
    assert {indicator.verdict for indicator in empty} == {"unknown"}
    assert empty.ok
    seen = health(scene, {"ill_posed": 0.7})
    assert seen["ill_posed"].verdict == "reported"
    with pytest.raises(KeyError):
        empty["luck"]
    seen = health(scene, {"disconnected": 0.5, "samples": 1.0})
    assert "disconnected  0.5 (limit 0.1): suspect" in str(seen)
    assert "<table>" in seen._repr_html_()
    assert "1 samples" in seen._repr_html_()


# ---- when it samples ----


def test_samples_are_equal_steps_apart_in_runs_of_any_length(scene):
    """From LEAST to twice as many are kept, at multiples of a distance that is doubled."""
    monitor, sums, step = Monitor(scene), gr.Simulation(scene, threads=1)._sums(False), 0
    kept = []
    while step < 1000 * SPACING:
        assert monitor.due(step)
        monitor.enter(step, 0.0, 0.0, None)
        if step:
            monitor.add(monitor.row(sums, {"strain_step": float(step)}))
        assert not monitor.due(step)
        step = monitor.next(step)
        steps = [row[monitor.names.index("strain_step")] for row in monitor.rows]
        assert len(set(np.diff([0.0, *steps]))) <= 1
        kept.append(len(steps))
    assert min(kept[LEAST:]) == LEAST and max(kept) < 2 * LEAST
    assert monitor.count < 8 * LEAST
    again = Monitor(scene)
    again.restore(monitor.arrays(), step)
    assert again.arrays().keys() == monitor.arrays().keys()
    assert all(np.array_equal(a, monitor.arrays()[k], True) for k, a in again.arrays().items())
    for name, bad in (("sampling", again.arrays()["sampling"][1:]), ("samples", np.zeros((2, 3)))):
        with pytest.raises(ValueError, match="does not hold the samples of its scene"):
            Monitor(scene).restore(monitor.arrays() | {name: bad}, step)
    bad = again.arrays()["sampling"]
    for at, value in ((0, 65.0), (0, np.nan), (1, 1.0), (2, step + 1.0)):
        changed = bad.copy()
        changed[at] = value
        with pytest.raises(ValueError, match=f"must have a distance of {SPACING} steps"):
            Monitor(scene).restore(monitor.arrays() | {"sampling": changed}, step)


def test_a_run_samples_unless_told_not_to(scene):
    watched, blind = gr.Simulation(scene, threads=1), gr.Simulation(scene, threads=1)
    watched.run(until=0.1, every=0.02)
    blind.run(until=0.1, every=0.02, monitor=False)
    assert watched.health().samples == watched.steps // SPACING > 2
    assert blind.health().samples == 1  # the present state
    assert watched.state.x.tobytes() == blind.state.x.tobytes()
    assert gr.Simulation(scene, threads=1).health().samples == 0


def test_the_verdict_is_that_of_the_scene(scene, tmp_path, capsys):
    """It depends neither on frames, nor on calls, a restart or the duration; the record has it."""
    one = gr.Simulation(scene, threads=1).run(until=0.4, every=0.052, save=tmp_path / "one.h5")
    many = gr.Simulation(scene.replace(duration=0.4), threads=2)
    for until in (0.004, 0.16, 0.1604, 0.4):
        many.run(until=until, every=0.016)
    gr.Simulation(scene, threads=1).run(until=0.21, save=tmp_path / "cut.h5")
    resumed = gr.Simulation.resume(tmp_path / "cut.h5", threads=1)
    assert resumed.health().samples > 0
    resumed.run(until=0.4)
    expected = one.health()
    assert expected.samples > 10 and not np.isnan(expected["energy_created"].value)
    for name in ("one.h5", "cut.h5"):
        with gr.open(tmp_path / name) as record:
            assert identical(record.health(), expected), name
    assert identical(many.health(), expected) and identical(resumed.health(), expected)
    assert main(["info", str(tmp_path / "one.h5")]) == 0
    assert str(expected) in capsys.readouterr().out


@pytest.mark.parametrize("free", ["", "y"])
def test_work_of_bodies_is_in_the_account(scene, free):
    """A disc pressed into the layer does ten times the work of gravity: no energy is created."""
    disc = gr.shapes.Cylinder(0.1, center=(0.0, 0.0))
    motion = gr.Motion(velocity=((0.0, -1.0),))
    x, y = scene.grid.lower[0] + 0.2, scene.grid.lower[1] + 0.45
    body = gr.bodies.Body(disc, (x, y), motion=motion, free=free, mass=1e3 if free else None)
    sim = gr.Simulation(scene.replace(bodies=(body,)))
    sim.run(until=0.13, every=0.02)
    seen = sim.health()
    assert sim.bodies[0].work > 0
    assert seen["energy_created"].verdict == "ok", str(seen)
    assert seen["courant"].verdict == "ok"
    energies, first = sim._energies(), sim._monitor._account.numbers[2]
    energies = energies or Energies(
        *(
            sim._engine.scalars()[f"tally_{name}"]
            for name in ("energy", "plastic_work", "gravity_work")
        )
    )
    without = energies.held + energies.lost - sim._engine.scalars()["tally_gravity_work"] - first
    assert without > 0.05 * sim._monitor._account.numbers[0]  # it would be suspect without this


@pytest.mark.parametrize(("frequency", "known"), [(1.0, True), (100.0, False)])
def test_work_of_gravity_that_swings_within_a_tally_is_unknown(scene, frequency, known):
    """Tallies of the core every 0.03 s know nothing of the 0.01 s in which a bed is shaken."""
    times = np.linspace(0.0, 0.4, 401)
    pull = -9.8 * (1 + 3 * np.sin(2 * np.pi * frequency * times))
    gravity = gr.Gravity(tuple(times), tuple((0.0, g) for g in pull))
    sim = gr.Simulation(scene.replace(gravity=gravity), threads=1)
    sim.run(until=0.4, every=0.02)
    assert sim.health()["energy_created"].verdict == ("ok" if known else "unknown")


def test_a_suspect_run_ends_with_a_warning(scene, monkeypatch):
    """It says what to do, and once for each indicator."""
    monkeypatch.setattr(monitor, "FEWEST", 1)
    monkeypatch.setattr(Bulk, "disconnected", lambda self, pressed: 0.5)
    sim = gr.Simulation(scene, threads=1)
    with pytest.warns(gr.StabilityWarning, match=r"disconnected = 0.5 .* is suspect: .*; take "):
        sim.run(until=0.3, every=0.02)
    unwatched = gr.Simulation(scene, threads=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sim.run(until=0.35, every=0.02)
        unwatched.run(until=0.3, every=0.02, monitor=False)
    assert sim.health().verdict.startswith("verdict: suspect, disconnected = 0.5 (limit 0.1), ")


def test_grains_that_cannot_bear_yet_are_not_suspect(scene, monkeypatch):
    """All points are stress-free at the start, until gravity acts and waves have crossed them. Of
    the few of a small bulk a share says nothing."""
    sim = gr.Simulation(scene, threads=1)
    sim.step(10)
    assert sim.health()["disconnected"].verdict == "unknown"
    sim.run(until=0.3, monitor=False)
    assert sim.health()["disconnected"].verdict == "unknown"
    monkeypatch.setattr(monitor, "FEWEST", 10)
    assert sim.health()["disconnected"].verdict == "ok"


def test_every_indicator_with_a_limit_has_a_remedy(scene):
    sph = gr.scenes.incline_sph(height=0.05)
    for indicator in (*health(scene, {}), *health(sph, {})):
        assert bool(indicator.remedy) == (indicator.limit is not None)
    assert health(scene, {}).verdict.startswith("verdict: unknown, as no step has been made or ")


def test_a_step_alone_needs_no_run(scene):
    sim = gr.Simulation(scene, threads=1)
    sim.step(20)
    courant = sim.health()["courant"]
    speed = np.linalg.norm(sim.state.v, axis=1).max()
    expected = (scene.material.wave_speed + speed) * sim.dt / scene.grid.cell
    assert courant.value == pytest.approx(expected)
    assert courant.verdict == "ok"


def test_work_and_losses_of_a_fall(small_scene):
    """In free fall the work of gravity equals the kinetic energy; then all leaves the domain."""
    scene = small_scene("outlet", 2, DEFAULT)
    fall = scene.replace(
        walls=(),
        fills=(gr.Fill(FALLING, 4, density=1200.0),),
        gravity=Gravity((0.0,), ((0.0, -9.8),)),
    )
    sim = gr.Simulation(fall, threads=1)
    sim.step(4 * SPACING)
    held, lost, work = sim._energies()
    kinetic = gr.measure.energy(sim.state).kinetic
    # The positions of the integrator are half a step ahead of its velocities.
    assert work == pytest.approx(kinetic, rel=2 * sim.dt / sim.time)
    assert held == pytest.approx(kinetic, rel=1e-12)
    assert lost == 0.0
    sim.run(until=1.0, every=0.1)
    while sim.n_points:
        sim.run(until=sim.time + 0.1)
    sim.step(SPACING - sim.steps % SPACING)
    held, lost, work = sim._energies()
    assert held == 0 and lost == pytest.approx(work, rel=0.01)
    assert sim.health()["energy_created"].verdict == "ok"
    assert np.isnan(sim.health()["disconnected"].value)  # disconnected material has no bulk


FALLING = gr.Box((0.15, 0.4), (0.45, 0.55))


# ---- in the record ----


def test_values_are_recorded_for_each_frame(scene, tmp_path):
    path, found = tmp_path / "a.h5", []

    def look(sim):
        with gr.open(path) as record:
            assert not record.finished
            found.append((record.health(), sim.health()))

    gr.Simulation(scene, threads=1).run(until=0.06, every=0.02, save=path, hooks=(look,))
    assert len(found) == 4 and all(identical(*pair) for pair in found)
    with gr.open(path) as record:
        told = record.samples
        assert {"samples", "courant", "mach"} <= set(told)
        assert set(told) <= {"samples", *(name for name, *_ in scene.indicators)}
        assert np.isnan(told["courant"][0]) and (np.diff(told["samples"]) >= 0).all()
        assert identical(record[:3].health(), found[2][0])
        assert record.damage() == []
        assert record[:1].health().verdict.startswith("verdict: unknown, ")


def test_a_record_without_a_monitor_is_judged_by_its_last_frame(scene, tmp_path):
    unwatched = gr.Simulation(scene, threads=1)
    unwatched.run(until=0.04, every=0.02, save=tmp_path / "b.h5", monitor=False)
    with gr.open(tmp_path / "b.h5") as record:
        assert record.samples == {}
        judged, expected = record.health(), unwatched.health()
        assert judged["density_drift"] == expected["density_drift"]
        assert judged["courant"] == expected["courant"]
        assert judged.samples == 1 and judged.verdict.startswith("verdict: ok, density_drift = ")
        assert judged.rows()["in_solids"] == "- (limit 0): does not apply, or not known yet"


# ---- blocks ----


CELL = 0.02


def rocks(seed, *, buried=False):
    """Frictionless rock of rows one cell thick each, of random reach, and material thrown at it."""
    rng = np.random.default_rng(seed)
    reaches = [int(rng.integers(1, 9)) for _ in range(3, 12)]
    blocks = [
        gr.Solid((0.0, j * CELL), (reach * CELL, (j + 1) * CELL), kind="free_slip")
        for j, reach in enumerate(reaches, start=3)
    ]
    bottom = 4 if buried else 12
    fill = granular.Box((0.0, bottom * CELL), (16 * CELL, 20 * CELL))
    sides = [gr.Wall(0, at, kind="free_slip") for at in (0.0, 16 * CELL)]
    return scene_with(
        grid=gr.Grid((0.0, 0.0), CELL, (16, 24)),
        fills=(gr.Fill(fill, 4, velocity=(0.0, -1.0)),),
        walls=(*sides, gr.Wall(1, 0.0), *blocks),
        duration=0.4,
    )


def deepest(state, blocks):
    """Largest depth of a point in the union of blocks [cells], in the maximum norm."""
    grid = state.scene.grid
    corners = np.stack(np.indices(grid.shape), axis=-1).reshape(-1, 2)
    middles = (corners + 0.5) * grid.cell
    rock = np.any([np.all((middles > b.lower) & (middles < b.upper), axis=1) for b in blocks], 0)
    empty = corners[~rock]
    x = state.x / grid.cell
    away = np.maximum(empty - x[:, None], x[:, None] - empty - 1).max(axis=2)
    return max(away.min(axis=1).max(), 0.0)


@pytest.mark.parametrize("seed", [0, 6, 39])
def test_material_does_not_enter_a_staircase_of_frictionless_rows(seed):
    """With faces of each block instead of their union, points went 1.3 to 2.8 cells deep."""
    scene = rocks(seed)
    sim = gr.Simulation(scene, threads=1)
    for time in (0.1, 0.2, 0.4):
        sim.run(time)
        assert deepest(sim.state, scene.walls[3:]) < 1
    assert sim.health()["in_solids"].verdict == "ok"
    assert sim.health()["in_solids"].value == 0


def test_points_within_a_block_are_told_before_and_during_a_run():
    scene = rocks(0, buried=True)
    with pytest.warns(diagnostics.StabilityWarning, match=r"fills\[0\] has points within walls"):
        sim = gr.Simulation(scene, threads=1)
    sim.step(1)
    said = sim.health()["in_solids"]
    assert said.verdict == "suspect"
    assert 0 < said.value < 0.2
    assert not sim.health().ok


@pytest.mark.parametrize("spoil", [np.nan, 1e6])
def test_the_health_of_a_run_that_failed(scene, spoil):
    """The indicators are those of the samples before the error; the verdict is the error."""
    sim = gr.Simulation(scene, threads=1).run(0.05, every=0.01)
    before = sim.health()
    assert before.ok
    sim.buffers["v"][0, np.flatnonzero(sim.buffers["id"] >= 0)[3]] = spoil
    with pytest.raises(gr.SimulationError) as error:
        sim.run(1.0)
    failed = sim.health()
    assert not failed.ok and failed.failure == str(error.value)
    assert failed.verdict.startswith(f"verdict: failed, {error.value}; before: density_drift = ")
    assert failed["courant"] == before["courant"] and str(failed).startswith("failed: ")
