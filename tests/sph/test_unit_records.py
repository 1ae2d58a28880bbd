"""SPH with the tools of the package: records, resuming, moving walls, pictures."""

import contextlib
import dataclasses
import math
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from operator import attrgetter

import h5py
import numpy as np
import pytest
from paraview_reader import as_array, paraview
from same_bits import fields

import granular as gr
from granular import Box, Fill, Gravity, Grid, _core, sph
from granular.cli import main
from granular.record import RecordError, TrajectoryWriter
from granular.run.machine import Machine

DX = 0.01


def gated(dim=2, **changes):
    """A small heap behind a gate that lifts at 0.02 s and is removed at 0.05 s."""
    level = (0.0,) * (dim - 2)
    shape = (14, *(6,) * (dim - 2), 8)
    across = tuple((0.0, n * DX) for n in shape[1:-1])
    motion = {"velocity": (0.0, *level, 1.0), "moves_from": 0.02, "until": 0.05}
    gate = sph.ParticleWall(0, 6 * DX, -1, layers=3, span=(*across, (0.0, 8 * DX)), **motion)
    scene = sph.Scene(
        name="gated",
        grid=Grid((0.0, *level, 0.0), DX, shape, periodic=(False, *(True for _ in level), False)),
        fills=(Fill(Box((0.0, *level, 0.0), (6 * DX, *(6 * DX for _ in level), 6 * DX)), 1),),
        material=sph.Viscoplastic(mu_l=0.4, mu_h=0.4, dilation=0.5),
        walls=(
            sph.ParticleWall(dim - 1, 0.0, 1, layers=3),
            sph.ParticleWall(0, 0.0, 1, layers=3),
            gate,
        ),
        gravity=Gravity((0.0,), ((0.0, *level, -9.81),)),
        duration=0.1,
        parameters={"half_width": 6 * DX},
    )
    return scene.replace(**changes)


def test_scene_is_written_and_read():
    scene = gated(numerics=sph.Numerics(cfl=0.5))
    assert sph.Scene.from_json(scene.to_json()) == scene
    with pytest.raises(ValueError, match="not the JSON of a scene"):
        gr.Scene.from_json(scene.to_json())
    assert re.search("SPH|hydrodynamics", scene._repr_html_())


def test_a_record_is_read_where_sph_was_not_used_before(tmp_path):
    """In a process of its own, which has imported `granular` alone."""
    scene = gr.scenes.incline_sph(height=0.05, duration=0.01)
    gr.Simulation(scene, threads=1).run(save=tmp_path / "a.h5", every=0.01)
    code = f"import granular as gr; print(gr.open({str(tmp_path / 'a.h5')!r}).scene.name)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert run.stdout.strip() == "incline_sph", run.stderr


def test_the_scene_chooses_the_method():
    simulation = gr.Simulation(gated())
    assert type(simulation) is sph.Simulation and isinstance(simulation, gr.Simulation)
    assert isinstance(gr.Simulation(gr.scenes.incline()), gr.mpm.simulation.Simulation)
    with pytest.raises(TypeError, match=r"must be a granular\.sph\.Scene"):
        sph.Simulation(gr.scenes.incline())
    with pytest.raises(TypeError, match=r"granular\.mpm\.Scene or a granular\.sph\.Scene"):
        gr.Simulation("incline")


def test_a_block_of_recording_writes_what_a_run_does(tmp_path):
    """Steps and runs within it, with the gas of a jet: the same frames, bits and verdict; an error
    in the block leaves a record that is resumed."""
    scene = gr.scenes.jet_on_bed(spacing=0.05, duration=0.02)
    whole = gr.Simulation(scene).run(save=tmp_path / "run.h5", every=0.004)
    sim = gr.Simulation(scene)
    with sim.recording(tmp_path / "block.h5", every=0.004):
        while sim.time < 0.01:
            sim.step(7)
        sim.run()
    one, other = gr.open(tmp_path / "run.h5"), gr.open(tmp_path / "block.h5")
    assert len(one) == len(other) == 6
    for a, b in zip(one, other, strict=True):
        assert (a.step, fields(a), fields(a.gas)) == (b.step, fields(b), fields(b.gas))
    assert sim.health().verdict == whole.health().verdict == other.health().verdict
    cut = gr.Simulation(scene)
    with pytest.raises(ZeroDivisionError), cut.recording(tmp_path / "cut.h5", every=0.004):
        cut.step(20)
        raise ZeroDivisionError
    resumed = gr.Simulation.resume(tmp_path / "cut.h5")
    assert resumed.steps == 20
    assert fields(resumed.run().state) == fields(whole.state)


