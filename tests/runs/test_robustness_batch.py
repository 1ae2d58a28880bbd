"""Jobs of batch systems: time limits and signals leave a record that goes on exactly."""

import argparse
import signal
import subprocess
import sys
import time

import pytest
from same_bits import shown

import granular as gr
from granular.cli import main
from granular.cli.words import duration
from granular.record.index import parts_folder

COMMAND = [sys.executable, "-m", "granular"]
SCENE = ["column_collapse", "--cell", "0.02", "--E", "1e9", "--threads", "1"]  # takes a minute


def scene():
    return gr.scenes.column_collapse(cell=0.02, E=1e7)


def test_a_time_limit_ends_a_run_that_goes_on_exactly(tmp_path):
    path = tmp_path / "a.h5"
    sim = gr.Simulation(scene(), threads=1)
    begin = time.monotonic()
    sim.run(until=0.5, save=path, every=0.05, time_limit=0.02)  # 0.5 s need some 5000 steps
    assert time.monotonic() - begin < 5
    assert 0 < sim.time < 0.5
    resumed = gr.Simulation.resume(path)
    assert resumed.steps == sim.steps
    resumed.run(until=0.5)
    whole = gr.Simulation(scene(), threads=1).run(until=0.5)
    assert shown(resumed.state) == shown(whole.state)
    with pytest.raises(ValueError, match="time_limit = 0"):
        sim.run(time_limit=0)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGUSR1])
def test_a_signal_of_a_batch_system_is_as_ctrl_c(number, tmp_path):
    path = tmp_path / "a.h5"
    process = subprocess.Popen(
        [*COMMAND, "run", *SCENE, "-o", str(path), "--quiet"], stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 60
    while not list(parts_folder(path).glob("*.restart")) and time.monotonic() < deadline:
        time.sleep(0.02)
    time.sleep(0.1)
    process.send_signal(number)
    _, printed = process.communicate(timeout=60)
    assert process.returncode == 130, printed
    assert "interrupted at t" in printed
    assert "granular resume" in printed
    resumed = gr.Simulation.resume(path)
    assert 0 < resumed.steps
    assert resumed.time == gr.open(path).checkpoint().time


def test_a_handler_of_the_program_is_left_alone():
    """Its exception ends the run; after a run signals are as before."""
    before = signal.getsignal(signal.SIGUSR1)

    def handle(*_):
        raise ZeroDivisionError

    signal.signal(signal.SIGTERM, handle)
    sim = gr.Simulation(scene(), threads=1)
    try:
        with pytest.raises(ZeroDivisionError):
            sim.run(until=0.1, hooks=(lambda _: signal.raise_signal(signal.SIGTERM),))
        assert signal.getsignal(signal.SIGTERM) is handle
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with pytest.raises(KeyboardInterrupt, match="SIGUSR1"):
        sim.run(until=0.2, every=0.05, hooks=(lambda _: signal.raise_signal(signal.SIGUSR1),))
    assert signal.getsignal(signal.SIGUSR1) == before == signal.SIG_DFL
    sim.step(1)


def test_the_command_says_that_a_run_is_unfinished(tmp_path, capsys):
    path = str(tmp_path / "a.h5")
    assert main(["run", *SCENE, "-o", path, "--quiet", "--time-limit", "1s"]) == 4
    assert "time limit reached at t" in capsys.readouterr().err
    assert main(["resume", path, "--quiet", "--time-limit", "1"]) == 4


def test_durations():
    wanted = {"3h50m": 13800, "45m": 2700, "600s": 600, "600": 600, "1h0m1s": 3601, "90m": 5400}
    assert {text: duration(text) for text in wanted} == wanted
    for text in ("", "0", "h", "-1", "1.5h", "3 h", "1m1h", "inf"):
        with pytest.raises(argparse.ArgumentTypeError, match="not a time above 0"):
            duration(text)
