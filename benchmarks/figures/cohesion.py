"""A cliff that slides, and cliffs that settle as gravity grows, for docs/how-to/cohesion.md."""

from __future__ import annotations

import numpy as np

import granular as gr
from figures.common import tell
from granular import plot, theory
from granular.scenes.cohesive_cliff import cohesive_soil

HEIGHT = 0.2
"""Height of the cliffs under a gravity that grows [m]."""


def settlement(cell: float, gravities: np.ndarray, material: gr.DruckerPrager) -> np.ndarray:
    """Settlement of the crest of a cliff [m] as gravity grows to the last of `gravities`."""
    full, ramp = float(gravities[-1]), 4.0
    scene = gr.scenes.cohesive_cliff(
        height=HEIGHT, cell=cell, gravity=full, ramp=ramp, duration=ramp, material=material
    )
    sim = gr.Simulation(scene)
    top, start = int(np.argmax(sim.state.x.sum(axis=1))), sim.state.x.copy()
    sunk = []
    for gravity in gravities:
        sim.run(until=ramp * gravity / full)
        sunk.append(start[top, 1] - sim.state.x[top, 1])
    tell(sim)
    return np.array(sunk)


def picture(quick: bool) -> plot.Picture:
    """Draw the picture of the page."""
    cell = 0.025 if quick else 0.00625
    picture = plot.Picture(figsize=(7.0, 2.8), layout="constrained")
    left, right = picture.subplots(1, 2, width_ratios=(1, 1.1))
    sim = tell(gr.Simulation(gr.scenes.cohesive_cliff(cell=cell)).run(until=0.4))
    plot.frame(sim.state, "speed", ax=left, title=f"a cliff of 0.3 m slides, t = {sim.time:.2f} s")
    gravities = np.arange(0.5, 12.01, 0.25)
    for name, material in (
        ("tensile strength cohesion/mu", cohesive_soil),
        ("without tensile strength", cohesive_soil.replace(tensile_strength=0.0)),
    ):
        sunk = settlement(cell, gravities, material)
        right.semilogy(HEIGHT * gravities / 9.8, 1e3 * sunk, label=name)
    m = cohesive_soil
    limits = theory.cliff_height(cohesion=m.cohesion, mu=m.mu, density=m.rho_c, gravity=9.8)
    right.axvspan(limits.band, limits.coaxial, color="0.85", label="limit analysis")
    right.set_xlabel("height of the cliff under 9.8 m/s$^2$ [m]")
    right.set_ylabel("settlement of the crest [mm]")
    right.set_ylim(1e-2, 100.0)
    right.legend(loc="lower right")
    return picture
