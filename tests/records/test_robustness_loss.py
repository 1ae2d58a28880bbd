"""Runs are never lost: processes killed, disks full, attempts to overwrite records."""

import errno
import os
import random
import signal
import subprocess
from contextlib import nullcontext

import pytest
from processes import command
from records import (
    REMOVED,
    SCENE,
    abandon,
    close_interrupted,
    content,
    make_checkpoint,
    make_record,
    make_state,
    put,
)

from granular import open_trajectory
from granular.record import TrajectoryWriter


def expected(steps, checkpoint):
    frames = []
    for i in steps:
        state = make_state(i)
        fields = {k: a.tobytes() for k, a in state.fields.items()}
        frames.append((state.step, state.time, fields))
    return frames, checkpoint


# --- kills -----------------------------------------------------------------------------------

CHILD = """
    import sys
    from records import SCENE, TrajectoryWriter, make_checkpoint, make_state
    writer = TrajectoryWriter(sys.argv[1], SCENE)
    for i in range(100000):
        writer.append(make_state(i))
        writer.checkpoint(make_checkpoint(i))
        print(i, flush=True)
        if i % 4 == 3:
            writer.close()
            writer = TrajectoryWriter.resume(sys.argv[1])
"""


def started(text, path):
    """A child process that writes to this record until it is killed."""
    return subprocess.Popen(command(text, path), stdout=subprocess.PIPE, text=True)


@pytest.mark.parametrize("stored", [True, False])
def test_kill_leaves_all_completed_frames(tmp_path, stored):
    """All frames that were appended are there, also those since the last checkpoint."""
    text = CHILD if stored else CHILD.replace("writer.checkpoint(make_checkpoint(i))", "pass")
    chance = random.Random(5)
    for trial in range(2 if stored else 1):
        path = tmp_path / f"{trial}.h5"
        child = started(text, path)
        for _ in range(chance.randint(1, 6)):
            last = int(child.stdout.readline())
        with pytest.raises(subprocess.TimeoutExpired):
            child.wait(chance.random() * 0.02)
        child.send_signal(signal.SIGKILL)
        rest = child.stdout.read().splitlines(keepends=True)
        last = max([last, *(int(line) for line in rest if line.endswith("\n"))])
        child.wait()
        child.stdout.close()
        frames, checkpoint = content(path)
        assert last + 1 <= len(frames) <= last + 2
        assert frames == expected(range(len(frames)), None)[0]
        assert checkpoint >= 10 * last if stored else checkpoint is None
        with TrajectoryWriter.resume(path) as writer:  # the lock was released when its holder ended
            writer.append(make_state(len(frames)))
        assert content(path) == expected(range(len(frames) + 1), checkpoint)
        assert sorted(p.name for p in tmp_path.iterdir()) == [f"{k}.h5" for k in range(trial + 1)]


def test_frames_that_a_loss_of_power_has_spoilt_are_made_again(tmp_path):
    """Columns since the last checkpoint may be missing though the log tells of them, or its end."""
    path = tmp_path / "a.h5"
    for lost in ("columns", "entry"):
        writer = TrajectoryWriter(path, SCENE, overwrite=True)
        put(writer, 0)
        end = writer._growing.data.stat().st_size
        for i in (1, 2, 3):
            writer.append(make_state(i))
        data, log = writer._growing.data, writer._growing._log
        abandon(writer)
        if lost == "columns":
            os.truncate(data, end + 800)
            with open_trajectory(path) as record:
                assert len(record) == 4 and len(record.damage()) == 3
        else:
            raw = log.read_bytes()
            log.write_bytes(raw[:-500] + bytes(500))
        with (
            pytest.warns(RuntimeWarning, match="log: its last entry")
            if lost == "entry"
            else nullcontext()
        ):
            again = TrajectoryWriter.resume(path)
        assert again.frames == (1 if lost == "columns" else 3)
        for i in (1, 2, 3):
            again.append(make_state(i))
        again.close()
        assert content(path) == expected(range(4), 0)


