"""Diagnostics of a run: when they sample, how samples are combined, and where they are stored."""

import warnings

import numpy as np
import pytest

import granular as gr
import granular.geometry
from granular import diagnostics
from granular.cli import main
from granular.diagnostics import NAMES, Monitor, health
from granular.gravity import Gravity
from granular.mpm.limits import INDICATORS

DEFAULT = ("quadratic", "tpic", "smoothed")


def samples(**columns):
    """Samples of a run, by name; values that are not given are absent."""
    length = max(map(len, columns.values()))
    return {name: np.array(columns.get(name, [np.nan] * length), dtype=float) for name in NAMES}


@pytest.fixture
def scene(small_scene):
    return small_scene("periodic", 2, DEFAULT)


@pytest.fixture
def often(monkeypatch):
    """Diagnostics that sample every ten steps, whatever the cost."""
    monkeypatch.setattr(diagnostics, "STEPS", 10)
    monkeypatch.setattr(diagnostics, "POINT_STEPS", 0)


# ---- how samples are combined ----


@pytest.mark.parametrize(
    ("name", "ok", "suspect"),
    [
        ("disconnected", [1.0, 1.0, 0.05, 0.05], [0.0, 0.0, 0.2, 0.2]),
        ("density_drift", [0.3, 0.3, 0.01, -0.02], [0.0, 0.0, 0.1, 0.1]),
        ("density_drift", [0.0, 0.0, 0.04], [0.0, -0.1, -0.1]),
        ("gaps", [0.0, 0.0], [0.01, 0.0]),
        ("courant", [0.5, 0.63], [0.65, 0.5]),
    ],
)
def test_verdicts(scene, name, ok, suspect):
    good, bad = (health(scene, samples(**{name: column})) for column in (ok, suspect))
    assert good[name].verdict == "ok"
    assert good.ok
    assert bad[name].verdict == "suspect"
    assert not bad.ok


def test_energy_from_nowhere_is_a_rise_of_the_account(scene):
    """The created energy is relative to the energy turnover: 10 J at the start and 30 J of work."""

    def value(created):
        seen = samples(created=created, work=[10.0, -10.0, 10.0], held_before=[10.0, 0.0, 0.0])
        return health(scene, seen)["energy_created"].value

    assert value([-5.0, -5.0, -5.0]) == 0
    assert value([1.0, -5.0, 2.0]) == pytest.approx(2 / 40)
    assert value([1.0, 3.0, -9.0]) == pytest.approx(4 / 40)


def test_what_has_no_value_has_no_verdict(scene):
    empty = health(scene, {})
    assert {indicator.verdict for indicator in empty} == {"unknown"}
    assert empty.ok
    seen = health(scene, samples(ill_posed=[0.9, np.nan, 0.7]))
    assert seen["ill_posed"].verdict == "reported"
    assert seen["ill_posed"].value == 0.7
    with pytest.raises(KeyError):
        empty["luck"]
    seen = health(scene, samples(disconnected=[0.5]))
    assert "disconnected  0.5 (limit 0.1): suspect" in str(seen)
    assert "<table>" in seen._repr_html_()
    assert "1 samples" in seen._repr_html_()


# ---- when it samples ----


def test_samples_are_far_apart(scene):
    """The first opens the accounts."""
    due = Monitor(scene).due
    assert due(0, 8000) and due(2250, 8000) and due(22_000, 100)
    assert not due(1000, 8000) and not due(2250, 100)


def test_a_run_samples_unless_told_not_to(scene, often):
    watched, blind = gr.Simulation(scene, threads=1), gr.Simulation(scene, threads=1)
    watched.run(until=0.1, every=0.02)
    blind.run(until=0.1, every=0.02, monitor=False)
    # five frames and the present state; only that state without a monitor
    assert watched.health().samples == 6
    assert blind.health().samples == 1
    assert watched.state.x.tobytes() == blind.state.x.tobytes()
    assert watched.health().samples == 6  # asking for the health adds no sample
    assert gr.Simulation(scene, threads=1).health().samples == 0


