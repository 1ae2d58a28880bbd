"""Sweeps: every case once, in order, in its own record; resumed to the same bits."""

import copyreg
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from concurrent.futures import Future, ThreadPoolExecutor
from operator import attrgetter
from pathlib import Path

import numpy as np
import pytest
from records import abandon
from same_bits import shown

import granular as gr
from granular.run import running, sweeping

ROOT = Path(__file__).parents[2]
PLAIN = ("linear", "flip", "particle")
EVERY = 0.01


class AtOnce:
    """Minimal executor: works in `submit`, counts calls, and can be interrupted."""

    def __init__(self, stop_before=None):
        self.calls, self.stop_before = 0, stop_before

    def submit(self, function, /, *arguments):
        if self.calls == self.stop_before:
            raise KeyboardInterrupt
        self.calls += 1
        future = Future()
        future.set_result(function(*arguments))
        return future


@pytest.fixture
def scenes(small_scene):
    """Three short scenes that differ in stiffness."""
    base = small_scene("walls", 2, PLAIN, E=1e5).replace(duration=0.03)
    return [base.replace(material=base.material.replace(E=E)) for E in (1e5, 2e5, 3e5)]


@pytest.fixture
def processors(monkeypatch):
    """A machine on which a single simulation would use three threads."""
    monkeypatch.setattr(running, "SMALL", 0)
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1, 2}, raising=False)


def quiet(cases, executor=None, **options):
    return gr.sweep(cases, executor, progress=False, **options)


def stored(record):
    """All frames of a record and its checkpoint, as bytes."""
    return [shown(state) for state in record], record.checkpoint().digest


def final_height(record):
    return float(record[-1].x[:, 1].max())


def test_records_in_the_order_of_the_cases(scenes, tmp_path, processors):
    results = quiet(scenes, AtOnce(), folder=tmp_path / "new" / "records", every=EVERY)
    assert results.keys == (0, 1, 2)
    assert results.errors == {}
    assert [path.name for path in results.paths] == ["0.h5", "1.h5", "2.h5"]
    for scene, record, path in zip(scenes, results, results.paths, strict=True):
        whole = gr.Simulation(scene).run()
        assert whole.threads == 3
        with record:
            assert record.path == path
            assert record.scene == scene
            assert record.provenance["threads"] == 1
            assert len(record) == 4
            assert record[-1].x.tobytes() == whole.state.x.tobytes()
    with pytest.raises(IndexError, match=r"case 3 must be in \[-3, 2\]"):
        results[3]


def test_without_a_folder_the_records_go_with_the_results(scenes):
    results = quiet(scenes[:2], AtOnce(), every=EVERY)
    place = results.paths[0].parent
    assert [len(record) for record in results] == [4, 4]
    assert [record.scene for record in results[::-1]] == scenes[1::-1]
    del results
    assert not place.exists()


def test_a_measure_makes_the_results(scenes, tmp_path):
    found = quiet(iter(scenes), AtOnce(), measure=final_height, every=EVERY)
    states = [gr.Simulation(scene, threads=1).run().state for scene in scenes]
    assert list(found) == [s.x[:, 1].max() for s in states]
    assert len(set(found)) == 3


def height_and_time(record):
    if record.scene.material.E > 2e5:
        raise RuntimeError("too stiff")
    return {"height": final_height(record), "time": float(record.times[-1])}


