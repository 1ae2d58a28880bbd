"""Handlers of signals that raise: they end a run between its steps, and lose nothing."""

import ctypes
import os
import random
import signal
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr
from granular.materials import from_function, law_functions, own
from granular.run.interrupts import DeferredSignals


class Alarm(Exception):
    """Raised by the handlers of the tests."""


@contextmanager
def handlers(handler, *numbers):
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
        assert all(signal.getsignal(number) is handler for number in numbers)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, old in before.items():
            signal.signal(number, old)


def raising(number, frame):
    raise Alarm(number)


def damped(dt, parameters, gradient, log_density, stress, shear_rate, history):
    stress *= np.where(log_density > 0, 0.999, 0.0)


def interrupting(dt, parameters, gradient, log_density, stress, shear_rate, history):
    stress *= np.where(log_density > 0, 0.999, 0.0)
    signal.raise_signal(signal.SIGINT)
    signal.raise_signal(signal.SIGALRM)


ONCE = "GRANULAR_TEST_RAISES_ONCE"


def raising_once(dt, parameters, gradient, log_density, stress, shear_rate, history):
    stress *= np.where(log_density > 0, 0.999, 0.0)
    if os.environ.pop(ONCE, None):
        raise TimeoutError("from elsewhere")


def block_of(law=None):
    return scene_with(
        grid=gr.Grid((0.0, 0.0), 0.1, (6, 4)),
        fills=[gr.Fill(gr.Box((0.0, 0.0), (0.3, 0.3)), 4)],
        material=gr.materials.glass_beads.replace(E=1e7)
        if law is None
        else from_function(law, E=1e7),
        walls=[gr.Wall(0, 0.0, kind="free_slip"), gr.Wall(1, 0.0)],
        scheme=gr.schemes.default.replace(density=gr.SmoothedDensity(flutter_damping=0)),
    )


STEPS, UNTIL = 400, 0.2


def go_on(sim, how, path):
    """Make what is left of STEPS steps, or of a run to UNTIL."""
    if how == "run":
        save = None if sim.record else path
        sim.run(until=UNTIL, save=save, every=0.02, overwrite=True, monitor=False)
    elif sim.steps < STEPS:
        sim.step(STEPS - sim.steps)


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """Digests of checkpoints without a signal."""
    found = {}
    for how in ("step", "run"):
        sim = gr.Simulation(block_of(damped), threads=1)
        go_on(sim, how, tmp_path_factory.mktemp("signals") / "whole.h5")
        found[how] = sim.checkpoint().digest
    return found


def ctrl_c_by_alarm(number, frame):
    signal.raise_signal(signal.SIGINT)


def trial(how, seconds, path, error):
    """Interrupt a simulation after a time and let it go on; return whether it was at work."""
    sim = gr.Simulation(block_of(damped), threads=1)
    inside = True
    with pytest.raises(error):
        signal.setitimer(signal.ITIMER_REAL, seconds)
        go_on(sim, how, path)
        inside = False
        time.sleep(10)
    assert np.isfinite(sim.state.stress).all()
    if how == "run" and inside and sim.record:
        with gr.open(path) as record:
            assert record.checkpoint().digest == sim.checkpoint().digest
        sim = gr.Simulation.resume(path, threads=1)
    go_on(sim, how, path)
    return inside, sim.checkpoint().digest


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("trials", [6, pytest.param(50, marks=pytest.mark.slow)])
@pytest.mark.parametrize("how", ["step", "run"])
@pytest.mark.parametrize("handler, error", [(ctrl_c_by_alarm, KeyboardInterrupt), (raising, Alarm)])
def test_a_signal_at_any_time_loses_nothing(handler, error, how, trials, tmp_path, unbroken):
    """The handler's exception is raised, and the run goes on with the bits of an unbroken one."""
    chance, count = random.Random(7), 0
    with handlers(handler, signal.SIGALRM):
        for k in range(trials):
            inside, digest = trial(how, chance.uniform(5e-4, 0.01), tmp_path / f"{k}.h5", error)
            count += inside
            assert digest == unbroken[how]
    assert count > trials / 2


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("threads", [1, 2])
def test_signals_within_a_law_wait_for_the_end_of_the_step(threads):
    """Both handlers are called, each once a call of the core, and no step is lost or changed."""
    seen = []
    sims = [gr.Simulation(block_of(law), threads=threads) for law in (interrupting, damped)]
    with handlers(lambda number, frame: seen.append(sims[0].steps), signal.SIGALRM):
        for made in range(1, 6):
            with pytest.raises(KeyboardInterrupt):
                sims[0].step()
            assert sims[0].steps == made == len(seen)
    sims[1].step(5)
    assert sims[0].checkpoint().digest == sims[1].checkpoint().digest
    assert seen == [1, 2, 3, 4, 5]


def test_handlers_that_do_not_raise_change_nothing(tmp_path, unbroken):
    seen = []
    with handlers(lambda number, frame: seen.append(number), signal.SIGALRM, signal.SIGUSR1):
        signal.setitimer(signal.ITIMER_REAL, 1e-3, 1e-3)
        sim = gr.Simulation(block_of(damped), threads=1)
        go_on(sim, "run", tmp_path / "run.h5")
    assert sim.checkpoint().digest == unbroken["run"]
    assert len(seen) > 3


def test_many_steps_and_sph_heed_signals():
    """So does a law that is not in Python, and a chunk without an end."""
    sph = gr.scenes.incline_sph(height=0.03, columns=6)
    for scene in (block_of(), sph):
        sim = gr.Simulation(scene, threads=1)
        with handlers(raising, signal.SIGALRM):
            signal.setitimer(signal.ITIMER_REAL, 0.05)
            with pytest.raises(Alarm):
                sim.step(10**9)
        steps = sim.steps
        sim.step(3)
        other = gr.Simulation(scene, threads=1)
        other.step(steps + 3)
        assert sim.checkpoint().digest == other.checkpoint().digest