def test_kill_while_the_log_is_removed(tmp_path, monkeypatch):
    """Stop the removal of what is left after each of its steps in turn."""
    for survivors in range(REMOVED + 1):
        path = tmp_path / f"{survivors}.h5"
        close_interrupted(path, survivors, monkeypatch)
        assert content(path) == expected(range(4), 30)
        TrajectoryWriter.resume(path).close()
        assert content(path) == expected(range(4), 30)


# --- full disks ------------------------------------------------------------------------------


class Failing:
    """Function of `os` that fails at its k-th call and at all later ones."""

    def __init__(self, name, k, code):
        self.real, self.left, self.code, self.hit = getattr(os, name), k, code, False

    def __call__(self, *args, **kwargs):
        if self.left == 0:
            self.hit = True
            raise OSError(self.code, os.strerror(self.code))
        self.left -= 1
        return self.real(*args, **kwargs)


FAULTS = [
    ("write", errno.ENOSPC),
    ("fsync", errno.EIO),
    ("ftruncate", errno.ENOSPC),
    ("replace", errno.EIO),
]


def fail_at_each(monkeypatch, name, code, prepare, act, check):
    """Let calls of ``os.name`` within ``act`` fail in turn; return the number of calls.

    Each of the first ten fails, and of those that follow, which are much alike, every eleventh.
    """
    hits = 0
    while True:
        subject = prepare(hits)
        fault = Failing(name, hits, code)
        error = None
        with monkeypatch.context() as patch:
            patch.setattr(os, name, fault)
            try:
                act(subject)
            except OSError as raised:
                error = raised
        if not fault.hit:
            assert error is None
            return hits
        assert error is not None, "the error was swallowed"
        assert error.errno == code
        check(subject)
        hits += 1 if hits < 10 else 11