def test_results_are_a_table(scenes):
    pytest.importorskip("pandas")
    cases = dict(zip([("a", 1.0), ("a", 2.0), ("b", 3.0)], scenes, strict=True))
    with pytest.warns(RuntimeWarning, match="too stiff"):
        found = quiet(cases, AtOnce(), measure=height_and_time)
    table = found.to_dataframe(["name", "E"])
    assert table.index.names == ["name", "E"] and list(table) == ["height", "time", "error"]
    assert table.loc[("a", 2.0), "height"] == found[1]["height"]
    assert np.isnan(table.loc[("b", 3.0), "time"])
    assert list(table["error"].dropna()) == ["RuntimeError: too stiff"]
    with pytest.raises(ValueError, match="must name 2 parts of the keys"):
        found.to_dataframe(["E"])
    plain = quiet(scenes[:2], AtOnce(), measure=final_height)
    assert plain.to_dataframe().index.name == "case" and list(
        plain.to_dataframe()["result"]
    ) == list(plain)
    with pytest.raises(ValueError, match="measure = None"):
        quiet(scenes[:1], AtOnce()).to_dataframe()


def test_keys_name_the_records(scenes, tmp_path):
    cases = dict(zip([("W", 1.5, np.float64(0.1)), "A-1", -2], scenes, strict=True))
    results = quiet(cases, AtOnce(), folder=tmp_path)
    assert results.keys == tuple(cases)
    assert sorted(os.listdir(tmp_path)) == ["-2.h5", "A-1.h5", "W_1.5_0.1.h5"]


def test_complete_cases_are_not_run_again(scenes, tmp_path, monkeypatch):
    quiet(scenes[:2], AtOnce(), folder=tmp_path, every=EVERY)
    before = [(tmp_path / f"{i}.h5").read_bytes() for i in range(2)]
    started = []
    run = gr.Simulation.run
    monkeypatch.setattr(
        gr.Simulation, "run", lambda sim, **rest: started.append(sim.scene) or run(sim, **rest)
    )
    heights = quiet(scenes, AtOnce(), folder=tmp_path, every=EVERY, measure=final_height)
    assert started == scenes[2:]
    assert len(set(heights)) == 3
    assert [(tmp_path / f"{i}.h5").read_bytes() for i in range(2)] == before


class ThirdFrame:
    """Hook that ends a run at the third frame that it sees."""

    seen = 0

    def __call__(self, sim):
        self.seen += 1
        return self.seen == 3


def test_hooks_end_cases_which_are_complete_then(scenes, tmp_path, monkeypatch):
    """Each case has hooks of its own, also in one process; a file says that a hook ended it."""
    options = {
        "folder": tmp_path,
        "every": 1e-3,
        "hooks": (ThirdFrame(), gr.stop.at_rest(1e-9, over=1.0)),
        "fields": ["pressure"],
        "precision": "single",
        "wall_forces": True,
    }
    found = quiet(scenes, AtOnce(), **options)
    for scene, record in zip(scenes, found, strict=True):
        with record:
            assert len(record) == 3 and record.times[-1] < scene.duration
            assert record.provenance["precision"] == "single"
            assert record.provenance["fields"] == ["pressure"]
            assert gr.measure.wall_force(record, 0).force.shape == (len(record) - 1, 2)
    assert "hook ThirdFrame ended this case at t = 0.0" in (tmp_path / "0.stopped").read_text()
    (tmp_path / "1.h5").unlink()
    started = []
    run = gr.Simulation.run
    monkeypatch.setattr(
        gr.Simulation, "run", lambda sim, **rest: started.append(sim.scene) or run(sim, **rest)
    )
    again = quiet(scenes, AtOnce(), **options)
    assert started == [scenes[1]]
    assert [len(record) for record in again] == [len(record) for record in found]


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("moment", [0.012, 0.019])
def test_an_interrupted_sweep_goes_on_to_the_same_bits(
    scenes, tmp_path, monkeypatch, processors, moment
):
    """Ctrl-C in the second of three cases, between two frames or in the step that makes one."""
    whole = quiet(scenes, AtOnce(), folder=tmp_path / "whole", every=EVERY)
    advance = gr.Simulation._advance

    def interrupted(sim, max_steps, until):
        advance(sim, 1, until)
        if sim.scene == scenes[1] and sim.time > moment:
            signal.raise_signal(signal.SIGINT)

    parts = tmp_path / "parts"
    with monkeypatch.context() as patch:
        patch.setattr(gr.Simulation, "_advance", interrupted)
        with pytest.raises(KeyboardInterrupt):
            quiet(scenes, AtOnce(), folder=parts, every=EVERY)
    with gr.open(parts / "1.h5") as record:
        assert moment < record.checkpoint().time < 0.03
    assert not (parts / "2.h5").exists()
    again = quiet(scenes, AtOnce(), folder=parts, every=EVERY)
    for one, other in zip(whole, again, strict=True):
        assert one.finished
        assert other.finished
        assert stored(one) == stored(other)
        assert other.provenance["threads"] == 1
    assert len(again[1].provenance["earlier"]) == 1  # resumed, not run again


