"""Figures 6 and 7: hourglasses after 0, 1, 2 and 5 s, by shear rate and by phase."""

import granular as gr
from figures.common import options, save, states_at
from granular import plot


def main(argv: list[str] | None = None) -> None:
    chosen = options(__doc__, argv)
    widths = {"flat": 0.96, "sloped": 0.48} if chosen.quick else {"flat": None, "sloped": None}
    cell, fill = (0.02, 0.24) if chosen.quick else (0.01, 0.25)
    runs = []
    for kind, width in widths.items():
        scene = gr.scenes.hourglass(
            kind=kind, width=width, cell=cell, fill_height=fill, **chosen.settings
        )
        runs.append(states_at(scene, (0.0, 1.0, 2.0, 5.0), chosen))
    flat, sloped = runs
    save(plot.dunatunga_kamrin_2015.figure_6(flat, sloped), chosen, "figure_6")
    save(plot.dunatunga_kamrin_2015.figure_7(flat, sloped), chosen, "figure_7")
    save(plot.dunatunga_kamrin_2015.figure_7(flat, sloped, by="stress"), chosen, "figure_7_stress")