def test_a_record_goes_on_bitwise(dim, tmp_path):
    """The record is interrupted before the gate moves, while it moves, and after it is removed."""
    scene = gated(dim)
    through = gr.Simulation(scene).run(0.075, every=0.01)
    gr.Simulation(scene).run(0.015, every=0.01, save=tmp_path / "a.h5")
    for stop, threads in ((0.035, 1), (0.06, 2), (0.075, 1)):
        again = gr.Simulation.resume(tmp_path / "a.h5", threads=threads)
        again.run(stop)
        assert again.time >= stop and again.counts["rebuilds"] >= 0
    assert fields(through.state) == fields(again.state) and fields(through.walls) == fields(
        again.walls
    )
    with gr.open(tmp_path / "a.h5") as record:
        assert record.scene == scene and record.finished
        assert fields(record[-1]) == fields(through.state)
        assert np.isfinite(record[0].pressure).all()
        assert record.damage() == [] and len(record) >= 9


# ---- gas ----

GAS_FIELDS = {"id", "x", "v", "a", "mass", "density", "pressure", "porosity"}


def blown(dim=2):
    """A small bed that is open above, and a jet that blows gas out of the domain."""
    shape = (8, *(6,) * (dim - 2), 10)
    ends = tuple(n * DX for n in shape)
    still = (0.0,) * dim
    jet = sph.Jet(Box((*still[1:], 0.07), (*(0.03 for _ in still[1:]), 0.1)), (*still[1:], 60.0))
    return sph.Scene(
        name="blown",
        grid=Grid(still, DX, shape, periodic=(*(True for _ in shape[1:]), False)),
        fills=(Fill(Box(still, (*ends[:-1], 0.05)), 1),),
        numerics=sph.Numerics(smoothing=1.25),
        walls=(sph.ParticleWall(dim - 1, 0.0, 1, layers=3),),
        gas=sph.Gas(fills=(Fill(Box(still, ends), 1),), jets=(jet,)),
        gravity=Gravity((0.0,), ((*still[1:], -9.81),)),
        duration=0.004,
    )


def same_gas(a, b):
    assert set(a.fields) == GAS_FIELDS and a.time == b.time
    return fields(a) == fields(b)


def test_frames_hold_the_gas(dim, tmp_path):
    """Frames are equal while the record is open, after closing, and after a resumed run."""
    scene, path, seen = blown(dim), tmp_path / "a.h5", []

    def see(simulation):
        seen.append(simulation.gas)
        if simulation.time > 0.003 and len(seen) == 4:
            with gr.open(path) as record:
                assert not record.finished and record.has_gas
                assert all(same_gas(f.gas, g) for f, g in zip(record, seen, strict=False))

    through = gr.Simulation(scene).run(every=1e-3, hooks=(seen.append,))
    assert through.counts["gas_dropped"] > 0
    seen.clear()
    gr.Simulation(scene).run(0.003, save=path, every=1e-3, hooks=(see,))
    gr.Simulation.resume(path).run(hooks=(see,))
    assert len(seen) == 5 and seen[-1].n < seen[0].n
    with gr.open(path) as record:
        assert record.finished and record.damage() == [] and len(record) == 5
        assert all(same_gas(f.gas, g) for f, g in zip(record, seen, strict=True))
        assert same_gas(record[-1].gas, through.gas) and same_gas(through.state.gas, through.gas)
        with pytest.raises(ValueError, match="read-only"):
            record[-1].gas.pressure[0] = 0.0


def test_a_run_with_gas_may_follow_one_without(tmp_path):
    path = tmp_path / "a.h5"
    gr.Simulation(blown()).run(0.002, save=path, every=1e-3, gas=False)
    with h5py.File(path) as file:
        assert "gas" not in file["granular"]
    with gr.open(path) as record:
        assert not record.has_gas and not hasattr(record[-1], "gas")
    simulation = gr.Simulation.resume(path).run()
    with gr.open(path) as record:
        assert [hasattr(state, "gas") for state in record] == [False, False, False, True, True]
        assert same_gas(record[-1].gas, simulation.gas) and record.damage() == []


def test_damaged_gas_is_found(tmp_path):
    path = tmp_path / "a.h5"
    gr.Simulation(blown()).run(0.001, save=path, every=1e-3)
    with h5py.File(path, "r+") as file:
        data = file["granular/gas/VTKHDF/PointData/pressure"]
        data[3] = data[3] + 1.0
    with gr.open(path) as record:
        assert len(record.damage()) == 1 and "does not match its digest" in record.damage()[0]
        with pytest.raises(RecordError, match="step 0 does not match"):
            _ = record[0]
        assert record[1].gas.n > 0


def test_foreign_gas_is_refused(tmp_path):
    simulation = gr.Simulation(blown())
    with TrajectoryWriter(tmp_path / "a.h5", simulation.scene) as writer:
        writer.append(simulation.state, others={"gas": {"x": np.zeros((3, 2)), "mass": np.ones(3)}})
    with gr.open(tmp_path / "a.h5") as record, pytest.raises(RecordError, match="missing"):
        _ = record[0]