def test_a_record_without_a_checkpoint_is_begun_anew(scenes, tmp_path):
    """A process killed in the first moments of a run leaves such a record."""
    writer = gr.record.TrajectoryWriter(tmp_path / "0.h5", scenes[0])
    writer.append(gr.Simulation(scenes[0], threads=1).state)
    abandon(writer)
    (record,) = quiet(scenes[:1], AtOnce(), folder=tmp_path, every=EVERY)
    assert record.finished and len(record) == 4


def test_failing_cases_do_not_stop_the_others(scenes, tmp_path, monkeypatch):
    advance = gr.Simulation._advance

    def failing(sim, max_steps, until):
        advance(sim, max_steps, until)
        if sim.scene == scenes[1]:
            sim.buffers["x"][0, np.flatnonzero(sim.buffers["id"] >= 0)[5]] = np.nan

    cases = dict(zip("abc", scenes, strict=True))
    with monkeypatch.context() as patch:
        patch.setattr(gr.Simulation, "_advance", failing)
        with pytest.warns(RuntimeWarning, match="case 'b' failed: SimulationError: .* point"):
            results = quiet(cases, AtOnce(), folder=tmp_path, every=EVERY)
        assert list(results.errors) == ["b"]
        assert isinstance(results.errors["b"], gr.SimulationError)
        assert results.errors["b"].point >= 0
        assert results[1] is None
        assert [results[i].times[-1] >= 0.03 for i in (0, 2)] == [True, True]
        assert "3 cases, 1 failed" in repr(results)
        with (
            pytest.warns(RuntimeWarning, match="case 'b'"),
            pytest.raises(ExceptionGroup, match="1 of 3 cases failed") as caught,
        ):
            quiet(cases, AtOnce(), folder=tmp_path, every=EVERY, strict=True)
    (error,) = caught.value.exceptions
    assert "in case 'b'" in error.__notes__[-1]
    # the fault is gone: the case is resumed
    again = quiet(cases, AtOnce(), folder=tmp_path, every=EVERY)
    assert again.errors == {}
    whole = gr.Simulation(scenes[1], threads=1).run()
    assert again[1][-1].x.tobytes() == whole.state.x.tobytes()


class Odd(Exception):
    """An error that cannot be unpickled, which would break a process pool."""

    def __init__(self, one, two):
        super().__init__(one)


def raise_odd(record):
    raise Odd("strange", 2)


def test_errors_travel(scenes, monkeypatch):
    # distributed, once another test has imported it, makes all exceptions known by then picklable
    monkeypatch.delitem(copyreg.dispatch_table, Odd, raising=False)
    with pytest.raises(TypeError):
        pickle.loads(pickle.dumps(Odd("strange", 2)))
    with pytest.warns(RuntimeWarning, match="case 0 failed: RuntimeError: Odd: strange"):
        results = quiet(scenes[:1], AtOnce(), measure=raise_odd)
    assert "raise_odd" in results.errors[0].__notes__[-1]


