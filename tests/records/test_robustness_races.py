"""Several runs on one record: one writes it, the others are told so, and nothing is lost."""

import json
import os
import shutil
import subprocess
import time

import numpy as np
import pytest
from processes import command
from records import REMOVED, SCENE, close_interrupted, content, make_record, make_state, put

from granular import open_trajectory
from granular.record import RecordError, TrajectoryWriter
from granular.record.index import parts_folder

RACER = """
    import json, sys, time
    from records import SCENE, TrajectoryWriter, make_checkpoint, make_state

    def begin(path, kind):
        if kind == "resume":
            return TrajectoryWriter.resume(path)
        return TrajectoryWriter(path, SCENE, overwrite=kind == "overwrite")

    for line in sys.stdin:
        path, kind, at, first = json.loads(line)
        time.sleep(max(at - time.time(), 0))
        started = time.time()
        try:
            writer = begin(path, kind)
        except Exception as error:
            told = type(error).__name__, str(error), time.time() - started
            print(json.dumps(told), flush=True)
            continue
        print(json.dumps(("won", "", time.time() - started)), flush=True)
        sys.stdin.readline()  # all have tried
        for i in (first, first + 1):
            writer.append(make_state(i))
            writer.checkpoint(make_checkpoint(i))
        writer.close()
        print("closed", flush=True)
"""


def killed(path, frames=2):
    """Leave at this path what a process leaves that is killed after so many frames."""
    other = path.with_name("other.h5")
    writer = TrajectoryWriter(other, SCENE)
    for i in range(frames):
        put(writer, i)
    shutil.copytree(parts_folder(other), parts_folder(path))
    writer.close()
    other.unlink(missing_ok=True)


@pytest.fixture(scope="module")
def racers():
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    processes = [subprocess.Popen(command(RACER), **pipes) for _ in range(3)]
    yield processes
    for process in processes:
        process.stdin.close()
        process.wait()
        process.stdout.close()


def tell(process, text):
    process.stdin.write(text + "\n")
    process.stdin.flush()


def race(racers, path, kind, first):
    """Let these processes begin at one moment; return what the losers were told."""
    line = json.dumps((str(path), kind, time.time() + 0.01, first))
    for process in racers:
        tell(process, line)
    told = [json.loads(process.stdout.readline()) for process in racers]
    winners = [p for p, (name, *_) in zip(racers, told, strict=True) if name == "won"]
    for winner in winners:
        tell(winner, "")
    assert [winner.stdout.readline() for winner in winners] == ["closed\n"], told
    return [loser for loser in told if loser[0] != "won"]


ROUNDS = 2


