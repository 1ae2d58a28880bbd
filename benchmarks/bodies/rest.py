"""Beds at rest on an oblique plane, blocks on slopes."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np

import granular as gr
from bodies.flutter import FLUTTER_HZ, flutter
from bodies.rows import (
    CELL,
    PLACES,
    RHO,
    Cases,
    G,
    Line,
    Numbers,
    Row,
    Run,
    around,
    axes,
    name_of,
    plane,
    rows_of_points,
    spread,
    within,
)

# ---- a bed on a plane ----


def bed_scene(turned_deg: float, offset: float, dim: int = 2, seeded: str = "rows") -> Any:
    """A bed of 20 by 10 cells under its own weight, normal to a plane through the grid.

    Returned: the scene, a point of the plane, and its directions.
    """
    (t, n), length, height = axes(turned_deg, dim), 20 * CELL, 10 * CELL
    base = offset * CELL * (np.arange(dim) != 1 if dim == 3 else np.ones(2))
    corners = np.array([a * t + b * n for a in (0, length) for b in (0, height)]) + base
    material = gr.materials.glass_beads.replace(E=1e6, rho_c=RHO)
    spacing, width = CELL / 2, 4 * CELL if dim == 3 else 1.0
    if seeded == "grid":
        region: gr.shapes.Region = gr.Polygon(tuple(map(tuple, corners[[0, 2, 3, 1]])))
        fill = gr.Fill(region, 4, lithostatic=True, K0=1.0)
    else:
        along, above = rows_of_points(length, height, spacing)
        x = base + along[:, None] * t + above[:, None] * n
        if dim == 3:
            levels = spacing * (np.arange(round(width / spacing)) + 0.5)
            x = np.concatenate([x + y * np.eye(3)[1] for y in levels])
            above = np.tile(above, len(levels))
        p = RHO * G * (height - above)
        density = RHO * np.exp(p / material.K)
        fill = gr.Fill(gr.Cloud(x, np.full(len(x), spacing**dim), density=density), 2**dim)
    grid = around(corners, CELL)
    if dim == 3:
        lower = (grid.lower[0], 0.0, grid.lower[2])
        shape = (grid.shape[0], round(width / CELL), grid.shape[2])
        grid = gr.Grid(lower, CELL, shape, periodic=(False, True, False))
    scene = gr.Scene(
        name="bed",
        grid=grid,
        fills=(fill,),
        material=material,
        gravity=gr.Gravity((0.0,), (tuple(-G * n),)),
        duration=5.0,
        bodies=(plane(n, base, friction=0.5), plane(t, base), plane(-t, base + length * t)),
    )
    return scene, base, t, n


def bed(turned_deg: float, offset: float, until: float, **options: Any) -> Numbers:
    """Force on the base over the weight, pressure of the lowest points, and motion of the top.

    `pressure_nodes` is the pressure of `measure.smooth`, over the weight above in the same average.
    """
    scene, base, t, n = bed_scene(turned_deg, offset, **options)
    run = Run(scene)
    start = run.sim.state
    along, above = (start.x - base) @ t / CELL, (start.x - base) @ n / CELL
    middle = abs(along - 10) < 5
    first, top = middle & (above < 0.5), middle & (above > 9.5)
    weight_above = RHO * G * CELL * (10 - above[first])
    volume = start.volume[first]
    means: list[float] = []
    nodes: list[float] = []
    wanted = gr.measure.smooth(start, RHO * G * CELL * (10 - above))[first]

    def look(sim: Any) -> None:
        means.append(float(volume @ sim.state.pressure[first] / (volume @ weight_above)))
        smooth = gr.measure.smooth(sim.state, "pressure")[first]
        nodes.append(float(volume @ smooth / (volume @ wanted)))

    run.to(until, until / 40, look)
    rise = ((run.sim.state.x - start.x) @ n)[top] / CELL
    weight = G * float(start.mass.sum())
    later = means[len(means) // 4 :]
    return {
        "force": float(-run.force(until / 4)[0] @ n) / weight,
        "pressure": float(np.mean(later)),
        "pressure_least": min(later),
        "pressure_largest": max(later),
        "pressure_nodes": float(np.mean(nodes[len(nodes) // 4 :])),
        "creep": float(rise.mean()),
        "creep_largest": float(abs(rise).max()),
        "deepest": run.deepest,
    }


def bed_cases(quick: bool) -> Cases:
    until = 0.1 if quick else 2.0
    pairs = [(17.0, 0.25)] if quick else PLACES
    cases: Cases = {name_of(*pair): partial(bed, *pair, until) for pair in pairs}
    if not quick:
        for pair in pairs:
            cases["grid, " + name_of(*pair)] = partial(bed, *pair, until, seeded="grid")
        cases["3D, 17 deg, 0.25"] = partial(bed, 17.0, 0.25, until, dim=3)
    return cases


def bed_lines(results: dict[str, Numbers]) -> list[Line]:
    lines = []
    kinds = {"points in rows along the plane": False, "points in rows along the grid": True}
    for text, cut in kinds.items():
        some = [v for name, v in results.items() if name.startswith("grid") == cut]
        if some:
            lines += [
                within(f"force on the base, {text}", (v["force"] - 1 for v in some), 0.002),
                spread(
                    f"pressure of the first row, mean over time, {text}",
                    (v["pressure"] for v in some),
                    1.0,
                    0.05,
                ),
                spread(
                    f"pressure of the first row through nodes, {text}",
                    (v["pressure_nodes"] for v in some),
                    1.0,
                    0.05,
                ),
                within(
                    f"motion of the surface in 2 s, {text}",
                    (v["creep"] for v in some),
                    0.01,
                    "cells",
                ),
            ]
    return lines


# ---- a block on a slope ----

SLOPES = (25.0, 40.0)
RAMP, BEGIN = 0.1, 0.2
"""Times at which gravity is whole and at which the acceleration begins to be measured [s]."""
LONG = 3.0
"""End of the runs in which the block flutters [s]."""


def block_scene(
    turned_deg: float,
    offset: float,
    friction: float,
    slope_deg: float,
    until: float,
    dim: int = 2,
    wall: bool = False,
) -> gr.Scene:
    """An elastic block of 10 by 6 cells on a plane; gravity is at an angle to its normal.

    Gravity grows slowly, so that the block is in equilibrium with its weight. `wall` puts a wall
    of the grid instead of a body, for a plane along the grid.
    """
    (t, n), slope, spacing = axes(turned_deg, dim), math.radians(slope_deg), CELL / 2
    along, above = rows_of_points(0.1, 0.06, spacing)
    x = along[:, None] * t + above[:, None] * n + offset * CELL * n
    way = 0.5 * G * (math.sin(slope) - friction * math.cos(slope)) * until**2
    ends = np.array([a * t + b * n for a in (0.0, way + 0.15) for b in (-0.02, 0.06)])
    grid = around(ends, CELL)
    if wall:
        below = round(-grid.lower[1] / CELL)
        grid = gr.Grid((grid.lower[0], 0.0), CELL, (grid.shape[0], grid.shape[1] - below))
    if dim == 3:
        levels = spacing * (np.arange(12) + 0.5) + 0.02
        x = np.concatenate([x + y * np.eye(3)[1] for y in levels])
        lower = (grid.lower[0], 0.0, grid.lower[2])
        grid = gr.Grid(lower, CELL, (grid.shape[0], 10, grid.shape[2]))
    material = gr.Elastic(E=1e6, nu=0.3, rho_c=RHO)
    cloud = gr.Cloud(x, np.full(len(x), spacing**dim))
    along_slope = G * (math.sin(slope) * t - math.cos(slope) * n)
    return gr.Scene(
        name="block",
        grid=grid,
        fills=(gr.Fill(cloud, 2**dim),),
        material=material,
        gravity=gr.Gravity((0.0, RAMP), ((0.0,) * dim, tuple(along_slope))),
        duration=10.0,
        bodies=() if wall else (plane(n, offset * CELL * n, friction=friction),),
        walls=(gr.Wall(1, 0.0, kind="coulomb", friction=friction),) if wall else (),
    )


def block(
    turned_deg: float,
    offset: float,
    friction: float,
    slope_deg: float,
    until: float,
    dim: int = 2,
    wall: bool = False,
) -> Numbers:
    """Acceleration from `BEGIN` on, over g (sin - mu cos) and by the impulse."""
    t, n = axes(turned_deg, dim)
    slope = math.radians(slope_deg)
    run = Run(block_scene(turned_deg, offset, friction, slope_deg, until, dim, wall))
    mass = run.sim.state.mass.sum()
    run.to(BEGIN)
    since, before = run.sim.time, run.sim.state.mass @ run.sim.state.v / mass
    run.to(until)
    gained = (run.sim.state.mass @ run.sim.state.v / mass - before) / (run.sim.time - since)
    pushed = float(-run.force(since)[0] @ n / mass)
    wanted = G * (math.sin(slope) - friction * math.cos(slope))
    by_impulse = G * math.sin(slope) - friction * pushed
    return {
        "plain": float(gained @ t) / wanted,
        "by_impulse": float(gained @ t) / by_impulse,
        "normal": pushed / (G * math.cos(slope)),
        "deepest": max(run.deepest, -1.0),
    }


def block_cases(quick: bool) -> Cases:
    if quick:
        return {"0.4, slope 25 deg": partial(block, 17.0, 0.25, 0.4, 25.0, 0.25)}
    cases: Cases = {}
    for friction in (0.0, 0.2, 0.4):
        # With 0.4 the block flutters, and the error falls with the time.
        until = LONG if friction == 0.4 else 0.5
        for slope in SLOPES:
            for at in PLACES:
                name = f"{friction:g}, slope {slope:g}, {name_of(*at)}"
                cases[name] = partial(block, *at, friction, slope, until)
        for slope in SLOPES:
            name = f"{friction:g}, wall, slope {slope:g}"
            cases[name] = partial(block, 0.0, 0.0, friction, slope, until, wall=True)
        name = f"{friction:g}, slope 25, 3D, {name_of(17.0, 0.25)}"
        cases[name] = partial(block, 17.0, 0.25, friction, 25.0, until, dim=3)
        cases[f"growth, friction {friction:g}"] = partial(flutter, friction)
    return cases


def block_lines(results: dict[str, Numbers]) -> list[Line]:
    lines = []
    for friction in ("0", "0.2", "0.4"):
        for where, start in (("", "slope"), ("on a wall of the grid, ", "wall")):
            some = [v for name, v in results.items() if name.startswith(f"{friction}, {start}")]
            if not some:
                continue
            text = f"{where}friction {friction}, slopes of 25 and 40 deg"
            lines += [
                within(f"{text}: with the impulse", (v["by_impulse"] - 1 for v in some), 0.01),
                within(f"{text}: plainly", (v["plain"] - 1 for v in some), 0.03),
            ]
    growth = {k: v for k, v in results.items() if k.startswith("growth")}
    if growth:
        what = ", ".join(name.removeprefix("growth, friction ") for name in growth)
        rates = ", ".join(f"{v['rate']:.0f}/s" for v in growth.values())
        text = (
            f"growth of the vibration near {FLUTTER_HZ:.0f} Hz by finite elements, friction {what}"
        )
        lines.append(Line(text, "", rates, None))
    return lines


ROWS = {
    "bed": Row("Bed on an oblique plane at rest", bed_cases, bed_lines),
    "block": Row("Elastic block on a slope", block_cases, block_lines),
}
