"""Beds at rest on an oblique plane, blocks on slopes, forces on what lies in a bed."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

import granular as gr
from granular.mpm.bodies import Body, Box, Cylinder, Offset, Sphere
from surfaces.flutter import FLUTTER_HZ, flutter
from surfaces.rows import (
    CELL,
    OFFSETS,
    RHO,
    TURNS,
    Array,
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
    slippery,
    spread,
    within,
)

Cases = dict[str, Callable[[], Numbers]]

PARTICLE = "`ParticleDensity`, "
DENSITIES = {"": gr.schemes.default, PARTICLE: gr.Scheme(density=gr.ParticleDensity())}
"""Schemes of the forces on what lies in a bed, by the begin of the names of their cases."""

# ---- a bed on a plane ----


def bed_scene(turned_deg: float, offset: float, dim: int = 2, seeded: str = "rows") -> Any:
    """A bed of 20 by 10 cells under its own weight, normal to a plane through the grid.

    Returned: the scene, a place of the plane, and its directions.
    """
    (t, n), length, height = axes(turned_deg, dim), 20 * CELL, 10 * CELL
    base = offset * CELL * (np.arange(dim) != 1 if dim == 3 else np.ones(2))
    corners = np.array([a * t + b * n for a in (0, length) for b in (0, height)]) + base
    material = gr.materials.glass_beads.replace(E=1e6, rho_c=RHO)
    spacing, width = CELL / 2, 4 * CELL if dim == 3 else 1.0
    if seeded == "grid":
        region: gr.Region = gr.Polygon(tuple(map(tuple, corners[[0, 2, 3, 1]])))
        fill = gr.Fill(region, 4, lithostatic=True)
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

    `pressure_nodes` is that of `measure.smooth`, over the weight above in the same average.
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
    pairs = [(17.0, 0.25)] if quick else [(a, b) for a in TURNS for b in OFFSETS]
    cases: Cases = {name_of(*pair): partial(bed, *pair, until) for pair in pairs}
    if not quick:
        for pair in pairs:
            cases["grid, " + name_of(*pair)] = partial(bed, *pair, until, seeded="grid")
        cases["3D, 17 deg, 0.25"] = partial(bed, 17.0, 0.25, until, dim=3)
    return cases


def bed_lines(found: dict[str, Numbers]) -> list[Line]:
    lines = []
    kinds = {"points in rows along the plane": False, "points in rows along the grid": True}
    for text, cut in kinds.items():
        some = [v for name, v in found.items() if name.startswith("grid") == cut]
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
) -> gr.Scene:
    """An elastic block of 10 by 6 cells on a plane; gravity is at an angle to its normal.

    Gravity grows slowly, so that the block is in equilibrium with its weight.
    """
    (t, n), slope, spacing = axes(turned_deg, dim), math.radians(slope_deg), CELL / 2
    along, above = rows_of_points(0.1, 0.06, spacing)
    x = along[:, None] * t + above[:, None] * n + offset * CELL * n
    way = 0.5 * G * (math.sin(slope) - friction * math.cos(slope)) * until**2
    ends = np.array([a * t + b * n for a in (0.0, way + 0.15) for b in (-0.02, 0.06)])
    grid = around(ends, CELL)
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
        bodies=(plane(n, offset * CELL * n, friction=friction),),
    )


def block(
    turned_deg: float, offset: float, friction: float, slope_deg: float, until: float, dim: int = 2
) -> Numbers:
    """Acceleration from `BEGIN` on, over g (sin - mu cos) and by the impulse."""
    t, n = axes(turned_deg, dim)
    slope = math.radians(slope_deg)
    run = Run(block_scene(turned_deg, offset, friction, slope_deg, until, dim))
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
        "deepest": run.deepest,
    }


def block_cases(quick: bool) -> Cases:
    if quick:
        return {"0.4, slope 25 deg": partial(block, 17.0, 0.25, 0.4, 25.0, 0.25)}
    cases: Cases = {}
    for friction in (0.0, 0.2, 0.4):
        # With 0.4 the block flutters, and the error falls with the time.
        until = LONG if friction == 0.4 else 0.5
        for slope in SLOPES:
            for turned in TURNS:
                for offset in OFFSETS:
                    name = f"{friction:g}, slope {slope:g}, {name_of(turned, offset)}"
                    cases[name] = partial(block, turned, offset, friction, slope, until)
        name = f"{friction:g}, slope 25, 3D, {name_of(17.0, 0.25)}"
        cases[name] = partial(block, 17.0, 0.25, friction, 25.0, until, dim=3)
        cases[f"growth, friction {friction:g}"] = partial(flutter, friction)
    return cases


def block_lines(found: dict[str, Numbers]) -> list[Line]:
    lines = []
    for friction in ("0", "0.2", "0.4"):
        some = [v for name, v in found.items() if name.startswith(f"{friction}, ")]
        if some:
            text = f"friction {friction}, slopes of 25 and 40 deg"
            lines += [
                within(f"{text}: with the impulse", (v["by_impulse"] - 1 for v in some), 0.01),
                within(f"{text}: plainly", (v["plain"] - 1 for v in some), 0.03),
            ]
    growth = {k: v for k, v in found.items() if k.startswith("growth")}
    if growth:
        what = ", ".join(name.removeprefix("growth, friction ") for name in growth)
        rates = ", ".join(f"{v['rate']:.0f}/s" for v in growth.values())
        text = (
            f"growth of the vibration near {FLUTTER_HZ:.0f} Hz by finite elements, friction {what}"
        )
        lines.append(Line(text, "", rates, None))
    return lines


# ---- forces on what lies in a bed ----


def hydrostatic(depth: float | Array) -> Any:
    """Pressure at a depth in a fluid with the elasticity of `slippery` [Pa]."""
    return -slippery.K * np.log1p(-RHO * G * np.asarray(depth) / slippery.K)


def displaced(volume: float, depth: float) -> float:
    """Weight of a volume of that fluid at a depth [N]."""
    return volume * G * RHO * math.exp(float(hydrostatic(depth)) / slippery.K)


def spans(until: float) -> tuple[tuple[str, float, float], ...]:
    """Two parts of a run, the first quarter of its time and the rest: name, begin and end [s]."""
    return ("early", 0.0, until / 4), ("late", until / 4, until)


WHEN = {"early": "0 to 0.1 s", "late": "0.1 to 0.4 s"}


def in_a_bed(
    bodies: tuple[Body, ...],
    size: tuple[float, ...],
    cell: float,
    material: Any = slippery,
    scheme: gr.Scheme = gr.schemes.default,
) -> gr.Scene:
    """Nearly a fluid at rest in a box between smooth walls, with bodies in it."""
    dim, level = len(size), size[-1]
    shape = tuple(round(side / cell) for side in size[:-1])
    walls = [gr.Wall(a, at, kind="free_slip") for a in range(dim - 1) for at in (0.0, size[a])]
    return gr.Scene(
        name="in_a_bed",
        grid=gr.Grid((0.0,) * dim, cell, (*shape, round(level / cell) + 4)),
        fills=(gr.Fill(gr.Box((0.0,) * dim, size), 2**dim, lithostatic=True),),
        material=material,
        scheme=scheme,
        gravity=gr.Gravity((0.0,), ((0.0,) * (dim - 1) + (-G,),)),
        walls=(*walls, gr.Wall(dim - 1, 0.0, kind="free_slip")),
        bodies=bodies,
        duration=1.0,
    )


def plate(
    turned_deg: float,
    offset: float,
    cells: int,
    until: float,
    mu: float = 0.01,
    scheme: gr.Scheme = gr.schemes.default,
) -> Numbers:
    """Forces on the two faces of a plate 0.16 m long and 4 cells thick, over those of a fluid.

    It is two bodies that overlap, so that the force on each face is known.
    """
    cell, height, length = 0.16 / cells, 0.32, 0.16
    center = np.array([0.16, 0.16]) + offset * cell
    shapes = [Box((length, 3 * cell), center=(0.0, side * cell / 2)) for side in (1, -1)]
    bodies = tuple(Body(shape, tuple(center), rotation_deg=turned_deg) for shape in shapes)
    material = slippery.replace(mu_s=mu, mu_2=2 * mu)
    run = Run(in_a_bed(bodies, (0.32, height), cell, material, scheme))
    _, n = axes(turned_deg)
    numbers: Numbers = {}
    for name, since, to in spans(until):
        run.to(to, until / 40)
        for face, force, side in zip(("upper", "lower"), run.force(since), (1, -1), strict=True):
            depth = height - float((center + side * 2 * cell * n)[1])
            wanted = -side * float(hydrostatic(depth)) * length
            numbers[f"{face}_{name}"] = float(force @ n) / wanted
    return {**numbers, "deepest": run.deepest}


def rounded_plate(
    turned_deg: float,
    offset: float,
    cells: int,
    until: float,
    scheme: gr.Scheme = gr.schemes.default,
) -> Numbers:
    """Upward force on such a plate with edges rounded by 1.95 cells, over the weight displaced."""
    cell, height = 0.16 / cells, 0.32
    radius, center = 1.95 * cell, np.array([0.16, 0.16]) + offset * cell
    sides = (0.16 - 2 * radius, 4 * cell - 2 * radius)
    body = Body(Offset(Box(sides), by=radius), tuple(center), rotation_deg=turned_deg)
    run = Run(in_a_bed((body,), (0.32, height), cell, scheme=scheme))
    area = 0.16 * 4 * cell - (4 - math.pi) * radius**2
    weight = displaced(area, height - center[1])
    numbers: Numbers = {}
    for name, since, to in spans(until):
        run.to(to, until / 40)
        up = run.force(since)[0] / weight
        numbers |= {name: float(up[1]), f"sideways_{name}": float(up[0])}
    return {**numbers, "deepest": run.deepest}


def plate_cases(quick: bool) -> Cases:
    if quick:
        return {"8 cells": partial(plate, 17.0, 0.25, 8, 0.04)}
    cases: Cases = {}
    for kind, scheme in DENSITIES.items():
        for cells in (8, 16, 32):
            for turned in TURNS:
                for offset in OFFSETS if cells < 32 else (0.25,):
                    name = f"{kind}{cells} cells, {name_of(turned, offset)}"
                    cases[name] = partial(plate, turned, offset, cells, 0.4, scheme=scheme)
        for turned in TURNS:
            for offset in OFFSETS:
                name = f"{kind}rounded, {name_of(turned, offset)}"
                cases[name] = partial(rounded_plate, turned, offset, 16, 0.4, scheme)
    for turned in TURNS:
        for offset in OFFSETS:
            name = name_of(turned, offset)
            cases[f"mu 0.1, {name}"] = partial(plate, turned, offset, 16, 0.4, 0.1)
    return cases


def plate_lines(found: dict[str, Numbers]) -> list[Line]:
    lines = []
    kinds = {
        f"{kind}{cells} cells": f"{kind}sharp edges, {cells} cells"
        for kind in DENSITIES
        for cells in (8, 16, 32)
    }
    kinds["mu 0.1"] = "sharp edges, 16 cells, internal friction 0.1"
    for start, text in kinds.items():
        some = [v for name, v in found.items() if name.startswith(start)]
        for when, span in WHEN.items():
            if some:
                values = [v[f"{face}_{when}"] for v in some for face in ("upper", "lower")]
                lines.append(spread(f"force on a face, {text}, {span}", values, 1.0, 0.02))
    for kind in DENSITIES:
        some = [v for name, v in found.items() if name.startswith(f"{kind}rounded")]
        for when, span in WHEN.items():
            if some:
                text = f"buoyancy, {kind}edges rounded by 2 cells, 16 cells, {span}"
                lines.append(spread(text, [v[when] for v in some], 1.0, 0.05))
    return lines


def buoyancy(
    dim: int, cells: int, offset: float, until: float, scheme: gr.Scheme = gr.schemes.default
) -> Numbers:
    """Upward force on a disc or a sphere over the weight of the fluid it displaces."""
    radius = 0.04
    cell = radius / cells
    size = (0.32, 0.24) if dim == 2 else (0.16, 0.16, 0.16)
    center = np.array(size) / 2 + cell * offset * np.array((1.0, 0.6, 0.4)[:dim])
    shape = Cylinder(radius, center=(0.0,) * 2) if dim == 2 else Sphere(radius, center=(0.0,) * 3)
    run = Run(in_a_bed((Body(shape, tuple(center)),), size, cell, scheme=scheme))
    volume = math.pi * radius**2 if dim == 2 else 4 / 3 * math.pi * radius**3
    weight = displaced(volume, size[-1] - center[-1])
    numbers: Numbers = {}
    for name, since, to in spans(until):
        run.to(to, until / 40)
        numbers[name] = float(run.force(since)[0][-1] / weight)
    return {**numbers, "deepest": run.deepest}


def buoyancy_cases(quick: bool) -> Cases:
    if quick:
        return {"disc, 4 cells": partial(buoyancy, 2, 4, 0.25, 0.04)}
    cases: Cases = {
        f"{kind}, {cells} cells, {offset:g}": partial(buoyancy, dim, cells, offset, 0.4)
        for dim, kind, sizes in ((2, "disc", (4, 8)), (3, "sphere", (4,)))
        for cells in sizes
        for offset in OFFSETS
    }
    cases["sphere, 6 cells, 0.25"] = partial(buoyancy, 3, 6, 0.25, 0.4)
    for cells in (4, 8):
        for offset in OFFSETS:
            name = f"{PARTICLE}disc, {cells} cells, {offset:g}"
            cases[name] = partial(buoyancy, 2, cells, offset, 0.4, DENSITIES[PARTICLE])
    return cases


def buoyancy_lines(found: dict[str, Numbers]) -> list[Line]:
    lines = []
    discs = [f"{kind}disc, {cells}" for kind in DENSITIES for cells in (4, 8)]
    for kind in (*discs, "sphere, 4", "sphere, 6"):
        some = [v for name, v in found.items() if name.startswith(f"{kind} cells")]
        for when, span in WHEN.items():
            if some:
                values = [v[when] for v in some]
                lines.append(spread(f"{kind} cells in radius, {span}", values, 1.0, 0.05))
    return lines


ROWS = {
    "bed": Row("Bed on an oblique plane at rest", bed_cases, bed_lines),
    "block": Row("Elastic block on a slope", block_cases, block_lines),
    "plate": Row("Plate in a bed at rest", plate_cases, plate_lines),
    "buoyancy": Row("Buoyancy of a disc and a sphere", buoyancy_cases, buoyancy_lines),
}
