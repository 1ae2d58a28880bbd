"""Bands in which dense sand shears in front of a wall, for docs/how-to/dense_sand.md."""

from __future__ import annotations

import math

from accuracy.body_forces import RAMP
from accuracy.sand_walls import OF_PSI, SPEED, sand, scene_of
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

import granular as gr
from figures.common import panels, tell
from granular import plot
from granular.verify.external.limit_analysis import SIZE

PATH = 0.02
"""Path of the wall in heights of the bed."""
STRAIN = 0.2
"""Largest shear strain of the colours."""


def picture(quick: bool) -> plot.Picture:
    """Draw the picture of the page."""
    picture, rows = panels(1, 2, 2.0, sharey=True)
    for ax, psi in zip(rows[0], (0.14, 0.30), strict=True):
        case = OF_PSI[psi]._replace(cells=16 if quick else 32)
        material = sand(case.mu, psi)
        sim = gr.Simulation(scene_of(case, material))
        sim.run(until=PATH * SIZE / SPEED + RAMP / 2)
        title = f"$\\mu_s$ = {case.mu}, $\\psi$ = {psi}"
        plot.frame(sim.state, "shear_strain", ax=ax, title=title, limits=(0.0, STRAIN), bar=False)
        known = gr.theory.earth_pressure(case.mu + psi, dilation=psi)
        angles = {"Coulomb": known.coaxial_deg, "Roscoe": known.dilation_deg}
        for (name, angle), style in zip(angles.items(), (":", "--"), strict=True):
            far = SIZE / math.tan(math.radians(45.0 - angle / 2))
            toe = PATH * SIZE
            ax.plot([toe, toe + far], [0.0, SIZE], style, color="C3", lw=1.2, label=name)
        ax.set(xlim=(0.0, 0.25), ylim=(0.0, 0.11))
        ax.label_outer()
        tell(sim, title)
    rows[0, 1].legend(loc="lower right", fontsize="small")
    strain = ScalarMappable(Normalize(0.0, STRAIN), "plasma")
    picture.colorbar(strain, ax=list(rows[0]), label="plastic shear strain", aspect=30, pad=0.02)
    return picture