def tree(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def no_temporaries(folder):
    return not [p for p in folder.rglob("*") if p.suffix == ".tmp"]


@pytest.mark.parametrize(("name", "code"), FAULTS)
def test_failed_append_and_checkpoint_keep_what_was(tmp_path, monkeypatch, name, code):
    def prepare(k):
        writer = TrajectoryWriter(tmp_path / f"{k}.h5", SCENE)
        writer.append(make_state(0))
        writer.checkpoint(make_checkpoint(0))
        return writer

    def act(writer):
        for i in (1, 2):
            writer.append(make_state(i))
        writer.checkpoint(make_checkpoint(2))

    def check(writer):
        assert no_temporaries(tmp_path)
        frames, checkpoint = content(writer.path)
        assert frames == expected(range(len(frames)), None)[0]
        assert checkpoint == (20 if len(frames) == 3 and checkpoint else 0)
        act(writer)  # there is space on the disk again
        writer.close()
        assert content(writer.path) == expected(range(3), 20)

    hits = fail_at_each(monkeypatch, name, code, prepare, act, check)
    assert hits >= (1 if name == "replace" else 2)


@pytest.mark.parametrize("act", ["resume", "close"])
@pytest.mark.parametrize(("name", "code"), FAULTS)
def test_a_failure_at_either_end_keeps_what_is_stored(tmp_path, monkeypatch, name, code, act):
    """Copying what a killed run has left may fail at each call, and so may the end of a run."""

    def prepare(k):
        folder = tmp_path / str(k)
        folder.mkdir()
        make_record(folder / "a.h5", 1)
        writer = TrajectoryWriter.resume(folder / "a.h5")
        writer.append(make_state(1))
        if act == "close":
            return writer
        abandon(writer)
        return folder / "a.h5"

    def check(subject):
        path = subject if act == "resume" else subject.path
        assert content(path) == expected(range(2), 0)
        assert no_temporaries(path.parent)
        (TrajectoryWriter.resume(path) if act == "resume" else subject).close()
        assert content(path) == expected(range(2), 0)
        assert [p.name for p in path.parent.iterdir()] == ["a.h5"]

    run = TrajectoryWriter.resume if act == "resume" else TrajectoryWriter.close
    hits = fail_at_each(monkeypatch, name, code, prepare, run, check)
    assert hits >= 1 or name == "ftruncate"


def test_close_may_be_repeated_after_a_full_disk(tmp_path, monkeypatch):
    path = tmp_path / "a.h5"
    writer = TrajectoryWriter(path, SCENE)
    writer.append(make_state(0))
    with monkeypatch.context() as patch:
        patch.setattr(os, "write", Failing("write", 3, errno.ENOSPC))
        with pytest.raises(OSError, match="No space left"):
            writer.close()
    writer.append(make_state(1))
    writer.close()
    assert content(path) == expected(range(2), None)


@pytest.mark.parametrize("start", ["new", "overwrite", "resume"])
@pytest.mark.parametrize(("name", "code"), FAULTS)
def test_failed_start_changes_nothing(tmp_path, monkeypatch, name, code, start):
    def prepare(k):
        path = tmp_path / f"{k}.h5"
        if start != "new":
            make_record(path)
        return path

    def act(path):
        if start == "resume":
            TrajectoryWriter.resume(path)
        else:
            TrajectoryWriter(path, SCENE, overwrite=start == "overwrite")

    def check(path):
        assert no_temporaries(tmp_path)
        if start == "new":
            assert not path.exists()
            with pytest.raises(FileNotFoundError):
                open_trajectory(path)
            TrajectoryWriter(path, SCENE).close()
        else:
            assert content(path) == expected(range(3), 20)

    fail_at_each(monkeypatch, name, code, prepare, act, check)


def test_short_writes_are_continued(tmp_path, monkeypatch):
    real = os.write
    monkeypatch.setattr(os, "write", lambda fd, data: real(fd, data[: max(1, len(data) // 3)]))
    make_record(tmp_path / "a.h5")
    assert content(tmp_path / "a.h5") == expected(range(3), 20)


# --- nothing is overwritten ------------------------------------------------------------------


def test_existing_records_are_refused(tmp_path):
    path = tmp_path / "a.h5"
    make_record(path)
    before = path.read_bytes()
    with pytest.raises(FileExistsError, match=r"a\.h5 exists already"):
        TrajectoryWriter(path, SCENE)
    assert path.read_bytes() == before
    unfinished = TrajectoryWriter(tmp_path / "b.h5", SCENE)
    unfinished.append(make_state(0))
    abandon(unfinished)
    with pytest.raises(FileExistsError, match="unfinished: resume it"):
        TrajectoryWriter(tmp_path / "b.h5", SCENE)
    with pytest.raises(IsADirectoryError):
        TrajectoryWriter(tmp_path, SCENE, overwrite=True)


def test_overwritten_file_stays_until_the_new_one_is_closed(tmp_path):
    path = tmp_path / "a.h5"
    make_record(path)
    before = path.read_bytes()
    writer = TrajectoryWriter(path, SCENE, overwrite=True)
    assert content(path) == expected(range(3), 20)  # nothing to show yet
    writer.append(make_state(5))
    assert path.read_bytes() == before
    assert content(path) == expected([5], None)
    writer.close()
    assert content(path) == expected([5], None)


def test_overwriting_with_nothing_keeps_the_file(tmp_path):
    make_record(tmp_path / "a.h5")
    TrajectoryWriter(tmp_path / "a.h5", SCENE, overwrite=True).close()
    assert content(tmp_path / "a.h5") == expected(range(3), 20)


def test_a_foreign_file_is_overwritten_only_when_asked(tmp_path):
    path = tmp_path / "a.h5"
    path.write_text("my notes")
    with pytest.raises(FileExistsError):
        TrajectoryWriter(path, SCENE)
    writer = TrajectoryWriter(path, SCENE, overwrite=True)
    writer.append(make_state(0))
    assert content(path) == expected([0], None)
    assert path.read_text() == "my notes"
    writer.close()
    assert content(path) == expected([0], None)


def test_impossible_folders_are_refused_before_the_run(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in ("missing", "file"):
        with pytest.raises(OSError, match=folder):
            TrajectoryWriter(tmp_path / folder / "a.h5", SCENE)


def test_a_live_record_cannot_be_written_twice(tmp_path):
    path = tmp_path / "a.h5"
    writer = TrajectoryWriter(path, SCENE)
    writer.append(make_state(0))
    with pytest.raises(BlockingIOError, match="live run"):
        TrajectoryWriter.resume(path)
    with pytest.raises(BlockingIOError, match="live run"):
        TrajectoryWriter(path, SCENE, overwrite=True)
    writer.append(make_state(1))
    writer.close()
    assert content(path) == expected(range(2), None)
