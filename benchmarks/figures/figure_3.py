"""Figure 3: run-out against aspect ratio, of both schemes."""

import granular as gr
from figures.common import SCHEMES, options, save, states_at
from granular import plot


def main(argv: list[str] | None = None) -> None:
    chosen = options(__doc__, argv, without=("scheme",))
    aspects = (
        (0.5, 1.0, 2.0, 4.0) if chosen.quick else (0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
    )
    cell, runouts = 0.02 if chosen.quick else None, {}
    for key in ("published", "default"):
        name = f"{key} scheme"
        runouts[name] = []
        for aspect in aspects:
            scene = gr.scenes.column_collapse(
                aspect=aspect, cell=cell, scheme=SCHEMES[key], **chosen.settings
            )
            label = f"{name}, a = {aspect:g}"
            (last,) = states_at(scene, (scene.duration,), chosen, name=label)
            runouts[name].append(gr.measure.runout(last))
    save(plot.dunatunga_kamrin_2015.figure_3(aspects, runouts), chosen, "figure_3")
