"""Checkpoints that are kept beside a record, and runs that begin with them."""

import numpy as np
import pytest

import granular as gr
from granular import scenes


@pytest.fixture
def record(tmp_path):
    """Record of eleven frames, with the checkpoint of every fourth."""
    scene = scenes.column_collapse(aspect=1.0, cell=0.05, E=1e5)
    path = tmp_path / "a.h5"
    gr.Simulation(scene, threads=1).run(until=0.1, save=path, every=0.01, checkpoints=4)
    return path


def test_a_run_begins_with_any_frame_that_was_kept(record):
    with gr.open(record) as states:
        assert len(states) == 11 and states.checkpoint_frames == [0, 4, 8]
        last, times, fourth = states[-1], list(states.times), states[4].time
    sim = gr.Simulation.resume(record, frame=4, threads=1)
    assert sim.time == fourth
    sim.run(until=0.1)
    assert np.array_equal(sim.state.x, last.x) and np.array_equal(sim.state.stress, last.stress)
    with gr.open(record) as states:  # nothing was stored twice
        assert list(states.times) == times and states.checkpoint_frames == [0, 4, 8]


def test_frames_keep_their_numbers_in_a_run_that_goes_on(record):
    gr.Simulation.resume(record, threads=1).run(until=0.16, checkpoints=4)
    with gr.open(record) as states:
        assert len(states) == 17 and states.checkpoint_frames == [0, 4, 8, 12, 16]


def test_other_frames_follow_a_change(record):
    with gr.open(record) as states:
        scene = states.scene
    tilted = scene.replace(gravity=gr.Gravity((0.0,), ((3.0, -9.0),)))
    sim = gr.Simulation.resume(record, frame=-3, scene=tilted, threads=1)
    branch = record.with_name("b.h5")
    sim.run(until=0.12, save=branch, checkpoints="all")
    with gr.open(branch) as states, gr.open(record) as before:
        assert states.checkpoint_frames == list(range(len(states)))
        assert before.times[8] < states.times[0] < before.times[9] + 0.01 and len(before) == 11


def test_without_a_checkpoint_a_frame_is_refused(record):
    stored = "frame = 3 must be one of those stored: [0, 4, 8]"
    for frame, named in ((3, stored), (11, "frame = 11")):
        with pytest.raises(ValueError) as error:
            gr.Simulation.resume(record, frame=frame)
        assert named in str(error.value)
    with pytest.raises(ValueError, match="checkpoints = 0"):
        gr.Simulation.resume(record).run(until=0.2, checkpoints=0)
    with pytest.raises(ValueError, match="checkpoints = 'some' must be one of 'all'"):
        gr.Simulation.resume(record).run(until=0.2, checkpoints="some")


def test_damage_is_found_and_a_new_record_forgets(record):
    files = sorted(record.with_name("a.h5.checkpoints").iterdir())
    assert len(files) == 3
    content = bytearray(files[1].read_bytes())
    content[-100] ^= 1
    files[1].write_bytes(content)
    with pytest.raises(gr.record.RecordError, match="does not match its digest"):
        gr.Simulation.resume(record, frame=4)
    with gr.open(record) as states:
        scene = states.scene
    gr.Simulation(scene, threads=1).run(until=0.02, save=record, overwrite=True)
    assert not files[0].parent.exists()
