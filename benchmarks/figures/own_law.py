"""A cohesive Bingham fluid next to glass beads, for docs/how-to/own_law.md.

The function is taken from the page. The whole takes some seconds.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from shared import ROOT

import granular as gr
from figures.common import tell
from granular import plot

PAGE = ROOT / "docs" / "how-to" / "own_law.md"


def material_of_page() -> gr.materials.OwnLaw:
    """Return the material that the first block of the page makes."""
    match = re.search(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert match is not None
    block = match[1].split("scene = ")[0]
    module = Path(__file__).with_name("_own_law_of_page.py")
    module.write_text(block)
    try:
        names: dict[str, Any] = {}
        exec(compile(block, str(module), "exec"), names)
        return names["mud"]
    finally:
        module.unlink()


def picture(quick: bool) -> plot.Picture:
    """Draw the picture of the page."""
    cell = 0.04 if quick else 0.01
    beads = gr.materials.glass_beads.replace(E=1e6)
    picture = plot.Picture(figsize=(7.0, 4.1), layout="constrained")
    panels = picture.subplots(2, 1)
    for ax, material, title in zip(
        panels, (material_of_page(), beads), ("cohesive Bingham fluid", "glass beads"), strict=True
    ):
        scene = gr.scenes.column_collapse(aspect=1.0, cell=cell, duration=1.5, material=material)
        state = tell(gr.Simulation(scene).run()).state
        extent = ((0.0, 0.72), (-0.005, 0.16))
        plot.frame(state, "pressure", ax=ax, title=title, extent=extent, limits=(0.0, 1800.0))
    return picture
