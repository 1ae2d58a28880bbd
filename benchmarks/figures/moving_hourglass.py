"""Movie of an hourglass for the first pages: hourglass.gif of docs/pictures/."""

from __future__ import annotations

import matplotlib

import granular as gr
from figures.common import parser_of, tell

NECK, WIDE, MIDDLE, TOP = 0.035, 0.22, 0.33, 0.6
"""Half-widths of the neck and of the chambers; heights of the neck and of the glass [m]."""
SLOPE = 1.1
"""Rise of the funnels by their run."""


def hourglass(cell: float) -> gr.Scene:
    """Two chambers with a neck between them; the upper one is filled."""
    rise = SLOPE * (WIDE - NECK)
    low, high = MIDDLE - rise, MIDDLE + rise
    outer = WIDE + 2 * cell
    inner = [(NECK, MIDDLE), (WIDE, high), (WIDE, TOP)]
    glass = [*inner, (outer, TOP), (outer, 0.0), (WIDE, 0.0), (WIDE, low)]
    sides = [gr.shapes.Polygon([(side * x, y) for x, y in glass]) for side in (1, -1)]
    level = 0.53  # below the upper end of the funnel
    edge = [(NECK, MIDDLE), (NECK + (level - MIDDLE) / SLOPE, level)]
    fill = [(x - 0.25 * cell, y) for x, y in edge]
    columns, rows = 2 * round(outer / cell), round(TOP / cell)
    return gr.Scene(
        name="hourglass",
        grid=gr.Grid((-0.5 * columns * cell, 0.0), cell, (columns, rows)),
        fills=[gr.Fill(gr.Polygon([*fill, *((-x, y) for x, y in reversed(fill))]), 9)],
        walls=[gr.Wall(1, 0.0)],
        bodies=[gr.Body(side, (0.0, 0.0), friction=0.2) for side in sides],
        material=gr.materials.glass_beads.replace(E=1e6),
        gravity=gr.Gravity((0.0,), ((0.0, -9.8),)),
        duration=1.24,
    )


def main(argv: list[str] | None = None) -> None:
    chosen = parser_of(__doc__).parse_args(argv)
    simulation = gr.Simulation(hourglass(0.02 if chosen.quick else 0.0075))
    states = [simulation.state]
    every = 0.2 if chosen.quick else 0.02
    simulation.run(every=every, hooks=(lambda running: states.append(running.state),))
    tell(simulation)
    chosen.out.mkdir(parents=True, exist_ok=True)
    path = chosen.out / "hourglass.gif"
    with matplotlib.rc_context({"font.size": 15}):  # first pages show it small
        options = {"color": "speed", "limits": (0.0, 2.0), "fps": 25, "dpi": 60}
        gr.plot.movie(states, path, overwrite=True, **options)
    print(path)
