"""Columns of loose and of dense sand that collapse, for docs/how-to/dense_sand.md."""

from __future__ import annotations

import granular as gr
from figures.common import panels, tell
from granular import plot


def picture(quick: bool) -> plot.Picture:
    """Draw the picture of the page."""
    sand = gr.DilatantMuI(E=1e6, mu_s=0.6, mu_2=0.86, d=5e-4)
    picture, rows = panels(2, 2, 2.6, sharex=True, sharey=True)
    for row, (name, packing) in zip(rows, {"dense": 0.62, "loose": 0.56}.items(), strict=True):
        scene = gr.scenes.column_collapse(
            aspect=1.0, cell=0.02 if quick else 0.005, points_per_cell=4, jitter=0.5, material=sand
        )
        scene = scene.replace(fills=tuple(f.replace(packing=packing) for f in scene.fills))
        sim = gr.Simulation(scene)
        for k, (ax, until) in enumerate(zip(row, (0.25, 1.2), strict=True)):
            sim.run(until=until)
            title = f"{name}, $\\phi_0$ = {packing}, t = {sim.time:.2f} s"
            plot.frame(sim.state, "packing", ax=ax, title=title, limits=(0.54, 0.62), bar=bool(k))
            ax.label_outer()
        tell(sim, name)
    return picture