def test_a_damaged_record_fails_its_case_only(scenes, tmp_path):
    (tmp_path / "1.h5").write_bytes(b"not a record")
    with pytest.warns(RuntimeWarning, match="case 1 failed: RecordError"):
        results = quiet(scenes, AtOnce(), folder=tmp_path)
    assert list(results.errors) == [1]
    assert (tmp_path / "1.h5").read_bytes() == b"not a record"


def test_processes(scenes, tmp_path):
    """The default executor: two processes, same results as in this one; errors are returned."""
    here = quiet(scenes, AtOnce(), folder=tmp_path / "here", every=EVERY)
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "2.h5").write_bytes(b"not a record")
    options = {"workers": 2, "measure": attrgetter("times", "provenance")}
    with pytest.warns(RuntimeWarning, match="case 2 failed: RecordError"):
        there = quiet(scenes, folder=tmp_path / "there", every=EVERY, **options)
    assert list(there.errors) == [2]
    for i in range(2):
        times, provenance = there[i]
        assert times.tobytes() == here[i].times.tobytes()
        assert provenance["threads"] == 1
        with gr.open(there.paths[i]) as record:
            assert stored(record) == stored(here[i])


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_signal_stops_processes_and_leaves_valid_records(small_scene, tmp_path, number):
    """Only the parent receives the signal, as in a notebook; its processes stop at once."""
    scene = small_scene("walls", 2, PLAIN, E=1e6).replace(duration=1e4)
    (tmp_path / "scene.json").write_text(scene.to_json())
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent("""
            import granular as gr

            if __name__ == "__main__":
                scene = gr.Scene.from_json(open("scene.json").read())
                cases = [scene, scene.replace(seed=1), scene.replace(seed=2)]
                gr.sweep(cases, folder="records", every=10.0, workers=2, progress=False)
        """)
    )
    paths = [Path(p).resolve() for p in sys.path if p]
    found = os.pathsep.join(map(str, [ROOT, *paths] if ROOT in paths else paths))
    process = subprocess.Popen(
        [sys.executable, "-W", "ignore", script],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": found},
        stderr=subprocess.PIPE,
        text=True,
    )
    parts = [tmp_path / "records" / f"{i}.h5.parts" for i in range(2)]
    try:
        deadline = time.monotonic() + 60
        while not all(any(path.glob("*.restart")) for path in parts) and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        process.send_signal(number)
        # including those of the processes, which share stderr
        _, errors = process.communicate(timeout=15)
    finally:
        process.kill()
    assert process.returncode == -number, errors
    if number == signal.SIGINT:
        assert errors.rstrip().endswith("KeyboardInterrupt")
    for i in range(2):
        with gr.open(tmp_path / "records" / f"{i}.h5") as record:
            assert not record.damage()
            assert len(record.times) >= 1
        sim = gr.Simulation.resume(tmp_path / "records" / f"{i}.h5", threads=1)
        sim.run(sim.time + 0.01)  # no process holds the record
    assert not list((tmp_path / "records").glob("2.h5*"))


def test_progress_is_shown_in_cases(scenes, capsys):
    gr.sweep(scenes, AtOnce())
    assert "3/3" in capsys.readouterr().err
    quiet(scenes, AtOnce())
    assert capsys.readouterr().err == ""


def test_beverloo_of_a_sweep():
    """The example of the design document: discharge rates straight from a sweep."""
    soft = gr.materials.glass_beads.replace(E=1e5)
    silos = [
        gr.scenes.silo(orifice=D, cell=0.05, material=soft).replace(duration=1.5)
        for D in (0.2, 0.3)
    ]
    with ThreadPoolExecutor(2) as pool:
        fit = gr.measure.beverloo(gr.sweep(silos, pool, every=0.02, progress=False))
    assert list(fit.orifices) == [0.2, 0.3]
    assert np.all(fit.rates > 0)


