"""Figure 2: column collapses of aspect 2, 1 and 0.5."""

import granular as gr
from figures.common import options, save, states_at
from granular import plot


def main(argv: list[str] | None = None) -> None:
    chosen = options(__doc__, argv)
    cell, columns = 0.02 if chosen.quick else None, []
    for aspect in (2.0, 1.0, 0.5):
        scene = gr.scenes.column_collapse(aspect=aspect, cell=cell, **chosen.settings)
        name = f"a = {aspect:g}"
        columns.append(states_at(scene, (0.0, 0.5, 2.0), chosen, name=name))
    save(plot.dunatunga_kamrin_2015.figure_2(columns), chosen, "figure_2")
