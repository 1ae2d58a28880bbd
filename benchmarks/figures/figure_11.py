"""Figure 11: a loose slug flies, meets a wall, and comes to rest as a heap."""

import sys

from common import options, save, states_at

import granular as gr
from granular import plot


def main(argv: list[str] | None = None) -> None:
    chosen = options(__doc__, argv)
    scene = gr.scenes.slug(
        cell=0.0166 if chosen.quick else 0.0083, material=chosen.material, scheme=chosen.scheme
    )
    flight, impact = (0.0, 0.1, 0.2, 0.3), (0.34, 0.38, 0.42, 0.48, 0.55, 0.65)
    states = states_at(scene, (*flight, *impact, scene.duration))
    picture = plot.figure_11(states[: len(flight)], states[len(flight) : -1], states[-1])
    save(picture, chosen.out, "figure_11")


if __name__ == "__main__":
    main(sys.argv[1:])