@pytest.mark.parametrize("rounds", [ROUNDS, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("before", ["nothing", "finished", "killed"])
@pytest.mark.parametrize("count", [2, 3])
def test_one_of_those_that_begin_at_once_writes_the_record(tmp_path, racers, count, before, rounds):
    kinds = ["fresh"] if before == "nothing" else ["overwrite", "resume"]
    for k in range(rounds):
        path, kind = tmp_path / f"{k}.h5", kinds[k % len(kinds)]
        if before == "killed":
            killed(path)
        elif before == "finished":
            make_record(path, 2)
        first = 2 if kind == "resume" else 0
        for name, text, seconds in race(racers[:count], path, kind, first):
            assert name in ("BlockingIOError", "FileExistsError")
            assert path.name in text
            assert seconds < 1
        frames, checkpoint = content(path)
        assert [step for step, *_ in frames] == [10 * i for i in range(first + 2)]
        assert checkpoint == 10 * (first + 1)
        assert sorted(p.name for p in tmp_path.iterdir()) == [path.name]
        path.unlink()


def test_a_run_killed_before_its_first_frame_is_no_obstacle(tmp_path):
    path = tmp_path / "a.h5"
    killed(path, 0)
    assert parts_folder(path).is_dir()
    make_record(path)
    assert len(content(path)[0]) == 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h5"]


def test_a_refused_run_touches_nothing(tmp_path):
    path = tmp_path / "a.h5"
    writer = TrajectoryWriter(path, SCENE)
    writer.append(make_state(0))
    before = {p: p.read_bytes() for p in parts_folder(path).iterdir()}
    for overwrite in (False, True):
        with pytest.raises(BlockingIOError, match="live run"):
            TrajectoryWriter(path, SCENE, overwrite=overwrite)
    with pytest.raises(BlockingIOError, match="live run"):
        TrajectoryWriter.resume(path)
    assert {p: p.read_bytes() for p in parts_folder(path).iterdir()} == before
    writer.close()
    with pytest.raises(FileExistsError, match="exists already"):
        TrajectoryWriter(path, SCENE)
    with pytest.raises(FileNotFoundError):
        TrajectoryWriter.resume(tmp_path / "none.h5")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h5"]


# --- readers of a record that is being written ----------------------------------------------


def same_frames(record, steps):
    for frame, i in zip(record._frames, steps, strict=True):
        fields = record._contents.read(frame)
        assert {k: a.tobytes() for k, a in fields.items()} == {
            k: a.tobytes() for k, a in make_state(i).fields.items()
        }


def test_a_reader_goes_on_when_the_record_is_closed_and_resumed(tmp_path):
    path = tmp_path / "a.h5"
    writer = TrajectoryWriter(path, SCENE)
    for i in range(3):
        put(writer, i)
    with open_trajectory(path) as record:
        part = record[1:]
        assert not record.finished
        put(writer, 3)
        writer.close()
        same_frames(record, range(3))
        same_frames(part, range(1, 3))
        assert record.finished
        assert record.checkpoint().step == 30
        with TrajectoryWriter.resume(path) as writer:
            put(writer, 4)
            same_frames(record, range(3))
        same_frames(record, range(3))


RUN = """
    import sys
    import granular as gr

    def wait(sim):
        if 0.015 < sim.time < 0.025:
            print("third frame", flush=True)
            sys.stdin.readline()

    scene = gr.scenes.column_collapse(aspect=1.0, E=1e5, cell=0.05, points_per_cell=4)
    sim = gr.Simulation(scene, threads=1)
    sim.run(until=0.05, save=sys.argv[1], every=0.01, hooks=[wait], fields=["pressure"])
"""


def test_a_record_is_read_while_another_process_writes_it(tmp_path):
    path = tmp_path / "a.vtkhdf"
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command(RUN, path), **pipes) as run:
        assert run.stdout.readline() == "third frame\n"
        assert not path.exists()  # other programs see the whole file or none
        deadline = time.monotonic() + 10  # a frame is stored within a second
        while len(early := open_trajectory(path)) < 2 and time.monotonic() < deadline:
            early.close()
            time.sleep(0.05)
        assert not early.finished and early.damage() == []
        before = [state.pressure for state in early]
        tell(run, "")
        assert run.wait(60) == 0
    with early, open_trajectory(path) as whole:
        assert whole.finished and len(whole) == 6 > len(early) >= 2
        assert early.damage() == [] and early.finished
        for state, again, pressure in zip(whole, early, before, strict=False):
            assert state.time == again.time
            assert np.array_equal(state.fields["pressure"], pressure)
            assert np.array_equal(again.pressure, pressure)


def test_a_reader_is_told_of_a_frame_that_is_replaced(tmp_path):
    path = tmp_path / "a.h5"
    with TrajectoryWriter(path, SCENE) as writer:
        writer.append(make_state(0))
    with TrajectoryWriter.resume(path) as writer:
        writer.append(make_state(1))
        record = open_trajectory(path)
    with TrajectoryWriter.resume(path) as writer, record:
        other = make_state(1, n=33)
        other.step = 10
        writer.append(make_state(0))
        writer.append(other)  # in place of frame 1
        assert record._contents.read(record._contents.frames[0])
        with pytest.raises(RecordError, match=r"a\.h5: the frame of step 10 is there no longer"):
            record._contents.read(record._contents.frames[1])


# --- files that appear, move or are protected ------------------------------------------------


@pytest.mark.parametrize("kind", ["fresh", "overwrite", "resume"])
@pytest.mark.parametrize("how", ["record", "text"])
def test_a_file_that_appears_during_a_run_is_kept(tmp_path, kind, how):
    path, other = tmp_path / "a.h5", tmp_path / "other.h5"
    if kind != "fresh":
        make_record(path, 2)
    if kind == "resume":
        writer = TrajectoryWriter.resume(path)
    else:
        writer = TrajectoryWriter(path, SCENE, overwrite=kind == "overwrite")
    put(writer, 4)
    make_record(other, 3) if how == "record" else other.write_text("my notes")
    given = other.read_bytes()
    path.write_bytes(given)
    for act in (writer.close, lambda: open_trajectory(path), lambda: TrajectoryWriter.resume(path)):
        with pytest.raises(FileExistsError, match=r"a\.h5"):
            act()
        assert path.read_bytes() == given
    path.rename(tmp_path / "moved")
    writer.append(make_state(5))
    writer.close()
    first = [0, 10] if kind == "resume" else []
    assert [step for step, *_ in content(path)[0]] == [*first, 40, 50]


def test_a_finished_record_moved_onto_an_unfinished_one_is_kept(tmp_path):
    path = tmp_path / "a.h5"
    killed(path)
    make_record(tmp_path / "b.h5", 3)
    os.replace(tmp_path / "b.h5", path)
    before = path.read_bytes()
    for act in (open_trajectory, TrajectoryWriter.resume):
        with pytest.raises(FileExistsError, match="move one of the two elsewhere"):
            act(path)
    assert path.read_bytes() == before
    path.rename(tmp_path / "b.h5")
    TrajectoryWriter.resume(path).close()
    assert len(content(path)[0]) == 2
    assert len(content(tmp_path / "b.h5")[0]) == 3


def test_rot_after_an_interrupted_removal_is_reported(tmp_path, monkeypatch):
    """Files that a killed writer has left are not taken for the record."""
    for survivors in range(REMOVED + 1):
        path = tmp_path / f"{survivors}.h5"
        close_interrupted(path, survivors, monkeypatch)
        bad = bytearray(path.read_bytes())
        at = bytes(bad).index(b"OHDR", 100)  # metadata, which have a checksum
        bad[at + 8] ^= 1
        path.write_bytes(bad)
        for act in (open_trajectory, TrajectoryWriter.resume):
            with pytest.raises((RecordError, FileExistsError), match=path.name):
                act(path)
        assert path.read_bytes() == bad


def test_a_symbolic_link_is_followed(tmp_path):
    (tmp_path / "disk").mkdir()
    target, link = tmp_path / "disk" / "run.h5", tmp_path / "a.h5"
    link.symlink_to(target)
    make_record(link, 2)
    assert link.is_symlink()
    with TrajectoryWriter.resume(link) as writer:
        put(writer, 2)
        with pytest.raises(BlockingIOError):
            TrajectoryWriter.resume(target)
        assert content(link) == content(target)
    make_record_over = TrajectoryWriter(link, SCENE, overwrite=True)
    with make_record_over:
        for i in range(4):
            make_record_over.append(make_state(i))
    assert link.is_symlink() and len(content(target)[0]) == 4
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["a.h5", "disk", "run.h5"]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o444])
@pytest.mark.parametrize("kind", ["overwrite", "resume"])
def test_permissions_are_kept(tmp_path, mode, kind):
    path = tmp_path / "a.h5"
    make_record(path)
    path.chmod(mode)
    if kind == "resume":
        writer = TrajectoryWriter.resume(path)
    else:
        writer = TrajectoryWriter(path, SCENE, overwrite=True)
    with writer:
        writer.append(make_state(3))
        assert not parts_folder(path).stat().st_mode & 0o077 & ~(mode | mode >> 2 | mode << 2)
        if mode == 0o600:
            assert not parts_folder(path).stat().st_mode & 0o077
    assert path.stat().st_mode & 0o777 == mode
