"""Hooks that end a run."""

import re

import numpy as np
import pytest
from scenes_by_hand import scene_with

import granular as gr


def column(**changes):
    return gr.scenes.column_collapse(cell=0.05, E=1e6).replace(**changes)


def test_a_hook_that_returns_true_ends_the_run(tmp_path):
    """At its frame, which is the last one; anything else that it returns does not."""
    sim = gr.Simulation(column())
    hooks = (lambda sim: sim.steps, lambda sim: np.bool_(sim.time > 0.05))
    sim.run(until=1.0, save=tmp_path / "a.h5", every=0.02, hooks=hooks)
    assert 0.06 <= sim.time < 0.07 and sim.ended_by is hooks[-1]
    assert gr.open(tmp_path / "a.h5").times[-1] == sim.time
    with sim.recording():
        sim.run(until=1.0, hooks=hooks)
    assert 0.08 <= sim.time < 0.09
    sim.run(until=sim.time + 0.01)
    assert sim.ended_by is None


def test_a_collapse_is_over_when_it_rests():
    """The column stands still, and did not before."""
    sim = gr.Simulation(column())
    sim.run(until=20.0, every=0.02, hooks=(gr.stop.at_rest(0.02, over=0.2),))
    assert 0.5 < sim.time < 19.0
    speed = np.sqrt((sim.state.v**2).sum(axis=1).mean())
    assert speed < 0.02


def test_what_tends_to_a_value_is_steady_when_theory_says():
    """1 - exp(-t/T): its means over the two halves of the last time w differ by the tolerance."""
    T, w, tolerance, seen = 0.05, 0.1, 0.02, []
    sim = gr.Simulation(column())

    def quantity(sim):
        seen.append(sim.time)
        return 1.0 - np.exp(-sim.time / T)

    sim.run(until=1.0, every=0.001, hooks=(gr.stop.steady(quantity, over=w, tolerance=tolerance),))
    halves = T / (w / 2) * np.exp(-sim.time / T) * np.diff(np.exp([0.0, w / 2 / T, w / T]))
    later, earlier = 1.0 - halves
    step = 2 * np.diff(seen).max()  # the change of the means is by exp(-t/T)
    assert later - earlier == pytest.approx(tolerance * later, rel=step / T)


def test_force_and_discharge_are_exact_means():
    """A body under a constant force of the material; a stream that leaves the domain."""
    grid = gr.Grid((0.0, 0.0), 0.05, (8, 12), open_sides=("y-",))
    fall = (gr.Fill(gr.Box((0.0, 0.0), (0.4, 0.6)), 4, velocity=(0.0, -1.0)),)
    stream = scene_with(grid=grid, fills=fall, gravity=0.0)
    sim = gr.Simulation(stream)
    sim.run(until=0.5, every=0.01, hooks=(gr.stop.steady("discharge", over=0.2, tolerance=0.2),))
    assert 0.2 <= sim.time < 0.4
    floor = gr.Body(gr.Box(size=(0.4, 0.2)), (0.2, 0.0))
    bed = (gr.Fill(gr.Box((0.0, 0.1), (0.4, 0.4)), 4, lithostatic=True),)
    resting = scene_with(grid=gr.Grid((0.0, 0.0), 0.05, (8, 12)), fills=bed, bodies=(floor,))
    sim = gr.Simulation(resting)
    hook = gr.stop.steady("force", over=0.1, tolerance=0.05, after=0.15)
    sim.run(until=1.0, every=0.005, hooks=(hook,))
    assert 0.15 <= sim.time < 0.9


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: gr.stop.at_rest(0.0), "speed = 0.0"),
        (lambda: gr.stop.at_rest(over=-1.0), "over = -1.0"),
        (lambda: gr.stop.steady(over=0.0), "over = 0.0"),
        (lambda: gr.stop.steady("speed", over=1.0), "of = 'speed'"),
        (lambda: gr.stop.steady(over=1.0, tolerance=-1.0), "tolerance = -1.0"),
        (lambda: gr.stop.steady("force", over=1.0, body=-1), "body = -1"),
        (
            lambda: gr.Simulation(column()).run(
                until=0.1, every=0.01, hooks=(gr.stop.steady("force", over=0.1),)
            ),
            "body = 0 must be < 0",
        ),
        (
            lambda: gr.Simulation(column()).run(
                until=0.1, every=0.02, hooks=(gr.stop.steady(over=0.05),)
            ),
            "over = 0.05 must have at least 8 frames",
        ),
    ],
)
def test_what_cannot_be_is_refused(make, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        make()
