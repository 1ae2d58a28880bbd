"""Time that `sleep_speed` saves, and the change of the state that it makes.

Cases: a column that collapses and lies; a silo that discharges between corners at rest; a hopper
that is closed when half of its fill has left; a wheel that rolls, and a plate that is drawn,
through the end of a long bed; a bed at rest. One thread. Times are given for the last part of each
case and for the whole, since material sleeps only once it rests. The results of cases that are not
named remain.
"""

from __future__ import annotations

import time
from typing import Any

import beds
import numpy as np
from shared import by_scheme, parser_of, rounded, stored, table, write

import granular as gr

SPEED = 1e-3
SCHEMES = {"default": gr.schemes.default, "cell averaged": gr.schemes.cell_averaged}
GRAINS = gr.materials.glass_beads.replace(E=1e7)


def column(scheme: gr.Scheme) -> gr.Scene:
    """Return a column of aspect 2 that falls within 1 s, and lies for another."""
    return gr.scenes.column_collapse(E=1e7, scheme=scheme)


def silo(scheme: gr.Scheme) -> gr.Scene:
    """Return a silo with a flat floor, which discharges through a slot of 8 cells."""
    cell, width, gate = 0.0125, 0.5, 0.1
    low, high = round((width - gate) / 2 / cell) * cell, round((width + gate) / 2 / cell) * cell
    floor = [
        gr.Wall(1, 0.25, kind="no_slip", span=((0.0, low),)),
        gr.Wall(1, 0.25, kind="no_slip", span=((high, width),)),
    ]
    return gr.Scene(
        name="silo",
        grid=gr.Grid((0.0, 0.0), cell, (40, 80), open_sides=frozenset({"y-"})),
        fills=[gr.Fill(gr.Box((0.0, 0.25), (width, 0.85)), points_per_cell=16, lithostatic=True)],
        walls=[*floor, *(gr.Wall(0, at, kind="no_slip") for at in (0.0, width))],
        gravity=gr.Gravity((0.0,), ((0.0, -9.8),)),
        material=GRAINS,
        scheme=scheme,
        duration=1.5,
    )


def hopper(scheme: gr.Scheme) -> gr.Scene:
    """Return a hopper that a gate closes from below at 1.1 s, when half of its fill has left."""
    cell, thickness, closing = 0.0125, 0.05, (1.1, 1.3)
    flow = gr.scenes.hopper(
        cell=cell, points_per_cell=16, angle_deg=45.0, E=1e7, scheme=scheme, duration=3.3
    )
    # Its corners meet the underside of the hopper, which recedes at 45 degrees.
    below, closed = flow.grid.lower[1] - thickness, -cell - 0.5 * thickness
    speed = (closed - below) / (closing[1] - closing[0])
    still, up = (0.0, 0.0), (0.0, speed)
    times = (closing[0], closing[0] + 1e-3, closing[1], closing[1] + 1e-3)
    gate = gr.Body(
        gr.shapes.Box(size=(0.1 + 3 * cell, thickness)),
        position=(0.0, below),
        motion=gr.Motion(times=times, velocity=(still, up, up, still)),
        friction=0.2,
    )
    return flow.replace(bodies=(*flow.bodies, gate))


def wheel(scheme: gr.Scheme) -> gr.Scene:
    """Return the bed, and a wheel that rolls through its end with a slip of a fifth."""
    radius, speed = 0.1, 0.25
    rolling = gr.Motion(
        times=(0.2, 0.4),
        velocity=((0.0, 0.0), (speed, 0.0)),
        angular_velocity=(0.0, -speed / radius / (1 - 0.2)),
    )
    body = gr.Body(
        gr.shapes.Cylinder(radius, center=(0.0, 0.0)),
        position=(0.3, 0.2 + radius),
        motion=rolling,
        free="y",
        mass=25.0,
        friction=0.5,
    )
    return plate(scheme).replace(name="wheel", bodies=(body,))


