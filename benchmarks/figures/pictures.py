"""Pictures of the pages of docs/how-to/ that need more than a function each.

`python benchmarks pictures cohesion inflow --out docs/pictures` makes only these. Each takes from
some seconds to two minutes.
"""

from __future__ import annotations

from collections.abc import Callable

from figures import (
    cohesion,
    damp_waves,
    dense_columns,
    free_scenes,
    inflow,
    own_law,
    sand_bands,
    several_materials,
    thrown_block,
)
from figures.common import draw_pages
from granular.plot import Picture

PAGES: dict[str, Callable[[bool], Picture]] = {
    "cohesion": cohesion.picture,
    "damp_waves": damp_waves.picture,
    "dense_sand": dense_columns.picture,
    "dense_sand_bands": sand_bands.picture,
    "free_bodies": thrown_block.picture,
    "free_scenes": free_scenes.picture,
    "inflow": inflow.picture,
    "own_law": own_law.picture,
    "several_materials": several_materials.picture,
}


def main(argv: list[str] | None = None) -> None:
    draw_pages(__doc__, argv, PAGES)
