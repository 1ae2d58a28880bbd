"""Bodies that cross cells: a box that carries a bed, a drum that turns, a blade in a bed."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from beds import bed

import granular as gr
from bodies.rows import (
    CELL,
    OFFSETS,
    PLACES,
    RHO,
    TURNS,
    Cases,
    G,
    Line,
    Numbers,
    Row,
    Run,
    around,
    axes,
    name_of,
    rows_of_points,
    within,
)
from granular.tools.arrays import Array

WINDOWS = 8
"""Windows of time in which a body crosses a cell."""

PARTICLE = gr.Scheme(density=gr.ParticleDensity())
"""The default scheme without the density correction."""


def _spikes(name: str, values: Array) -> Numbers:
    """Largest differences of values in eighths of a cell from the mean of the cell about them.

    Relative to the mean of all. `name_crossing`: of the mean over all cells crossed of each eighth,
    which is the effect of the grid; changes from cell to cell average out.
    """
    mean = abs(values.mean())
    about = np.convolve(values, np.full(WINDOWS, 1 / WINDOWS), mode="valid")
    off = values[WINDOWS // 2 : WINDOWS // 2 + len(about)] - about
    eighths = off[: len(off) // WINDOWS * WINDOWS].reshape(-1, WINDOWS).mean(axis=0)
    return {
        f"{name}_spike": float(np.abs(off).max() / mean),
        f"{name}_crossing": float(np.abs(eighths).max() / mean),
    }


def box(
    turned_deg: float, offset: float, speed: float, crossed: float, staggered: bool = False
) -> Numbers:
    """A box carries a bed of 12 by 10 cells at rest in it through the grid, at 30 deg to x.

    The points stand in rows along the box, as a `Cloud`, or belong to a `Fill` whose columns are
    `staggered` along the grid.
    """
    (t, n), length, height = axes(turned_deg), 12 * CELL, 10 * CELL
    way = speed * np.array([math.cos(math.radians(30)), math.sin(math.radians(30))])
    base = offset * CELL * np.ones(2)
    along, above = rows_of_points(length, height, CELL / 2)
    material = gr.materials.glass_beads.replace(E=1e6, rho_c=RHO)
    density = RHO * np.exp(RHO * G * (height - above) / material.K)
    x = base + along[:, None] * t + above[:, None] * n
    region: gr.shapes.Region = gr.Cloud(x, np.full(len(x), CELL**2 / 4), density=density)
    if staggered:
        region = gr.Box(tuple(base), tuple(base + length * t + height * n))
    until = crossed * CELL / speed
    ends = np.concatenate([x, x + until * way])
    motion = gr.Motion(velocity=(tuple(way),))
    faces = ((n, base, 0.5), (t, base, 0.0), (-t, base + length * t, 0.0))
    bodies = tuple(
        gr.Body(gr.HalfSpace(tuple(face)), tuple(at), motion=motion, friction=friction)
        for face, at, friction in faces
    )
    start = {"stagger": True, "lithostatic": True, "K0": 1.0} if staggered else {}
    scene = gr.Scene(
        name="box",
        grid=around(ends, CELL),
        fills=(gr.Fill(region, 4, velocity=tuple(way), **start),),
        material=material,
        gravity=gr.Gravity((0.0,), (tuple(-G * n),)),
        duration=5.0,
        bodies=bodies,
    )
    run = Run(scene)
    x = run.sim.state.x
    above = (x - base) @ n
    weight, lowest = RHO * G * (height - above), [above < CELL / 2, above < CELL]
    pressures: list[list[float]] = []

    def look(sim: Any) -> None:
        p = sim.state.pressure
        ratios = [float(p[some].mean() / weight[some].mean()) for some in lowest]
        smooth, wanted = gr.measure.smooth(sim.state, np.stack([p, weight], axis=1))[lowest[0]].T
        pressures.append([*ratios, float(smooth.mean() / wanted.mean())])

    run.to(until, CELL / speed / WINDOWS, look)
    since = 2 * CELL / speed
    forces = -run.forces(since)[:, 0] @ n / (G * float(run.sim.state.mass.sum()))
    first, cell, nodes = np.array(pressures[2 * WINDOWS :]).T
    moved = (run.sim.state.x - x) - run.sim.time * way
    return {
        "force": float(forces.mean()),
        **_spikes("force", forces),
        "pressure": float(first.mean()),
        **_spikes("pressure", first),
        "pressure_cell": float(cell.mean()),
        **_spikes("pressure_cell", cell),
        "pressure_nodes": float(nodes.mean()),
        **_spikes("pressure_nodes", nodes),
        "moved": float(np.linalg.norm(moved, axis=1).max()) / CELL,
        "deepest": run.deepest,
    }


def box_cases(quick: bool) -> Cases:
    if quick:
        return {"17 deg, 0": partial(box, 17.0, 0.0, 0.4, 4)}
    cases: Cases = {}
    for speed in (0.1, 0.4):
        for at in PLACES:
            cases[f"{speed:g} m/s, {name_of(*at)}"] = partial(box, *at, speed, 10)
        for offset in OFFSETS:
            name = f"{speed:g} m/s, staggered, {name_of(0.0, offset)}"
            cases[name] = partial(box, 0.0, offset, speed, 10, staggered=True)
    return cases


def drum(omega: float, cell: float, turns: float) -> Numbers:
    """Force of the bed on a drum half full, over its weight, from half of the time on."""
    run = Run(gr.scenes.rotating_drum(radius=0.1, omega=omega, cell=cell))
    crossing = cell / (omega * 0.1)
    weight = 9.8 * float(run.sim.state.mass.sum())
    until = turns * 2 * math.pi / omega
    run.to(until / 2, crossing / WINDOWS)
    run.to(until, crossing / WINDOWS)
    forces = -run.forces(until / 2)[:, 0, 1] / weight
    return {"force": float(forces.mean()), **_spikes("force", forces), "deepest": run.deepest}


def drum_cases(quick: bool) -> Cases:
    if quick:
        return {"quick": partial(drum, 2.0, 0.01, 0.05)}
    return {
        f"{omega:g} rad/s, cells of {1e3 * cell:g} mm": partial(drum, omega, cell, 0.5)
        for omega, cell in ((0.5, 0.01), (2.0, 0.01), (2.0, 0.005))
    }


def blade_scene(
    offset: float, rake_deg: float, speed: float, scheme: gr.Scheme, start: float = 0.0
) -> gr.Scene:
    """A blade 4 cells thick and 5 cells deep in a bed of 12 cells, 2D, moved by `start` cells."""
    begin = np.array([0.15, DEEP - 5 * CELL]) + offset * CELL + np.array([start * CELL, 0.0])
    shape = gr.Box(size=(4 * CELL, 0.2), center=(-2 * CELL, 0.1))
    motion = gr.Motion(times=(AT_REST, AT_REST + RAMP), velocity=((0.0, 0.0), (speed, 0.0)))
    body = gr.Body(shape, tuple(begin), rotation_deg=rake_deg, motion=motion, friction=0.3)
    parts = {"bodies": (body,), "scheme": scheme, "duration": 10.0}
    parts["material"] = gr.materials.glass_beads.replace(E=1e6, rho_c=RHO)
    parts["gravity"] = gr.Gravity((0.0,), ((0.0, -G),))
    return bed("blade", (LONG, DEEP), CELL, 12, **parts)


LONG, DEEP = 0.6, 12 * CELL
"""Length and depth of the bed with the blade [m]."""
AT_REST, RAMP = 0.1, 0.05
"""Time at which the blade begins to move, and time in which it gets its speed [s]."""


def _driven(scene: gr.Scene, speed: float, crossed: float) -> tuple[Array, Run]:
    """Forces on the blade in the eighths of the cells from the second one on [N], and the run."""
    run, window = Run(scene), CELL / speed / WINDOWS
    run.to(AT_REST + RAMP, window)
    run.to(AT_REST + RAMP + crossed * CELL / speed, window)
    return run.forces(AT_REST + RAMP + 2 * CELL / speed)[:, 0, 0], run


def blade(
    offset: float,
    rake_deg: float,
    speed: float,
    crossed: float,
    scheme: gr.Scheme = gr.schemes.default,
) -> Numbers:
    """Force on the blade, over the force of a fluid."""
    forward, run = _driven(blade_scene(offset, rake_deg, speed, scheme), speed, crossed)
    scale = -0.5 * RHO * G * (5 - offset) ** 2 * CELL**2
    return {
        "force": float(forward.mean() / scale),
        **_spikes("force", forward),
        "deepest": run.deepest,
    }


def starts(rake_deg: float, speed: float, crossed: float, scheme: gr.Scheme) -> Numbers:
    """Part of the force on the blade that repeats with the position in the cell.

    Of runs that start an eighth of a cell apart: the largest difference, from the force over the
    cell about each eighth, of the mean over all cells and runs at the same position in the cell
    (`grid`); its standard error; and the standard deviation of single eighths, all relative to the
    mean force.
    """
    off, deepest = [], []
    for k in range(WINDOWS):
        scene = blade_scene(0.0, rake_deg, speed, scheme, k / WINDOWS)
        forward, run = _driven(scene, speed, crossed)
        about = np.convolve(forward, np.full(WINDOWS, 1 / WINDOWS), mode="valid")
        part = (forward[WINDOWS // 2 : WINDOWS // 2 + len(about)] - about) / abs(forward.mean())
        part = part[: len(part) // WINDOWS * WINDOWS].reshape(-1, WINDOWS)
        off.append(np.roll(part, k, axis=1))
        deepest.append(run.deepest)
    same = np.concatenate(off)
    return {
        "grid": float(np.abs(same.mean(axis=0)).max()),
        "error": float(same.std() / math.sqrt(len(same))),
        "scatter": float(same.std()),
        "deepest": max(deepest),
    }


def blade_cases(quick: bool) -> Cases:
    if quick:
        return {"quick": partial(blade, 0.0, 0.0, 0.4, 6)}
    schemes = {"default": gr.schemes.default, "particle": PARTICLE}
    cases: Cases = {}
    for name, scheme in schemes.items():
        for rake in TURNS:
            for speed in (0.05, 0.2) if name == "default" else (0.2,):
                for offset in OFFSETS:
                    case = f"{name}, {speed:g} m/s, rake {rake:g} deg, {offset:g}"
                    cases[case] = partial(blade, offset, rake, speed, 14, scheme)
            cases[f"{name}, starts, rake {rake:g} deg"] = partial(starts, rake, 0.2, 14, scheme)
    return cases


def blade_lines(results: dict[str, Numbers]) -> list[Line]:
    """Lines of blades by the density that a scheme has."""
    lines = []
    for text, name in (("default scheme", "default"), ("`ParticleDensity`", "particle")):
        some = {k: v for k, v in results.items() if k.startswith(name)}
        lines += [replace(line, quantity=f"{text}: {line.quantity}") for line in _lines(some)]
        of_grid = [v for v in some.values() if "grid" in v]
        if of_grid:
            error, scatter = (100 * max(v[key] for v in of_grid) for key in ("error", "scatter"))
            what = "force, mean over the cells crossed and 8 starts at one position in the cell"
            line = within(f"{text}: {what}", (v["grid"] for v in of_grid), 0.15)
            more = f" (standard error {error:.1f} %, single eighths {scatter:.1f} %)"
            lines.append(replace(line, measured=line.measured + more))
    return lines or _lines(results)


QUANTITIES = {
    "force": "force",
    "pressure": "pressure of the first row",
    "pressure_cell": "pressure of the first two rows",
    "pressure_nodes": "pressure of the first row through nodes",
}


def _lines(results: dict[str, Numbers]) -> list[Line]:
    lines = []
    for name, text in QUANTITIES.items():
        some = [v for v in results.values() if name in v]
        if some:
            crossing = (v[f"{name}_crossing"] for v in some)
            spike = (v[f"{name}_spike"] for v in some)
            lines += [
                within(f"{text}, mean over the cells crossed", crossing, 0.15),
                within(f"{text}, each cell by itself", spike, 0.15),
            ]
    return lines


def box_lines(results: dict[str, Numbers]) -> list[Line]:
    """Lines of boxes that are turned against the grid, and of those along it."""
    kinds: dict[str, dict[str, Numbers]] = {
        "17 and 40 deg": {},
        "along the grid, points in rows": {},
        "along the grid, a staggered fill": {},
    }
    for name, numbers in results.items():
        kind = 2 if "staggered" in name else ", 0 deg" in name
        list(kinds.values())[kind][name] = numbers
    return [
        replace(line, quantity=f"{text}: {line.quantity}")
        for text, some in kinds.items()
        for line in _lines(some)
    ]


ROWS = {
    "box": Row("Box that carries a bed through the grid", box_cases, box_lines),
    "drum": Row("Drum that turns", drum_cases, _lines),
    "blade": Row("Blade in a bed, 2D", blade_cases, blade_lines),
}
