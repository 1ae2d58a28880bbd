"""Figure 4: silos with orifices of 0.10, 0.14 and 0.18 m after 0, 2 and 5 s."""

import granular as gr
from figures.common import options, save, states_at
from granular import plot


def main(argv: list[str] | None = None) -> None:
    chosen = options(__doc__, argv)
    cell, silos = 0.02 if chosen.quick else 0.01, []
    for orifice in (0.10, 0.14, 0.18) if not chosen.quick else (0.12, 0.16, 0.20):
        scene = gr.scenes.silo(orifice=orifice, cell=cell, **chosen.settings)
        name = f"D = {orifice:g} m"
        silos.append(states_at(scene, (0.0, 2.0, 5.0), chosen, name=name))
    save(plot.dunatunga_kamrin_2015.figure_4(silos), chosen, "figure_4")