@pytest.mark.usefixtures("ctrl_c")
def test_signals_in_hooks_and_in_runs_within_them(tmp_path):
    """A hook is code of the user: handlers run at once in it, and wait in what it simulates."""
    inner = gr.Simulation(block_of(interrupting), threads=1)

    def hook(sim):
        if sim.steps:
            inner.run(until=0.01, monitor=False)

    sim = gr.Simulation(block_of(damped), threads=1)
    with handlers(lambda number, frame: None, signal.SIGALRM), pytest.raises(KeyboardInterrupt):
        sim.run(until=0.1, save=tmp_path / "run.h5", hooks=(hook,))
    assert inner.steps and np.isfinite(inner.state.stress).all()
    sim.run(until=0.1)
    other = gr.Simulation(block_of(damped), threads=1).run(until=0.1)
    assert sim.checkpoint().digest == other.checkpoint().digest


@pytest.mark.parametrize("exhausted", [signal.SIG_DFL, signal.SIG_IGN])
def test_a_handler_may_replace_itself(exhausted):
    """As programs do that stop at the first Ctrl-C, and are killed by the second one."""

    def first(number, frame):
        signal.signal(signal.SIGUSR1, exhausted)

    signal.signal(signal.SIGUSR1, first)
    try:
        with DeferredSignals() as signals:
            signal.raise_signal(signal.SIGUSR1)
            signal.raise_signal(signal.SIGUSR1)  # as one that waits
            signals.deliver()
            assert signal.getsignal(signal.SIGUSR1) is exhausted
        assert signal.getsignal(signal.SIGUSR1) is exhausted
    finally:
        signal.signal(signal.SIGUSR1, signal.SIG_DFL)


def test_all_waiting_signals_are_delivered():
    seen = []

    def both(number, frame):
        seen.append(number)
        raise Alarm(number)

    numbers = [signal.SIGTERM, signal.SIGALRM, signal.SIGUSR1]
    with handlers(both, *numbers), pytest.raises(Alarm), DeferredSignals():
        for number in numbers:
            signal.raise_signal(number)
        assert not seen
    assert seen == numbers


def test_other_threads_run_no_handlers():
    sim = gr.Simulation(block_of(damped), threads=1)
    thread = threading.Thread(target=sim.step, args=(5,))
    thread.start()
    thread.join()
    assert sim.steps == 5


# ---- exceptions that are no signals ----


def test_an_exception_from_elsewhere_leaves_the_state_whole(monkeypatch, unbroken):
    """As a thread sets one: the core calls the function again, and what was raised is raised."""
    monkeypatch.setattr(own, "frozen", lambda law: ("raising once", law))  # which may not read ONCE
    sim = gr.Simulation(block_of(raising_once), threads=1)
    sim.step(10)
    monkeypatch.setenv(ONCE, "1")
    with pytest.raises(TimeoutError, match="from elsewhere"):
        sim.step(10)
    sim.step(STEPS - sim.steps)
    assert sim.checkpoint().digest == unbroken["step"]


def test_a_law_that_fails_is_told_at_once_and_costs_no_checkpoint(tmp_path):
    """The state is then of no use, which the next call says; the record has the last good one."""
    path = tmp_path / "run.h5"
    sim = gr.Simulation(block_of(failing_late), threads=2)
    with pytest.raises(ZeroDivisionError, match="too dense"):
        sim.run(until=UNTIL, save=path, every=0.02)
    for use in (sim.step, sim.checkpoint, lambda: sim.run(until=UNTIL)):
        with pytest.raises(gr.SimulationError, match="its state is of no use"):
            use()
    with gr.open(path) as record:
        assert np.isfinite(record.checkpoint().arrays["stress"]).all()
    again = gr.Simulation.resume(path, threads=1)
    with pytest.raises(ZeroDivisionError, match="too dense"):
        again.run(until=UNTIL)
    other = gr.Simulation(block_of(failing_late), threads=1)
    other.step(1)  # not told of what the others raised


def failing_late(dt, parameters, gradient, log_density, stress, shear_rate, history):
    stress *= np.where(log_density > 0, 0.999, 0.0)
    if (log_density > 1e-4).any():
        raise ZeroDivisionError("too dense")


@pytest.mark.parametrize("calls", [1, 2])
def test_a_call_that_never_says_it_is_done_is_told(monkeypatch, calls):
    """As when Python ends a function before its first line, where nothing can be kept."""
    scene = block_of(damped)
    made = law_functions.from_python(damped, "numpy")
    left = [calls]

    def call(*arguments):
        if left[0]:
            left[0] -= 1
        else:
            whole(*arguments)

    whole = made._references[0]
    callback = law_functions._SIGNATURE(call)
    address = ctypes.cast(callback, ctypes.c_void_p).value
    function = law_functions.LawFunction(address, callback)
    monkeypatch.setitem(own._FUNCTIONS, scene.material.digest, function)
    sim = gr.Simulation(scene, threads=1)
    error = (RuntimeError, "the state is valid") if calls == 1 else (gr.SimulationError, "failed")
    with pytest.raises(error[0], match=error[1]):
        sim.step(3)
    if calls == 1:
        sim.step(STEPS - sim.steps)
        other = gr.Simulation(scene, threads=1)
        other.step(STEPS)
        assert sim.checkpoint().digest == other.checkpoint().digest