@pytest.mark.parametrize(
    ("cases", "error", "message"),
    [
        (7, TypeError, "cases = 7 must be an iterable of Scene"),
        ("silo", TypeError, "cases = 'silo' must be an iterable of Scene"),
        ([], ValueError, "must hold at least one Scene"),
        ([None], TypeError, r"cases\[0\] = None must be a Scene"),
        ({"a": 1}, TypeError, r"cases\['a'\] = 1 must be a Scene"),
    ],
)
def test_bad_cases(cases, error, message):
    with pytest.raises(error, match=message):
        gr.sweep(cases, AtOnce())


UNSAFE = ("", ".", "..", "a/b", "../a", "a\\b", "a b", "a\0", "a\n", "é", ".x", "x" * 201)


def test_keys_that_make_no_file_or_the_same_are_refused(scenes, tmp_path):
    for key in UNSAFE:
        with pytest.raises(ValueError, match="of cases must make a file name"):
            gr.sweep({key: scenes[0]}, AtOnce(), folder=tmp_path)
        assert not os.listdir(tmp_path)
    for one, other in (("1", 1), ("A", "a"), ((1, 2), "1_2")):
        with pytest.raises(ValueError, match="makes the file name of"):
            gr.sweep({one: scenes[0], other: scenes[1]}, AtOnce())
    for key in (None, (), (1, None), 1j):
        with pytest.raises(TypeError, match="must be a string, a number or a tuple"):
            gr.sweep({key: scenes[0]}, AtOnce())


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"executor": object()}, TypeError, "executor = .* must have a method submit"),
        ({"workers": 0}, ValueError, "workers = 0 must be an integer >= 1"),
        ({"workers": 2.0}, TypeError, "workers = 2.0 must be an integer >= 1"),
        ({"executor": AtOnce(), "workers": 2}, ValueError, "workers = 2 must be None"),
        ({"measure": 3}, TypeError, "measure = 3 must be callable"),
        ({"measure": lambda record: 1}, TypeError, "measure = .* must be picklable"),
        ({"hooks": (ThirdFrame(), 3)}, TypeError, r"hooks\[1\] = 3 must be callable"),
        ({"hooks": (lambda sim: 1,)}, TypeError, r"hooks\[0\] = .* must be picklable"),
        ({"checkpoint_minutes": 0.0}, ValueError, "checkpoint_minutes = 0.0 must be"),
        ({"wall_forces": 1}, TypeError, "wall_forces = 1 must be"),
        ({"every": 0.0}, ValueError, "every = 0.0 must be"),
        ({"folder": 3}, TypeError, "folder = 3 must be a path"),
        ({"folder": __file__}, NotADirectoryError, "must be a folder"),
    ],
)
def test_bad_options(scenes, options, error, message, monkeypatch):
    monkeypatch.setattr(sweeping, "run_case", None)  # nothing runs
    with pytest.raises(error, match=message):
        gr.sweep(scenes, **options)


def test_an_executor_without_futures_is_refused(scenes):
    class Wrong:
        def submit(self, function, /, *arguments):
            return 1

    with pytest.raises(TypeError, match=r"returned 1, must be a concurrent\.futures\.Future"):
        quiet(scenes, Wrong())


def test_a_measure_typed_into_a_session_is_refused():
    """Spawned processes could not import it, and the pool would break."""
    code = """
        import granular as gr
        def measure(record): return 1
        try:
            gr.sweep([gr.scenes.silo()], measure=measure)
        except TypeError as error:
            print(error)
    """
    done = subprocess.run(
        [sys.executable, "-"],
        input=textwrap.dedent(code),
        env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert "must be in a module that the workers can import" in done.stdout, done.stderr


def test_records_of_another_sweep_are_refused(scenes, tmp_path):
    quiet(scenes[:2], AtOnce(), folder=tmp_path)
    executor = AtOnce()
    with pytest.raises(ValueError, match=r"case 0: the record .*0\.h5 is of another scene"):
        quiet(scenes[::-1], executor, folder=tmp_path)
    assert executor.calls == 0
