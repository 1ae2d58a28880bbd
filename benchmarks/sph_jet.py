"""Picture of a jet of gas on a bed (Hurley, thesis, figure 6.2): grains left, gas right.

python benchmarks/sph_jet.py [--spacing 0.0125] [--to docs/sph_jet.png]
"""

from __future__ import annotations

import argparse

import numpy as np
from matplotlib.figure import Figure

from granular import sph

TIMES = (0.0075, 0.03, 0.0525, 0.075)


def frames(spacing: float) -> list[tuple]:
    """Time [s], grains and gas at some times."""
    simulation = sph.Simulation(sph.scenes.jet_on_bed(spacing=spacing))
    found = []
    for until in TIMES:
        simulation.run(until)
        found.append((simulation.time, simulation.state, simulation.gas))
    return found


def picture(found: list[tuple], ambient: float = 1e5) -> Figure:
    """Speed of the grains, and pressure of the gas above the initial one."""
    figure = Figure(figsize=(8.0, 2.4 * len(found)), layout="constrained")
    axes = figure.subplots(len(found), 2, sharex=True, sharey=True)
    for (left, right), (time, grains, gas) in zip(axes, found, strict=True):
        speed = np.linalg.norm(grains.v, axis=1)
        above = (gas.p - ambient) / 1e3
        one = left.scatter(*grains.x.T, c=speed, s=4, vmin=0, vmax=2)
        two = right.scatter(*gas.x.T, c=above, s=4, vmin=-10, vmax=10, cmap="coolwarm")
        left.set_title(f"{1e3 * time:.1f} ms")
        figure.colorbar(one, ax=left, label="grains, m/s")
        figure.colorbar(two, ax=right, label="gas, kPa")
        for axis in (left, right):
            axis.set_aspect("equal")
    return figure


def main() -> None:
    """Run the scene and draw it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacing", type=float, default=0.0125, help="of the points [m]")
    parser.add_argument("--to", default="docs/sph_jet.png")
    given = parser.parse_args()
    picture(frames(given.spacing)).savefig(given.to, dpi=70)


if __name__ == "__main__":
    main()
