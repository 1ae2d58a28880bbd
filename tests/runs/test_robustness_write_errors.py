"""A run that could not write goes on in the same object, and its record loses nothing."""

import copy
import errno
import os
import pickle
import random
from contextlib import suppress

import pytest

import granular as gr
from granular.record import TrajectoryWriter

OPERATIONS = ("write", "fsync", "ftruncate", "replace", "unlink", "open", "mkdir")
UNTIL, EVERY = 0.08, 0.02


class Disk:
    """Functions of `os` of which some calls fail with an OSError."""

    def __init__(self, patch, names, fails):
        self.count, self.hit, self.fails = 0, 0, fails
        for name in names:
            patch.setattr(os, name, self.failing(getattr(os, name)))

    def failing(self, real):
        def call(*args, **kwargs):
            if self.fails(self.count):
                self.count, self.hit = self.count + 1, self.hit + 1
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            self.count += 1
            return real(*args, **kwargs)

        return call


@pytest.fixture
def scene(small_scene):
    return small_scene("walls", 2, ("linear", "flip", "particle"), E=1e5)


def stored(path):
    """Steps, digests and samples of all frames, and digest of the checkpoint."""
    with gr.open(path) as record:
        assert not record.damage()
        frames = [(f.step, f.mark, repr(dict(f.samples))) for f in record._contents.frames]
        return record.finished, frames, record.checkpoint().digest


def start(sim, path, before):
    """Run a new simulation, or one whose record had to be resumed."""
    return sim.run(UNTIL, every=EVERY, **({} if before == "resumed" else {"save": path}))


def prepared(scene, path, before):
    if before == "new":
        return gr.Simulation(scene, threads=1)
    gr.Simulation(scene, threads=1).run(0.03, save=path, every=EVERY)
    if before == "resumed":
        return gr.Simulation.resume(path, threads=1)
    path.unlink()
    return gr.Simulation(scene, threads=1)


def go_on(sim, path):
    """Run as a user does who has freed the disk."""
    return sim.run(UNTIL, every=EVERY, **({} if sim.record else {"save": path}))


def attempt(patch, sim, path, before, names, fails):
    """Run while some calls fail; return the number of calls and of those that failed."""
    with patch.context() as patched:
        disk = Disk(patched, names, fails)
        try:
            start(sim, path, before)
        except OSError as error:
            assert error.errno == errno.ENOSPC
    return disk.count, disk.hit


QUICK = [
    (name, before, before == "new", 2)
    for name in ("write", "fsync", "replace")
    for before in ("new", "resumed")
]
LONG = [
    pytest.param(name, before, lasting, None, marks=pytest.mark.slow)
    for name in OPERATIONS
    for before in ("new", "resumed")
    for lasting in (False, True)
]


