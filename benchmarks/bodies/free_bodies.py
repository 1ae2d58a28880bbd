"""Free bodies: their cost, how light they may be, and the depth of craters.

cost: nanoseconds of the processor for each point and step with no body, with a body that stands,
with one that moves and turns freely, and with one that also touches a wall; the runs take turns.
light: the noise of the bed about a disc at rest in it, by its mass over the mass of a full cell.
craters: the depth to which balls fall, over the law of Uehara et al. (2003).
Runs that are in the JSON file are not repeated, unless `--again` is given.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import beds
import numpy as np
from shared import markdown, parser_of, rounded, stored, write

import granular as gr

BODIES = ("none", "standing", "free", "free, at a wall")
MASSES = (1.0, 0.3, 0.1, 0.03, 0.01)
RADII = (4, 8)
CRATERS = ((0.05, 0.004), (0.2, 0.004), (0.8, 0.004), (0.2, 0.005), (0.2, 0.16 / 48))
"""Falls [m] and cells [m]."""

Row = dict[str, Any]


def bed(dim: int, quick: bool, kind: str) -> gr.Scene:
    """Bed with a disc or ball eight cells across that lies on it."""
    cell = 0.01
    cells = {2: (64, 20), 3: (24, 24, 12)}[dim]
    cells = tuple(n // 2 for n in cells) if quick else cells
    size = tuple(cell * n for n in cells)
    radius = 0.02 if quick else 0.04
    shape = gr.shapes.Sphere(radius, center=(0.0,) * 3) if dim == 3 else None
    shape = shape or gr.shapes.Cylinder(radius, center=(0.0, 0.0))
    whole = gr.bodies.mass_properties(shape, 1500.0)
    at = [0.5 * side for side in size[:-1]]
    if kind.endswith("wall"):
        at[0] = radius
    place = (*at, size[-1] + 0.8 * radius)
    free = {"free": "xyz"[:dim], "mass": whole.mass, "inertia": whole.inertia}
    body = gr.Body(shape, place, friction=0.3, **(free if kind.startswith("free") else {}))
    bodies = [] if kind == "none" else [body]
    return beds.bed("bed", size, cell, 14, bodies=bodies)


def cost(quick: bool) -> dict[str, Callable[[], Row]]:
    """Time the runs of a dimension in turns; each figure is from the fastest turn."""

    def run(dim: int) -> Row:
        sims = {kind: gr.Simulation(bed(dim, quick, kind), threads=1) for kind in BODIES}
        best = dict.fromkeys(BODIES, math.inf)
        steps, turns = (5, 2) if quick else ((200, 12) if dim == 2 else (20, 10))
        for sim in sims.values():
            sim.step(20)
        for _ in range(turns):
            for kind, sim in sims.items():
                begin = time.process_time()
                sim.step(steps)
                best[kind] = min(best[kind], (time.process_time() - begin) / steps)
        points = sims["none"].n_points
        return {"points": points} | {kind: best[kind] / points * 1e9 for kind in BODIES}

    return {f"{dim}D": lambda dim=dim: run(dim) for dim in (2, 3)}


def light(quick: bool) -> dict[str, Callable[[], Row]]:
    """Root mean square of the velocity of the bed about a disc in it, at most, in 0.2 s."""

    def run(radius: int, share: float) -> Row:
        cell = 0.08 / radius
        mass = share * 1500.0 * cell**2
        disc = gr.Body(
            gr.shapes.Cylinder(0.08, center=(0.0, 0.0)),
            (0.4, 0.2),
            friction=0.3,
            free="xy",
            mass=mass,
            inertia=0.5 * mass * 0.08**2,
        )
        weight = gr.Gravity((0.0,), ((0.0, -9.81),))
        rise = round(0.2 / cell)
        scene = beds.bed(
            "light", (0.8, 0.4), cell, rise, bodies=[disc], gravity=weight, duration=0.2
        )
        sim, noise = gr.Simulation(scene, threads=1), 0.0
        for end in (0.01,) if quick else (0.05, 0.1, 0.15, 0.2):
            sim.run(until=end, monitor=False)
            square = (sim.state.v**2).sum(axis=1) @ sim.state.mass / sim.state.mass.sum()
            noise = max(noise, math.sqrt(square))
        return {"radius": radius, "mass": share, "noise": noise}

    chosen = [(4, 1.0)] if quick else [(r, m) for r in RADII for m in MASSES]
    return {f"{r} cells, {m:g}": lambda r=r, m=m: run(r, m) for r, m in chosen}


def craters(quick: bool) -> dict[str, Callable[[], Row]]:
    """Depth of a ball of an inch, over the law with the yield coefficient of the bed."""

    def run(drop: float, cell: float) -> Row:
        scene = gr.scenes.sphere_drop(drop=drop, cell=cell, duration=0.01 if quick else 0.1)
        sim = gr.Simulation(scene).run(monitor=False)
        ball, diameter = sim.bodies[0], scene.parameters["diameter"]
        depth = 0.5 * diameter - float(ball.position[2])
        ratio = 2200.0 / scene.material.rho_c
        law = gr.theory.crater_depth(drop, diameter, scene.material.mu_s, ratio)
        return {
            "drop": drop,
            "across": diameter / cell,
            "depth": depth,
            "over_law": depth / float(law),
            "speed": float(np.linalg.norm(ball.velocity)),
        }

    chosen = [(0.2, 0.01)] if quick else CRATERS
    return {f"{d:g} m, {c:.3g} m": lambda d=d, c=c: run(d, c) for d, c in chosen}


def table_of_cost(rows: dict[str, Row]) -> list[str]:
    """Nanoseconds, and their ratio to a run without a body."""
    lines = []
    for name, row in rows.items():
        cells = [f"{row['none']:.0f}"]
        cells += [f"{row[kind] / row['none']:.2f}" for kind in BODIES[1:]]
        lines.append((name, row["points"], *cells))
    return markdown(("", "points", "none [ns]", "standing", "free", "free, at a wall"), lines)


def table_of_light(rows: dict[str, Row]) -> list[str]:
    """Noise by mass, a column for each radius."""
    noise = {(row["radius"], row["mass"]): row["noise"] for row in rows.values()}
    radii = sorted({radius for radius, _ in noise})
    masses = sorted({mass for _, mass in noise}, reverse=True)
    lines = [
        (f"{mass:g}", *(f"{noise[r, mass]:.2g}" if (r, mass) in noise else "" for r in radii))
        for mass in masses
    ]
    return markdown(("mass over that of a cell", *(f"radius of {r} cells" for r in radii)), lines)


def table_of_craters(rows: dict[str, Row]) -> list[str]:
    """Depths, and in the last line the exponent over the total fall with the most falls."""
    ordered = sorted(rows.values(), key=lambda row: (row["across"], row["drop"]))
    lines = [
        (f"{r['drop']:g}", f"{r['across']:.1f}", f"{1000 * r['depth']:.1f}", f"{r['over_law']:.2f}")
        for r in ordered
    ]
    table = markdown(("fall [m]", "cells across", "depth [mm]", "over the law"), lines)
    cells = [r["across"] for r in ordered]
    same = [r for r in ordered if r["across"] == max(cells, key=cells.count)]
    if len(same) > 2:
        totals = np.log([r["drop"] + r["depth"] for r in same])
        slope = np.polyfit(totals, np.log([r["depth"] for r in same]), 1)[0]
        across = same[0]["across"]
        table += ["", f"Exponent over the total fall with {across:.1f} cells across: {slope:.2f}."]
    return table


TABLES = {
    "cost": (cost, table_of_cost),
    "light": (light, table_of_light),
    "craters": (craters, table_of_craters),
}


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the pages."""
    return {name: TABLES[name][1](results[name]) for name in TABLES if name in results}


def main(arguments: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, quick="small scenes and few steps, to see that it runs")
    parser.add_argument("only", nargs="*", choices=[*TABLES, []], metavar="TABLE")
    parser.add_argument("--again", action="store_true", help="repeat the runs in the file")
    given = parser.parse_args(arguments)
    table = stored(given.out)
    for name in given.only or TABLES:
        results = table.setdefault(name, {})
        for case, run in TABLES[name][0](given.quick).items():
            if given.again or case not in results:
                results[case] = rounded(run(), 4)
                print(name, case, results[case], flush=True)
                write(given.out, table, [name])
