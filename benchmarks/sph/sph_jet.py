"""Picture of a gas jet on a bed (Hurley, thesis, figure 6.2): material left, gas right.

A record that exists is drawn as it is. The share of the nozzle that is full of gas of the initial
density is printed for each frame that is drawn.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import granular as gr

EVERY = 0.0075
"""Time between frames [s]; every third frame is drawn, from the second on."""


SIZE = 14
"""Area of a marker [points^2], about the area of a particle."""


def picture(record: gr.record.Trajectory, ambient: float = 1e5) -> Figure:
    """Speed of the material particles, and pressure of the gas relative to the initial one."""
    frames = record[1::3]
    figure = Figure(figsize=(7.0, 2.3 * len(frames)), layout="compressed")
    axes = figure.subplots(len(frames), 2, sharex=True, sharey=True)
    for (left, right), grains in zip(axes, frames, strict=True):
        gas, speed = grains.gas, np.linalg.norm(grains.v, axis=1)
        above = (gas.pressure - ambient) / 1e3
        one = left.scatter(*grains.x.T, c=speed, s=SIZE, vmin=0, vmax=2)
        two = right.scatter(*gas.x.T, c=above, s=SIZE, vmin=-10, vmax=10, cmap="coolwarm")
        left.set(title=f"grains, t = {1e3 * grains.time:.1f} ms", ylabel="y [m]")
        right.set_title("gas")
        figure.colorbar(one, ax=left, label="speed [m/s]")
        figure.colorbar(two, ax=right, label="pressure [kPa]")
        for axis in (left, right):
            axis.set_aspect("equal")
    for axis in axes[-1]:
        axis.set_xlabel("x [m]")
    return figure


def filling(frame: gr.State) -> float:
    """Mass of the gas in the nozzle over its mass at the initial density."""
    (jet,), gas = frame.scene.gas.jets, frame.gas
    low, high = (np.array(end) for end in jet.region.bounds)
    within = ((gas.x > low) & (gas.x < high)).all(axis=1)
    return float(gas.mass[within].sum() / (frame.scene.gas.fills[0].density * np.prod(high - low)))


def main() -> None:
    """Run the scene and draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacing", type=float, default=0.0125, help="of the points [m]")
    parser.add_argument("--to", default="docs/pictures/sph_jet.png")
    parser.add_argument("--record", type=Path, default="jet.h5")
    given = parser.parse_args()
    if not given.record.exists():
        scene = gr.scenes.jet_on_bed(spacing=given.spacing)
        gr.Simulation(scene).run(save=given.record, every=EVERY)
    with gr.open(given.record) as record:
        for frame in record[1::3]:
            print(f"{1e3 * frame.time:.1f} ms: nozzle full to {filling(frame):.3f}")
        picture(record).savefig(given.to)