@pytest.mark.parametrize("free", ["", "y"])
def test_work_of_bodies_is_in_the_account(scene, often, free):
    """A disc pressed into the layer does ten times the work of gravity: no energy is created."""
    disc = gr.bodies.Cylinder(0.1, center=(0.0, 0.0))
    motion = gr.bodies.Motion(velocity=((0.0, -1.0),))
    x, y = scene.grid.lower[0] + 0.2, scene.grid.lower[1] + 0.45
    body = gr.bodies.Body(disc, (x, y), motion=motion, free=free, mass=1e3 if free else None)
    sim = gr.Simulation(scene.replace(bodies=(body,)))
    sim.run(until=0.1, every=0.02)
    seen = sim.health()
    assert sim.bodies[0].work > 0
    assert seen["energy_created"].verdict == "ok", str(seen)
    assert seen["courant"].verdict == "ok"
    work = np.nansum(sim._monitor.columns()["work"])
    without = np.nansum(sim._monitor.columns()["created"]) + sim.bodies[0].work
    assert without > diagnostics.ENERGY_LIMIT * work  # it would be suspect without this work


@pytest.mark.parametrize(("frequency", "known"), [(0.0, True), (25.0, False)])
def test_work_of_gravity_that_goes_back_and_forth_is_unknown(scene, often, frequency, known):
    """Frames every 0.02 s know nothing of the 0.04 s in which a bed is shaken up and down."""
    times = np.linspace(0.0, 0.1, 101)
    pull = -9.8 * (1 + 3 * np.sin(2 * np.pi * frequency * times))
    gravity = gr.Gravity(tuple(times), tuple((0.0, g) for g in pull))
    sim = gr.Simulation(scene.replace(gravity=gravity), threads=1)
    sim.run(until=0.1, every=0.02)
    created = sim._monitor.columns()["created"]
    assert np.isfinite(created).all() == known and np.isnan(created).all() != known
    assert sim.health()["energy_created"].verdict == ("ok" if known else "unknown")


def test_samples_go_on_after_a_restart(scene, often, tmp_path):
    """At the steps at which those of an unbroken run would have been taken."""
    whole = gr.Simulation(scene, threads=1)
    whole.run(until=0.1, every=0.002, save=tmp_path / "whole.h5")
    gr.Simulation(scene, threads=1).run(until=0.053, every=0.002, save=tmp_path / "cut.h5")
    gr.Simulation.resume(tmp_path / "cut.h5", threads=1).run(until=0.1)
    taken = [
        np.isfinite(record.samples["courant"])
        for name in ("whole.h5", "cut.h5")
        for record in [gr.open(tmp_path / name)]
    ]
    assert np.array_equal(*taken)


