"""A heap below a spout, a fed chute and a silo that stays full, for docs/how-to/inflow.md.

The whole takes a minute or two.
"""

from __future__ import annotations

import numpy as np

import granular as gr
from figures.common import tell
from granular import plot


def history(scene: gr.Scene, every: float) -> tuple[gr.State, np.ndarray]:
    """Last state, and rows of time, mass that has entered, and mass that is held."""
    sim, rows = gr.Simulation(scene), []

    def note(running: gr.Simulation) -> None:
        rows.append((running.time, running.inflows[0].mass, running.state.mass.sum()))

    tell(sim.run(every=every, hooks=(note,)))
    return sim.state, np.array(rows).T


def picture(quick: bool) -> plot.Picture:
    """Draw the picture of the page."""
    coarse = quick
    picture = plot.Picture(figsize=(7.0, 7.1), layout="constrained")
    heap_axes, chute_axes, below = picture.subplots(3, 1, height_ratios=(1, 0.55, 1))
    heap, _ = history(gr.scenes.conveyor_heap(cell=0.02 if coarse else 0.01), 0.1)
    plot.frame(heap, "speed", ax=heap_axes, title=f"heap below a spout after {heap.time:.1f} s")
    chute = gr.scenes.chute_fed(cell=0.02 if coarse else 0.01, duration=1.0 if coarse else 4.0)
    state, _ = history(chute, 0.1)
    plot.frame(state, "speed", ax=chute_axes, title="chute that a feeder supplies, at the left")
    _, (time, entered, held) = history(gr.scenes.silo_fed(duration=1.0 if coarse else 5.0), 0.1)
    below.plot(time, entered, label="entered")
    below.plot(time, entered + held[0] - held, "--", label="left through the orifice")
    below.set(xlabel="time [s]", ylabel="mass of half the silo [kg/m]")
    below.set_title("silo that stays full")
    below.legend(frameon=False)
    rate = np.diff(entered[[len(time) // 2, -1]])[0] / np.diff(time[[len(time) // 2, -1]])[0]
    print(f"the silo takes in {rate:.1f} kg/s per metre in the second half of the run")
    return picture
