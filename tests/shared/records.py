"""Records made by hand, for tests that damage, kill or overwrite them."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np

from granular import open_trajectory
from granular.record import Checkpoint, TrajectoryWriter

SCENE = SimpleNamespace(to_json=lambda: '{"name": "heap"}')


def make_state(i, n=40):
    rng = np.random.default_rng(i)
    fields = {
        "x": rng.random((n, 2)),
        "v": rng.normal(size=(n, 2)),
        "stress": rng.normal(size=(n, 4)),
        "mass": np.full(n, 0.25),
        "id": np.arange(n),
    }
    return SimpleNamespace(time=0.1 * i, step=10 * i, dt=1e-4, fields=fields)


def make_checkpoint(i):
    arrays = {"x": np.random.default_rng(i).random((2, 50)), "offsets": np.arange(9)}
    return Checkpoint(time=0.1 * i, step=10 * i, dt=1e-4, scalars={"lost": i}, arrays=arrays)


def make_record(path, frames=3):
    with TrajectoryWriter(path, SCENE) as writer:
        for i in range(frames):
            writer.append(make_state(i))
        writer.checkpoint(make_checkpoint(frames - 1))


def content(path):
    """Steps, times and bytes of all frames, and the step of the checkpoint: what a reader finds."""
    with open_trajectory(path) as record:
        frames = [
            (f.step, f.time, {k: a.tobytes() for k, a in f.read().items()})
            for frame in record._contents.frames
            for f in frame.each()
        ]
        checkpoint = record.checkpoint().step if record._contents.has_checkpoint else None
    return frames, checkpoint


def put(writer, i):
    """Add a frame and its checkpoint."""
    writer.append(make_state(i))
    writer.checkpoint(make_checkpoint(i))


def abandon(writer):
    """Let go of a record as the end of the process does, which leaves it unfinished."""
    writer._let_go()


def close_interrupted(path, survivors, monkeypatch):
    """Close a record of four frames; the removal of what is left is cut off after `survivors`."""
    writer = TrajectoryWriter(path, SCENE)
    for i in range(4):
        writer.append(make_state(i))
    writer.checkpoint(make_checkpoint(3))
    left, unlink = survivors, Path.unlink

    def cut(target, **options):
        nonlocal left
        if not left:
            raise KeyboardInterrupt
        left -= 1
        unlink(target, **options)

    interrupted = False
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", cut)
        try:
            writer.close()
        except KeyboardInterrupt:
            interrupted = True
    assert interrupted == (survivors < REMOVED)


REMOVED = 2
"""Number of files that remain to be removed once the file has its name: log and checkpoint."""


def unfinished(path, gas=0):
    """An unfinished record whose frames hold this number of gas particles."""
    writer = TrajectoryWriter(path, SCENE)
    for i in range(2):
        others = {"gas": make_state(i + 5, n=gas - i).fields} if gas else {}
        writer.append(make_state(i, n=12), others=others)
    writer.checkpoint(make_checkpoint(1))
    return writer