def test_paraview_reads_the_grains_and_by_a_link_the_gas(dim, tmp_path):
    path, link = tmp_path / "a.h5", tmp_path / "gas.vtkhdf"
    simulation = gr.Simulation(blown(dim)).run(0.001, save=path, every=1e-3, fields=["speed"])
    with h5py.File(link, "w") as file:
        file["VTKHDF"] = h5py.ExternalLink(path.name, "/granular/gas/VTKHDF")
    state = simulation.state
    for file, seen, name in ((path, state, "speed"), (link, state.gas, "pressure")):
        *_, (_, data) = paraview(file)
        assert np.array_equal(as_array(data.GetPoints().GetData())[:, :dim], seen.x)
        assert np.array_equal(as_array(data.GetPointData().GetArray(name)), getattr(seen, name))


def test_gate_moves_on_time_and_goes():
    scene = gated()
    simulation = gr.Simulation(scene)
    gate = np.array([w == 2 for w in scene.wall_points()["wall"]])
    start = simulation.walls
    low, ids = start.x[gate, 1].min(), start.id[gate]
    simulation.run(0.019, monitor=False)
    assert simulation.walls.v.max() == 0.0 and simulation.state.x[:, 0].max() < 6 * DX
    simulation.run(0.04, monitor=False)
    walls = simulation.walls
    lifted = np.isin(walls.id, ids)
    assert walls.v[lifted, 1].min() == 1.0 and walls.v[~lifted].max() == 0.0
    # from 0.02 s on, whatever the steps are
    assert walls.x[lifted, 1].min() - low == pytest.approx(simulation.time - 0.02, abs=1e-12)
    simulation.run(0.055, monitor=False)
    assert not np.isin(simulation.walls.id, ids).any()
    assert len(simulation.walls.id) == np.count_nonzero(~gate)
    simulation.run(0.1, monitor=False)
    assert simulation.state.x[:, 0].max() > 6 * DX and simulation.counts["dropped"] == 0


@pytest.mark.parametrize("isa", ["baseline", None])
def test_particles_that_are_too_fast_for_the_step_are_stopped_by_walls(isa):
    """With hardly any pressure only the walls themselves stop particles, and they report it.

    They are pressed together, so that the lists of neighbours need more places than at the start,
    and most of them with the instruction set that has the fewest lanes.
    """
    floor, side = sph.ParticleWall(1, 0.0, 1), sph.ParticleWall(0, 0.0, 1)
    scene = sph.Scene(
        name="soft",
        grid=Grid((0.0, 0.0), DX, (12, 12)),
        fills=(Fill(Box((0.02, 0.02), (0.08, 0.08)), 1, velocity=(-5.0, -8.0)),),
        material=sph.Viscoplastic(kappa=1.0),
        walls=(floor, side),
        gravity=Gravity((0.0,), ((0.0, -9.81),)),
        duration=0.05,
    )
    with pytest.warns(gr.StabilityWarning, match="take kappa >="):
        simulation = gr.Simulation(scene, isa=isa)
    simulation.run()
    assert simulation.counts["stopped"] > 10 and simulation.counts["dropped"] == 0
    assert simulation.n_points == 36 and simulation.state.x.min() >= 0.0
    health = simulation.health()
    assert health["stopped"].value > 10 and health["mach"].verdict == "suspect"
    again = gr.Simulation.from_checkpoint(scene, simulation.checkpoint())
    assert again.counts["stopped"] == simulation.counts["stopped"]


def test_the_step_follows_the_fastest_particle():
    """No particle moves more than h/4 in a step, even where it is faster than sound."""
    scene = gated(walls=())
    fast = dataclasses.replace(scene.fills[0], velocity=(30.0, 0.0))
    with pytest.warns(gr.StabilityWarning, match="take kappa >="):
        simulation = gr.Simulation(scene.replace(fills=(fast,)))
    simulation.step(1)
    assert simulation.dt == pytest.approx(0.25 * scene.h / 30.0, rel=1e-12)


def test_what_runs_away_is_named_and_the_record_is_good(tmp_path):
    scene = gated(numerics=sph.Numerics(dt=2e-4))

    def kick(simulation):
        if simulation.time > 0.02:
            simulation.buffers["v"][0, 5] = 1e3

    simulation = gr.Simulation(scene)
    with pytest.raises(gr.SimulationError, match="crossed more than") as error:
        simulation.run(every=0.01, save=tmp_path / "a.h5", hooks=(kick,))
    assert error.value.point == simulation.buffers["id"][5]
    assert "the last good checkpoint" in error.value.__notes__[0]
    assert gr.Simulation.resume(tmp_path / "a.h5").run(0.05).time >= 0.05


