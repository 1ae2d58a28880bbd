"""A wheel that rolls onto a bed and a block that tips over a step, for docs/how-to/free_bodies.md.

The whole takes some seconds.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import granular as gr
from figures.common import tell
from granular.plot import Picture

SHOWN = {
    "rolling_wheel": ((0.0, 0.54, 1.0), ((-0.34, 0.42), (-0.08, 0.24)), (0.0, 1.0)),
    "tumbling_block": ((0.12, 0.3, 0.8), ((-0.18, 0.5), (-0.08, 0.24)), (0.0, 0.5)),
}
"""Times [s] of the frames of each scene, the extent of its picture [m], and the speeds [m/s]."""


def picture(quick: bool) -> Picture:
    """Draw the picture of the page."""
    made = Picture(figsize=(7.0, 2.8), layout="compressed")
    axes = made.subplots(2, 3)
    for row, (name, (times, extent, limits)) in zip(axes, SHOWN.items(), strict=True):
        scene = gr.scenes.registry[name](cell=0.02 if quick else 0.01)
        with TemporaryDirectory() as folder:
            path = Path(folder, "run.h5")
            until = 0.02 if quick else max(times) + 0.01
            tell(gr.Simulation(scene).run(until=until, save=path, every=0.02))
            record = gr.open(path)
            for ax, time in zip(row, times, strict=True):
                k = min(round(time / 0.02), len(record) - 1)
                common = {"limits": limits, "extent": extent, "bar": ax is row[-1]}
                title = f"t = {record[k].time:.2f} s"
                gr.plot.frame(record[k], "speed", ax=ax, title=title, **common)
    return made
