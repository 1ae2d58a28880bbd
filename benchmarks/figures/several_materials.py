"""Sand over gravel, and a flow against an elastic plate, for docs/how-to/several_materials.md.

The whole takes a minute.
"""

from __future__ import annotations

import numpy as np

import granular as gr
from figures.common import tell
from granular import plot

TOP = 0.2
"""Height of the plate [m]."""


def layered(cell: float) -> gr.Scene:
    """A column of sand over gravel that spreads."""
    gravel = gr.DruckerPrager(E=2e6, mu=0.8, rho_c=1700.0)
    fills = [
        gr.Fill(gr.Box((0.0, low), (0.2, low + 0.1)), 4, material=material, lithostatic=True)
        for low, material in ((0.0, gravel), (0.1, None))
    ]
    return gr.Scene(
        name="layers",
        grid=gr.Grid((0.0, 0.0), cell, (round(0.6 / cell), round(0.24 / cell))),
        fills=fills,
        material=gr.materials.glass_beads.replace(E=1e6),
        walls=[gr.Wall(0, 0.0, kind="free_slip"), gr.Wall(1, 0.0)],
        gravity=gr.Gravity((0.0,), ((0.0, -9.8),)),
        duration=1.0,
    )


def deflection(cell: float, times: np.ndarray) -> tuple[list[gr.State], np.ndarray]:
    """States of a flow against a plate, and the displacement of its top [m]."""
    sim = gr.Simulation(gr.scenes.flexible_barrier(cell=cell, duration=float(times[-1])))
    ids = sim.state.id[(sim.state.material == 1) & (sim.state.x[:, 1] > TOP - cell)]
    states, places = [], []
    for until in times:
        if until:
            sim.run(until=until)
        state = sim.state
        states.append(state)
        places.append(state.x[np.isin(state.id, ids), 0].mean())
    tell(sim)
    return states, np.array(places) - places[0]


def picture(quick: bool) -> plot.Picture:
    """Draw the picture of the page."""
    cell = 0.025 if quick else 0.005
    picture = plot.Picture(figsize=(7.0, 6.5), layout="constrained")
    above, middle, below = picture.subplots(3, 1, height_ratios=(1, 1, 0.8))
    state = tell(gr.Simulation(layered(cell)).run()).state
    plot.frame(state, "material", ax=above, bar=False, title="sand over gravel after 1 s")
    for text, place in (("sand", (0.02, 0.12)), ("gravel", (0.02, 0.05))):
        colour = {"sand": "white", "gravel": "black"}[text]
        above.text(*place, text, color=colour)
    times = np.linspace(0.0, 1.5, 76)
    states, moved = deflection(cell, times)
    state = states[20]
    plot.frame(
        state,
        "speed",
        ax=middle,
        title=f"a flow against an elastic plate (grey), t = {state.time:.2f} s",
    )
    plate = state.x[state.material == 1]
    middle.plot(*plate.T, "s", color="0.7", markersize=2.0, markeredgewidth=0)
    below.plot(times, 1e3 * moved)
    below.set_xlabel("time [s]")
    below.set_ylabel("deflection of the top [mm]")
    print(f"largest deflection {1e3 * moved.max():.1f} mm, in the end {1e3 * moved[-1]:.1f} mm")
    return picture