def test_measures_and_pictures_take_its_states(tmp_path):
    simulation = gr.Simulation(gated()).run(0.1, every=0.05)
    state = simulation.state
    assert gr.measure.runout(state).quantile > 0.05
    profile = gr.measure.velocity_profile(state)
    assert np.isfinite(profile.value).any()
    energy = gr.measure.energy(state)
    assert energy.kinetic > 0 and energy.elastic >= 0
    health = simulation.health()
    assert {indicator.name for indicator in health} >= {"mach", "stopped", "courant"}
    assert all(health[name].verdict == "ok" for name in ("mach", "courant"))
    picture = gr.plot.frame(state, "pressure")
    assert len(picture.axes[0].patches) == 3
    assert [p.get_visible() for p in picture.axes[0].patches] == [True, True, False]


def test_stored_energy_is_the_integral_of_the_pressure():
    material = sph.Viscoplastic(rho0=1500.0, kappa=3e5)
    rho = np.linspace(1500.0, 2100.0, 20001)
    p = material.kappa * ((rho / material.rho0) ** 1.5 - 1.0)
    work = np.trapezoid(p / rho**2, rho)
    assert material.stored_energy(rho)[[0, -1]] == pytest.approx([0.0, work], rel=1e-8)
    assert material.stored_energy(np.array([1400.0])) == 0.0


def test_a_sweep_takes_scenes_of_both_methods(tmp_path):
    cases = {"grid": gr.scenes.incline(cell=0.04, duration=0.02), "points": gated(duration=0.02)}
    with ThreadPoolExecutor(1) as executor:
        options = {"every": 0.01, "measure": attrgetter("scene.method"), "progress": False}
        swept = gr.sweep(cases, executor, folder=tmp_path, **options)
    assert list(swept) == ["mpm", "sph"] and not swept.errors


def test_a_run_ends_at_rest():
    """Rest is relative to the largest speed; creep never falls below the limit of the thesis."""
    seen = []
    simulation = gr.Simulation(gated(duration=1.0))
    time = sph.run_to_rest(
        simulation, after=0.05, interval=0.02, share=0.3, hooks=(lambda s: seen.append(s.state),)
    )
    assert time == simulation.time and 0.1 < time < 0.9
    speeds = [np.sqrt(np.mean((s.v**2).sum(axis=1))) for s in seen if s.time > 0.06]
    assert speeds[-1] < 0.3 * max(speeds) <= speeds[-2]
    kinetic = gr.measure.energy(simulation.state).kinetic / (36 * 1e-4)
    assert kinetic > 1e-5  # J/m3
    assert sph.run_to_rest(gr.Simulation(gated()), share=0.0, until=0.01) is None
    with pytest.raises(ValueError, match="share = 2"):
        sph.run_to_rest(simulation, share=2.0)


def test_command_line_reads_and_resumes(tmp_path, capsys):
    gr.Simulation(gated()).run(0.03, every=0.01, save=tmp_path / "a.h5")
    assert main(["info", str(tmp_path / "a.h5")]) == 0
    assert "gated" in capsys.readouterr().out
    assert main(["resume", str(tmp_path / "a.h5"), "--until", "0.05", "--quiet"]) == 0
    assert main(["plot", str(tmp_path / "a.h5"), "-o", str(tmp_path / "a.png"), "--quiet"]) == 0
    with gr.open(tmp_path / "a.h5") as record:
        assert record.times[-1] >= 0.05


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"moves_from": -1.0}, "moves_from = -1"),
        ({"until": 0.0}, "until = 0"),
        ({"until": math.nan}, "until = nan"),
        ({"velocity": (math.inf, 0.0)}, "velocity"),
    ],
)
def test_wrong_walls_are_named(change, words):
    with pytest.raises((TypeError, ValueError), match=words):
        sph.ParticleWall(0, 0.0, 1, **change)


@pytest.mark.parametrize("column", range(12))
def test_core_survives_any_wall(column, monkeypatch):
    taken = {}
    monkeypatch.setattr(_core, "Sph", lambda **k: taken.update(k))
    sph.simulation._build(gated(), Machine())
    monkeypatch.undo()
    walls = taken["walls"]
    for value in (math.nan, -1.0, 1e300, math.inf):
        taken["walls"] = walls.copy()
        taken["walls"][1, column] = value
        simulation = gr.Simulation(gated())
        rows = simulation._rows
        with contextlib.suppress(ValueError, gr.SimulationError):
            engine = _core.Sph(**taken)
            engine.bind(simulation.buffers, rows.grains, rows.wall_first, rows.walls, True)
            engine.advance(60, math.inf, 1)
