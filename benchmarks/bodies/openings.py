"""Discharge through a slot between two plates (2D) and through a round hole in a plate (3D)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import granular as gr
from bodies.rows import (
    OFFSETS,
    PLACES,
    RHO,
    Cases,
    G,
    Line,
    Numbers,
    Row,
    Run,
    axes,
    name_of,
    plane,
    rows_of_points,
)
from granular.tools.arrays import Array

WIDTH = 0.08
"""Width of the slot and diameter of the hole [m]."""

THICK = 0.03
"""Thickness of the plates [m]."""

LEAST = 6
"""Cells in an opening from which on its width is extrapolated."""

BEADS = gr.materials.glass_beads.replace(E=1e6, rho_c=RHO)


def _rate(run: Run, above: Callable[[Array], Any], since: float, until: float) -> Numbers:
    """Rate at which the mass above the opening falls [kg/s], by a line through 20 frames."""
    frames: list[tuple[float, float]] = []

    def look(sim: Any) -> None:
        state = sim.state
        frames.append((sim.time, float(state.mass[above(state.x)].sum())))

    run.to(since)
    run.to(until, (until - since) / 20, look)
    times, mass = np.array(frames).T
    rates = [
        np.polyfit(t, m, 1)[0]
        for t, m in zip(np.split(times[:20], 4), np.split(mass[:20], 4), strict=True)
    ]
    return {
        "rate": -float(np.polyfit(times, mass, 1)[0]),
        "spread": float(np.std(rates) / 2 / abs(np.mean(rates))),
        "deepest": run.deepest,
    }


def slot(turned_deg: float, offset: float, cells: int) -> Numbers:
    """Discharge of a bin 0.24 m wide through a slot between two plates 3 cm thick [kg/(s m)]."""
    cell, (t, n) = WIDTH / cells, axes(turned_deg)
    center = np.array([0.30, 0.18]) + offset * cell * np.array([1.0, 0.5])
    long, height = 0.24, 0.30
    along, above = rows_of_points(long, height, cell / 2)
    density = RHO * np.exp(RHO * G * 0.5 * (height - above) / BEADS.K)
    cloud = gr.Cloud(
        center + (along - long / 2)[:, None] * t + above[:, None] * n,
        np.full(len(along), cell**2 / 4),
        density=density,
    )
    plates = (
        gr.Body(
            gr.Box(size=(0.5, THICK), center=(side * (WIDTH / 2 + 0.25), -THICK / 2)),
            tuple(center),
            rotation_deg=turned_deg,
            friction=0.3,
        )
        for side in (-1, 1)
    )
    sides = (plane(-s * t, center + s * long / 2 * t) for s in (-1, 1))
    shape = round(0.64 / cell)
    scene = gr.Scene(
        name="slot",
        grid=gr.Grid((0.0, 0.0), cell, (shape, shape), open_sides={"y-", "x-", "x+"}),
        fills=(gr.Fill(cloud, 4),),
        material=BEADS,
        gravity=gr.Gravity((0.0,), (tuple(-G * n),)),
        duration=2.0,
        bodies=(*plates, *sides),
    )
    return _rate(Run(scene), lambda x: (x - center) @ n > -THICK, 0.15, 0.45)


def slot_cases(quick: bool) -> Cases:
    if quick:
        return {"6 cells, 17 deg, 0": partial(slot, 17.0, 0.0, 6)}
    cases: Cases = {}
    for cells in (6, 8, 10, 12, 16, 24):
        for at in PLACES:
            cases[f"{cells} cells, {name_of(*at)}"] = partial(slot, *at, cells)
    return cases


def hole(offset: float, cells: int, turned_deg: float = 0.0) -> Numbers:
    """Discharge of a bin 0.16 m square and 0.12 m high through a round hole in its floor [kg/s].

    A quarter of it between smooth walls, unless it is turned about y.
    """
    cell, half, height, radius = WIDTH / cells, 0.08, 0.12, WIDTH / 2
    level, quarter = offset * cell, turned_deg == 0.0
    (t, n), y = axes(turned_deg, 3), np.eye(3)[1]
    floor = gr.Difference(
        gr.Box(size=(1.0, 1.0, THICK), center=(0.0, 0.0, -THICK / 2)),
        gr.Cylinder(radius, center=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)),
    )
    across, low = round(half / cell), -round(0.05 / cell)
    spacing = cell / 2
    start = 0 if quarter else -half
    a = start + spacing * (np.arange(round((half - start) / spacing)) + 0.5)
    b = spacing * (np.arange(round(height / spacing)) + 0.5)
    along, aside, above = (c.ravel() for c in np.meshgrid(a, a, b))
    base = level * np.array([0.0, 0.0, 1.0]) if quarter else level * np.array([1.0, 0.6, 1.0])
    density = RHO * np.exp(RHO * G * 0.5 * (height - above) / BEADS.K)
    cloud = gr.Cloud(
        base + along[:, None] * t + aside[:, None] * y + above[:, None] * n,
        np.full(len(along), spacing**3),
        density=density,
    )
    bodies = [gr.Body(floor, tuple(base), rotation_deg=(0.0, -turned_deg, 0.0), friction=0.3)]
    if quarter:
        grid = gr.Grid(
            (0.0, 0.0, low * cell),
            cell,
            (across, across, round(height / cell) + 2 - low),
            open_sides={"z-"},
        )
        ends = ((axis, at) for axis in (0, 1) for at in (0.0, half))
        walls = tuple(gr.Wall(axis, at, kind="free_slip") for axis, at in ends)
    else:
        reach = math.ceil(0.22 / cell)
        grid = gr.Grid(
            (-reach * cell, -(across + 4) * cell, -reach * cell),
            cell,
            (2 * reach, 2 * across + 8, 2 * reach),
            open_sides={"x-", "x+", "z-"},
        )
        walls = ()
        for side in (-1, 1):
            bodies.append(plane(-side * t, base + side * half * t))
            bodies.append(plane(-side * y, base + side * half * y))
    scene = gr.Scene(
        name="hole",
        grid=grid,
        fills=(gr.Fill(cloud, 8),),
        material=BEADS,
        gravity=gr.Gravity((0.0,), (tuple(-G * n),)),
        duration=2.0,
        walls=walls,
        bodies=tuple(bodies),
    )
    flow = _rate(Run(scene), lambda x: (x - base) @ n > -THICK, 0.1, 0.2)
    return {**flow, "rate": flow["rate"] * (4 if quarter else 1)}


def hole_cases(quick: bool) -> Cases:
    if quick:
        return {"6 cells, 0 deg, 0": partial(hole, 0.0, 6)}
    cases: Cases = {
        f"{cells} cells, {name_of(0.0, offset)}": partial(hole, offset, cells)
        for cells in (4, 6, 8, 12, 16, 24)
        for offset in (OFFSETS if cells < 24 else (0.25,))
    }
    cases[f"8 cells, {name_of(17.0, 0.25)}"] = partial(hole, 0.25, 8, 17.0)
    return cases


def width_lines(results: dict[str, Numbers], exponent: float, what: str) -> list[Line]:
    """Lines on the width as which an opening acts.

    The rate goes with a power of the width, so that an opening acts as W (Q/Q_0)^(1/exponent), with
    Q_0 for cells without end in fineness: the width is extrapolated to them, at first order.
    """
    sizes = np.array([int(name.split(" cells")[0]) for name in results])
    wide = np.array([numbers["rate"] for numbers in results.values()]) ** (1 / exponent)
    fine = sizes >= LEAST
    if len(np.unique(sizes[fine])) < 3:
        return []
    limit = gr.measure.richardson(1 / sizes[fine], wide[fine], order=1.0)
    lines = []
    for cells in np.unique(sizes):
        off = cells * (wide[sizes == cells] / limit.limit - 1)
        name = f"{what} of {cells} cells acts wider by"
        text = f"{off.min():+.2f} to {off.max():+.2f} cells"
        if len(off) == 1:
            text = f"{off[0]:+.2f} cells"
        lines.append(Line(name, "0.1 cells", text, bool(abs(off).max() <= 0.1)))
        if len(off) > 1:
            lines.append(Line("the same, mean of all", "", f"{off.mean():+.2f} cells", None))
    error = 8 * limit.uncertainty / limit.limit
    name = f"width extrapolated at first order, uncertainty (95 %) in cells of which {what} has 8"
    return [*lines, Line(name, "0.1 cells", f"{error:.3f} cells", error <= 0.1)]


ROWS = {
    "slot": Row(
        "Slot between two plates, 2D", slot_cases, partial(width_lines, exponent=1.5, what="slot")
    ),
    "hole": Row(
        "Round hole in a plate, 3D", hole_cases, partial(width_lines, exponent=2.5, what="hole")
    ),
}