def test_a_suspect_run_ends_with_a_warning(scene, often, monkeypatch):
    """It says what to do, and once for each indicator."""
    monkeypatch.setattr(diagnostics.Bulk, "disconnected", lambda self: 0.5)
    sim = gr.Simulation(scene, threads=1)
    with pytest.warns(gr.StabilityWarning, match=r"disconnected = 0.5 .* is suspect: .*; take "):
        sim.run(until=0.3, every=0.02)
    unwatched = gr.Simulation(scene, threads=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sim.run(until=0.35, every=0.02)
        unwatched.run(until=0.3, every=0.02, monitor=False)
    assert sim.health().verdict.startswith("verdict: suspect, disconnected = 0.5 (limit 0.1), ")


def test_grains_that_cannot_bear_yet_are_not_suspect(scene):
    """All points are stress-free at the start, until gravity acts and waves have crossed them."""
    sim = gr.Simulation(scene, threads=1)
    sim.step(10)
    assert sim.health()["disconnected"].verdict == "unknown"
    sim.run(until=0.3, monitor=False)
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
    """In free fall the work of gravity equals the kinetic energy; no energy is created or lost."""
    scene = small_scene("outlet", 2, DEFAULT)
    fall = scene.replace(
        walls=(),
        fills=(gr.geometry.Fill(FALLING, 4, density=1200.0),),
        gravity=Gravity((0.0,), ((0.0, -9.8),)),
    )
    sim, watch = gr.Simulation(fall, threads=1), Monitor(fall)
    watch.sample(sim.state)
    sim.run(until=0.15, monitor=False)
    row = watch.sample(sim.state)
    kinetic = gr.measure.energy(sim.state).kinetic
    # The positions of the integrator are half a step ahead of its velocities.
    assert row["work"] == pytest.approx(kinetic, rel=2 * sim.dt / sim.time)
    assert row["created"] == pytest.approx(kinetic - row["work"], abs=1e-9 * kinetic)
    assert row["held_before"] == 0.0
    assert np.isnan(row["disconnected"])  # disconnected material has no bulk


FALLING = gr.geometry.Box((0.15, 0.4), (0.45, 0.55))


# ---- in the record ----


def test_samples_are_recorded_and_read(scene, often, tmp_path, capsys):
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.1, every=0.02, save=tmp_path / "a.h5")
    with gr.open(tmp_path / "a.h5") as record:
        told = record.samples
        assert set(told) == {*NAMES, *(name for name, *_ in INDICATORS), "wall_strain"}
        assert np.isnan(told["courant"][0]) and np.isnan(told["wall_strain"]).all()
        taken = dict(zip(sim._monitor.names, np.array(sim._monitor.rows).T, strict=True))
        assert np.isnan(taken.pop("wall_strain")).all()  # no wall of the scene keeps a pressure
        for name, column in taken.items():
            np.testing.assert_array_equal(told[name][1:], column)
        seen = record.health()
        assert seen.samples == len(record) == 6
        assert record[2:4].health().samples == 2
        assert record.damage() == []
    assert main(["info", str(tmp_path / "a.h5")]) == 0
    assert str(seen) in capsys.readouterr().out


def test_an_unfinished_record_has_samples(scene, often, tmp_path):
    path, found = tmp_path / "a.h5", []

    def look(sim):
        with gr.open(path) as record:
            assert not record.finished
            found.append(np.isfinite(record.samples.get("courant", [])).sum() - len(record))

    gr.Simulation(scene, threads=1).run(until=0.06, every=0.02, save=path, hooks=(look,))
    assert found == [-1] * 4


def test_a_resumed_run_remembers_its_samples(scene, often, tmp_path):
    gr.Simulation(scene, threads=1).run(until=0.1, every=0.02, save=tmp_path / "a.h5")
    resumed = gr.Simulation.resume(tmp_path / "a.h5", threads=1)
    assert len(resumed._monitor.rows) >= 5
    resumed.run(until=0.2, every=0.02)
    with gr.open(tmp_path / "a.h5") as record:
        assert np.isfinite(record.samples["courant"]).sum() >= 9
    unwatched = gr.Simulation(scene, threads=1)
    unwatched.run(until=0.04, every=0.02, save=tmp_path / "b.h5", monitor=False)
    with gr.open(tmp_path / "b.h5") as record:
        assert record.samples == {}
        judged, expected = record.health(), unwatched.health()
        assert judged["density_drift"] == expected["density_drift"]
        assert judged["courant"] == expected["courant"]
        assert judged.samples == 1 and judged.verdict.startswith("verdict: ok, density_drift = ")
        assert judged.rows()["in_solids"] == "- (limit 0): does not apply, or not known yet"
        assert record[:1].health().verdict.startswith("verdict: unknown, ")


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
    fill = granular.geometry.Box((0.0, bottom * CELL), (16 * CELL, 20 * CELL))
    sides = [gr.Wall(0, at, kind="free_slip") for at in (0.0, 16 * CELL)]
    return gr.Scene(
        name="rocks",
        grid=gr.Grid((0.0, 0.0), CELL, (16, 24)),
        fills=(gr.Fill(fill, 4, velocity=(0.0, -1.0)),),
        material=gr.MuI(E=1e6),
        gravity=Gravity((0.0,), ((0.0, -9.8),)),
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
def test_the_health_of_a_run_that_failed(scene, often, spoil):
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