@pytest.mark.parametrize(("name", "before", "lasting", "tries"), QUICK + LONG)
def test_a_run_goes_on_after_each_error(scene, tmp_path, monkeypatch, name, before, lasting, tries):
    whole = tmp_path / "whole.h5"
    sim = prepared(scene, whole, before)
    calls, _ = attempt(monkeypatch, sim, whole, before, [name], lambda i: False)
    for k in range(calls // 3, calls, max(calls // tries, 1)) if tries else range(calls):
        path = tmp_path / f"{k}.h5"
        sim = prepared(scene, path, before)
        _, hit = attempt(
            monkeypatch, sim, path, before, [name], lambda i, k=k: i >= k if lasting else i == k
        )
        assert hit
        go_on(sim, path)
        assert stored(path) == stored(whole)
        assert not (tmp_path / f"{k}.h5.parts").exists()
        with TrajectoryWriter.resume(path):  # the lock is free, while `sim` is still there
            pass
        path.unlink()


@pytest.mark.parametrize("rounds", [4, pytest.param(300, marks=pytest.mark.slow)])
def test_a_run_goes_on_after_many_errors(scene, tmp_path, monkeypatch, rounds):
    """Errors of all kinds at random, also while the consequences of earlier ones are handled."""
    whole, chance = tmp_path / "whole.h5", random.Random(3)
    start(prepared(scene, whole, "new"), whole, "new")
    for k in range(rounds):
        path, share = tmp_path / f"{k}.h5", chance.choice([0.003, 0.03, 0.3])
        sim = prepared(scene, path, "new")
        for _ in range(5):
            with monkeypatch.context() as patched:
                Disk(patched, OPERATIONS, lambda i, s=share: chance.random() < s)
                with suppress(OSError):
                    go_on(sim, path)
        go_on(sim, path)
        assert stored(path) == stored(whole)
        path.unlink()


def test_a_full_disk_is_left_for_another(scene, tmp_path, monkeypatch):
    """The record on the full disk can be resumed, and the other one goes on from here."""
    path, other = tmp_path / "a.h5", tmp_path / "b.h5"
    sim = gr.Simulation(scene, threads=1)
    attempt(monkeypatch, sim, path, "new", ["write"], lambda i: i > 35)
    left = sim.time
    assert 0 < left < UNTIL
    sim.run(UNTIL, save=other, every=EVERY)
    with gr.open(other) as record:
        assert record.times[0] >= left and record.finished
    gr.Simulation.resume(path, threads=1).run(UNTIL)
    whole = tmp_path / "whole.h5"
    gr.Simulation(scene, threads=1).run(UNTIL, save=whole, every=EVERY)
    assert stored(path) == stored(whole)


def test_a_record_that_went_on_elsewhere_is_not_touched(scene, tmp_path, monkeypatch):
    path = tmp_path / "a.h5"
    sim = gr.Simulation(scene, threads=1)
    attempt(monkeypatch, sim, path, "new", ["write"], lambda i: i > 35)
    gr.Simulation.resume(path, threads=1).run(UNTIL)
    before = path.read_bytes()
    with pytest.raises(FileExistsError, match="written by another run"):
        sim.run(UNTIL)
    assert path.read_bytes() == before


# --- frames of a run that goes on -------------------------------------------------------------


def test_a_frame_is_stored_while_a_hook_runs(scene, tmp_path):
    path, found = tmp_path / "a.h5", []

    def hook(sim):
        with gr.open(path) as record:
            found.append((record.series["step"][-1] - sim.steps, record.damage()))

    gr.Simulation(scene, threads=1).run(0.05, save=path, every=EVERY, hooks=(hook,))
    assert found == [(0, [])] * 4


# ---- hooks and copies ----


def runs_on(sim, path):
    sim.run(2 * UNTIL, save=path.with_name("other.h5"))


def resumes(sim, path):
    gr.Simulation.resume(path).run(2 * UNTIL)


@pytest.mark.parametrize(
    ("act", "kind", "message"),
    [
        (runs_on, RuntimeError, "run: .* has called the hook test_a_hook.*, which may read it"),
        (lambda sim, path: sim.step(3), RuntimeError, "step: .* step a copy"),
        (resumes, BlockingIOError, "written by a live run"),
    ],
)
def test_a_hook_that_runs_its_simulation_is_refused(scene, tmp_path, act, kind, message):
    """It ends the run as any exception of a hook does; all is whole, and the run can go on."""
    path, calls = tmp_path / "a.h5", []

    def hook(sim):
        calls.append(sim.steps)
        if len(calls) == 3:
            act(sim, path)

    sim = gr.Simulation(scene, threads=1)
    with pytest.raises(kind, match=message):
        sim.run(UNTIL, every=EVERY, save=path, hooks=(hook,))
    assert not path.with_name("other.h5").exists() and sim.record == path
    sim.run(UNTIL)
    gr.Simulation(scene, threads=1).run(UNTIL, every=EVERY, save=tmp_path / "b.h5")
    assert stored(path) == stored(tmp_path / "b.h5")


def test_hooks_may_run_another_simulation_and_look_at_all(scene, tmp_path):
    path, other = tmp_path / "a.h5", tmp_path / "other.h5"

    def hook(sim):
        sim.health(), sim.state, sim.checkpoint(), sim.buffers
        gr.Simulation(scene, threads=1).run(EVERY, save=other, overwrite=True)
        gr.Simulation.from_checkpoint(scene, sim.checkpoint()).step(2)
        with gr.open(path) as record:
            assert record.series["step"][-1] == sim.steps

    gr.Simulation(scene, threads=1).run(UNTIL, every=EVERY, save=path, hooks=(hook,))
    gr.Simulation(scene, threads=1).run(UNTIL, every=EVERY, save=tmp_path / "b.h5")
    assert stored(path) == stored(tmp_path / "b.h5")


@pytest.mark.parametrize("act", [copy.copy, copy.deepcopy, pickle.dumps])
def test_what_owns_a_resource_cannot_be_copied(scene, tmp_path, act):
    """A copy would share it in silence: two simulations would step the same points."""
    sim = gr.Simulation(scene, threads=1).run(EVERY, save=tmp_path / "a.h5")
    with pytest.raises(TypeError, match=r"a Simulation cannot be copied .*from_checkpoint"):
        act(sim)
    with (
        gr.open(tmp_path / "a.h5") as record,
        pytest.raises(TypeError, match=r"a Trajectory cannot be copied .* open the record again"),
    ):
        act(record)
    with (
        TrajectoryWriter(tmp_path / "b.h5", scene) as writer,
        pytest.raises(TypeError, match="a TrajectoryWriter cannot be copied"),
    ):
        act(writer)
    with pytest.raises(TypeError, match=r"cannot pickle 'granular\._core\.Engine'"):
        act(sim._engine)
    act(sim.checkpoint()), act(sim.state), act(sim.health()), act(scene)
