"""Round silos: the flow by radius and height, and rates compared with Beverloo's law."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import granular as gr
from figures.common import BLUE, GREY, panels, parser_of, save, tell


def silo(orifice: float, cell: float, duration: float) -> gr.Scene:
    """A round silo of 0.8 m with an opening of this diameter [m]."""
    return gr.scenes.silo(
        axisymmetric=True, orifice=orifice, width=0.8, height=0.6, edge="wall", cell=cell,
        points_per_cell=16, jitter=0.5, duration=duration, E=1e6,
    )  # fmt: skip


def rate(orifice: float, cell: float, folder: Path) -> float:
    """Rate of discharge between 95 and 75 % of the mass [kg/s]."""
    sim = gr.Simulation(silo(orifice, cell, 30.0))
    first = sim.state.mass.sum()
    path = folder / f"{orifice}.h5"
    sim.run(save=path, every=0.02, hooks=(lambda s: s.state.mass.sum() < 0.7 * first,))
    tell(sim, f"D = {orifice} m")
    with gr.open(path) as record:
        return gr.measure.discharge(record, window=(0.95 * first, 0.75 * first)).rate


def main(argv: Sequence[str] | None = None) -> None:
    """Draw the picture of the guide to round silos."""
    chosen = parser_of(__doc__).parse_args(argv)
    cell = 0.04 if chosen.quick else 0.01
    made, (axes,) = panels(1, 2, 3.4)
    sim = gr.Simulation(silo(0.16, cell, 1.0))
    gr.plot.frame(tell(sim.run()).state, "speed", ax=axes[0], log=True)
    axes[0].set(title="speed 1 s after the start")
    orifices = np.array([0.16, 0.24]) if chosen.quick else np.array([0.1, 0.12, 0.16, 0.2, 0.24])
    with TemporaryDirectory() as folder:
        rates = [rate(float(D), cell, Path(folder)) for D in orifices]
    line = np.linspace(0.9 * orifices[0], 1.05 * orifices[-1], 50)
    law = [gr.theory.beverloo_rate(D, rho=1500.0, gravity=9.8, dim=3) for D in line]
    axes[1].plot(line, law, color=GREY, label="Beverloo, k = 0")
    axes[1].plot(orifices, rates, "o", color=BLUE, label="simulated")
    axes[1].set(xscale="log", yscale="log", xlabel="opening D [m]", ylabel="rate [kg/s]")
    axes[1].set(title="discharge of round silos", xticks=[0.1, 0.15, 0.2])
    axes[1].set_xticks([0.1, 0.15, 0.2], ["0.1", "0.15", "0.2"])
    axes[1].minorticks_off()
    axes[1].legend()
    save(made, chosen, "round_silo")
