"""Figure 11: a disconnected slug flies, meets a wall, and comes to rest as a heap."""

import granular as gr
from figures.common import options, save, states_at
from granular import plot


def main(argv: list[str] | None = None) -> None:
    chosen = options(__doc__, argv)
    # The paper gives cells of 0.0083 m, 120 to a metre, but no size: here a box of 1 m, so that
    # the heap ends before the left wall; the way to the right wall is that of the scene.
    scene = gr.scenes.slug(
        center=(0.45, 0.25),
        wall_at=1.0,
        cell=0.025 if chosen.quick else 0.0083,
        **chosen.settings,
    )
    flight, impact = (0.0, 0.1, 0.2, 0.3), (0.34, 0.36, 0.38, 0.40, 0.42, 0.48)
    states = states_at(scene, (*flight, *impact, scene.duration), chosen)
    picture = plot.dunatunga_kamrin_2015.figure_11(
        states[: len(flight)], states[len(flight) : -1], states[-1]
    )
    save(picture, chosen, "figure_11")