def plate(scheme: gr.Scheme) -> gr.Scene:
    """Return a long bed, through one end of which a plate is drawn."""
    cell = 0.0125
    moving = gr.Motion(times=(0.3, 0.4), velocity=((0.0, 0.0), (0.25, 0.0)))
    body = gr.Body(
        gr.shapes.Box(size=(0.05, 0.2)), position=(0.3, 0.2), motion=moving, friction=0.3
    )
    parts = {"bodies": [body], "material": GRAINS, "scheme": scheme, "duration": 1.5}
    return beds.bed("plate", (2.5, 0.2), cell, 12, **parts)


def bed(scheme: gr.Scheme) -> gr.Scene:
    """Return the same bed without the plate."""
    return plate(scheme).replace(name="bed", bodies=(), duration=0.6)


CASES = {
    "column": column,
    "silo": silo,
    "hopper": hopper,
    "wheel": wheel,
    "plate": plate,
    "bed": bed,
}
LATE = 0.2
"""Last part of a case of which the time is given apart."""


def timed(scene: gr.Scene) -> tuple[gr.Simulation, float, float]:
    """Run a scene: its end, and processor time of the whole and of the last part [s per s]."""
    sim, start = gr.Simulation(scene, threads=1), time.process_time()
    sim.run(until=(1 - LATE) * scene.duration)
    middle = time.process_time()
    sim.run(until=scene.duration)
    end = time.process_time()
    return sim, (end - start) / scene.duration, (end - middle) / (LATE * scene.duration)


def compare(name: str, scheme: gr.Scheme) -> dict[str, Any]:
    """Run a case without sleep and with it."""
    build = CASES[name]
    whole, plain, plain_late = timed(build(scheme))
    slept, quick, quick_late = timed(build(scheme.replace(sleep_speed=SPEED)))
    a, b = whole.state, slept.state
    common = np.isin(a.id, b.id), np.isin(b.id, a.id)
    moved = np.linalg.norm(a.x[common[0]] - b.x[common[1]], axis=1) / whole.scene.grid.cell
    result = {
        "points": whole.n_points,
        "asleep": float((b.v == 0).all(axis=1).mean()),
        "time": plain,
        "time_late": plain_late,
        "share": quick / plain,
        "share_late": quick_late / plain_late,
        "moved_mean": float(moved.mean()),
        "moved_most": float(moved.max()),
        "points_changed": (slept.n_points - whole.n_points) / whole.n_points,
    }
    if whole.bodies:
        force = [float(sim.bodies[0].impulse[0]) for sim in (whole, slept)]
        result["impulse_changed"] = force[1] / force[0] - 1
    return result


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page."""
    columns = {
        "case": "{case}",
        "scheme": "{scheme}",
        "asleep at the end": "{asleep:.0%}",
        "processor time without sleep, s per simulated s": "{time:.1f}",
        "with sleep": "{with_sleep:.1f}",
        "time over that without sleep": "{share:.2f}",
        f"the last {LATE:.0%}": "{share_late:.3f}",
        "points moved otherwise, mean, cells": "{moved_mean:.4f}",
    }
    rows = by_scheme(results["cases"])
    return {"sleep": table((r | {"with_sleep": r["time"] * r["share"]} for r in rows), columns)}


def main() -> None:
    """Run the cases of the command line."""
    parser = parser_of(__name__, __doc__)
    parser.add_argument("cases", nargs="*", default=list(CASES))
    args = parser.parse_args()
    names = args.cases[-1:] if args.quick else args.cases
    cases = stored(args.out, cases={})["cases"] | {
        case: {name: compare(case, scheme) for name, scheme in SCHEMES.items()} for case in names
    }
    cases = {case: cases[case] for case in CASES if case in cases}
    write(args.out, {"sleep_speed": SPEED, "cases": rounded(cases, 4)})
