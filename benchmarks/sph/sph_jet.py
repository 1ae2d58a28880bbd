"""Picture of a gas jet on a bed (Hurley, thesis, figure 6.2): material above, gas below.

The excess of the gas pressure is over the initial one.

A record that exists is drawn as it is. The share of the nozzle that is full of gas of the initial
density is printed for each frame that is drawn.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

import granular as gr
from granular.plot.canvas import triangles
from granular.scenes.sph_gas import bed_soil

EVERY = 0.0075
"""Time between frames [s]; every third frame is drawn, from the second on."""
STIFF = bed_soil.replace(kappa=8 * bed_soil.kappa)
"""Grains are thrown at up to 11 m/s, which is more than half the speed of waves in `bed_soil`."""
FASTEST, HIGHEST = 3.0, 10.0
"""Ends of the scales: speed [m/s], pressure above the initial one [kPa]."""


def picture(record: gr.record.Trajectory, ambient: float = 1e5) -> Figure:
    """Speed of the material particles, and pressure of the gas relative to the initial one."""
    frames = record[1::3]
    figure = Figure(figsize=(7.0, 3.6), layout="compressed")
    axes = figure.subplots(2, len(frames), sharex=True, sharey=True)
    grid = record.scene.grid
    extent = tuple(zip(grid.lower, grid.upper, strict=True))
    for (above, below), grains in zip(axes.T, frames, strict=True):
        title = f"t = {1e3 * grains.time:.1f} ms"
        options = {"limits": (0, FASTEST), "extent": extent, "bar": False, "title": title}
        gr.plot.frame(grains, "speed", ax=above, **options)
        blow(below, grains, 1e-3 * (grains.gas.pressure - ambient))
        below.set_aspect("equal")
    for ax in axes.flat:
        ax.set(xlabel="x [m]", ylabel="y [m]")
        ax.label_outer()
    speeds = ScalarMappable(Normalize(0, FASTEST), "viridis")
    figure.colorbar(speeds, ax=axes[0], label="speed [m/s]")
    pressures = ScalarMappable(Normalize(-HIGHEST, HIGHEST), "coolwarm")
    figure.colorbar(pressures, ax=axes[1], label="excess pressure [kPa]")
    return figure


def blow(ax: Axes, grains: gr.State, above: np.ndarray) -> None:
    """Pressure of the gas, and arrows along its velocity, of a length by its square root."""
    gas = grains.gas
    mesh = triangles(gas.x, longest=6)
    ax.tripcolor(mesh, above, shading="gouraud", cmap="coolwarm", vmin=-HIGHEST, vmax=HIGHEST)
    speed = np.linalg.norm(gas.v, axis=1)
    fast = np.flatnonzero(speed > 1.0)
    chosen = np.random.default_rng(0).choice(fast, len(fast) // 8, replace=False)
    arrows = gas.v[chosen] / np.sqrt(speed[chosen])[:, None]
    ax.quiver(*gas.x[chosen].T, *arrows.T, scale=250.0, width=0.004, color="0.15")


def filling(frame: gr.State) -> float:
    """Mass of the gas in the nozzle over its mass at the initial density."""
    (jet,), gas = frame.scene.gas.jets, frame.gas
    low, high = (np.array(end) for end in jet.region.bounds)
    within = ((gas.x > low) & (gas.x < high)).all(axis=1)
    return float(gas.mass[within].sum() / (frame.scene.gas.fills[0].density * np.prod(high - low)))


def main() -> None:
    """Run the scene and draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacing", type=float, default=0.00625, help="of the points [m]")
    parser.add_argument("--to", default="docs/pictures/sph_jet.png")
    parser.add_argument("--record", type=Path, default="jet.h5")
    given = parser.parse_args()
    if not given.record.exists():
        scene = gr.scenes.jet_on_bed(spacing=given.spacing, material=STIFF)
        gr.Simulation(scene).run(save=given.record, every=EVERY)
    with gr.open(given.record) as record:
        for frame in record[1::3]:
            print(f"{1e3 * frame.time:.1f} ms: nozzle full to {filling(frame):.3f}")
        print(record.health().verdict)
        picture(record).savefig(given.to)
