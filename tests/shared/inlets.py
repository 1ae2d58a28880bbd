"""Scenes with inflows for tests."""

import numpy as np
from scenes_by_hand import scene_with

import granular as gr

CELL = 0.02
H = CELL / 2
SAND = gr.MuI(E=1e6)


def stream(*, dim=2, gravity=0.0, duration=0.3, inflow=None, **more):
    """A stream that falls from an inlet 0.2 m wide, at 1 m/s, through an open bottom."""
    width, depth = (20, *(8,) * (dim - 2)), 40
    region = gr.Box((0.1, *(0.04,) * (dim - 2), 0.7), (0.3, *(0.12,) * (dim - 2), 0.74))
    given = {"velocity": (0.0,) * (dim - 1) + (-1.0,), "points_per_cell": 2**dim}
    return scene_with(
        **{
            "grid": gr.Grid((0.0,) * dim, CELL, (*width, depth), open_sides={f"{'yz'[dim - 2]}-"}),
            "fills": (),
            "inflows": (gr.Inflow(region, **given | (inflow or {})),),
            "material": SAND,
            "gravity": gravity,
            "duration": duration,
        }
        | more
    )


def chute(*, speed=0.8, height=0.12, angle_deg=24.0, end=np.inf, **more):
    """A layer that a piston pushes down a rough chute of 0.6 m."""
    slope = np.radians(angle_deg)
    return scene_with(
        **{
            "grid": gr.Grid((0.0, 0.0), CELL, (30, 12), open_sides={"x+"}),
            "fills": (gr.Fill(gr.Box((0.1, 0.0), (0.3, height)), 4, velocity=(speed, 0.0)),),
            "inflows": (
                gr.Inflow(
                    gr.Box((0.0, 0.0), (0.1, height)),
                    (speed, 0.0),
                    4,
                    lithostatic=True,
                    driven=True,
                    times=(0.0, end),
                ),
            ),
            "walls": (gr.Wall(1, 0.0),),
            "material": SAND,
            "gravity": (9.81 * np.sin(slope), -9.81 * np.cos(slope)),
            "duration": 0.4,
        }
        | more
    )


def fed_gas(**more):
    """A bed into which a jet of gas blows, by SPH."""
    given = {"speed": 50.0, "width": 0.2, "depth": 0.06, "headroom": 0.12, "spacing": 0.02}
    return gr.scenes.jet_on_bed(**given | {"nozzle": 0.08, "duration": 0.01} | more)
