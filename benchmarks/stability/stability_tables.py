"""Tables of docs/reports/stability.md: layers below their angle of repose, closed domains, bodies.

Each table is measured anew and stored in the JSON file. The longest, of layers, takes some minutes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from beds import bed
from shared import markdown, parser_of, rounded, stored, write

import granular as gr

CELL = 0.01
"""Size of the cells [m] of all scenes."""
RESTS = 1e-4
"""Mean speed [m/s] over a second below which a layer is at rest."""
SCHEMES = {"default": gr.schemes.default, "`cell_averaged`": gr.schemes.cell_averaged}
Numbers = list[dict[str, Any]]


def speed_at_last(scene: gr.Scene) -> float:
    """Mean speed [m/s] of a layer in its last second; 0 if it has come to rest.

    By the way that points have gone, not by their speeds: the elastic waves of the start go on in a
    layer that does not yield. A layer that rests and does not become faster for a second is not
    followed further.
    """
    sim, length = gr.Simulation(scene, threads=1), float(scene.grid.upper[0] - scene.grid.lower[0])
    before, last = sim.state.x[np.argsort(sim.state.id), 0], 0.0
    for end in np.arange(1.0, scene.duration + 0.5):
        state = sim.run(until=float(end), monitor=False).state
        after = state.x[np.argsort(state.id), 0]
        way = after - before
        mean = abs(float(np.mean(way - length * np.round(way / length))))
        if mean <= last < RESTS:
            return 0.0
        before, last = after, mean
    return last if last >= RESTS else 0.0


def resting(quick: bool) -> Numbers:
    """Layers of 0.2 m below their angle of repose, of several seeds, for up to 20 s."""
    cases = [
        ("default", angle, cell, E, seeds)
        for cell, angle, seeds in (
            (0.01, 19.0, 16),
            (0.01, 20.0, 16),
            (0.005, 19.0, 16),
            (0.005, 20.0, 16),
            (0.0025, 19.0, 4),  # long, and farther from yield than the next
            (0.0025, 20.0, 16),
        )
        for E in (1e6, 1e7)
    ]
    cases += [("`cell_averaged`", 20.0, CELL, E, 3) for E in (1e6, 1e7)]
    if quick:
        cases = [("default", 20.0, 0.05, 1e6, 1)]
    rows = []
    for name, angle, cell, E, seeds in cases:
        scene = gr.scenes.incline(
            angle_deg=angle,
            cell=cell,
            columns=16,
            jitter=0.6,
            duration=1.0 if quick else 20.0,
            material=gr.materials.glass_beads.replace(E=E),
            scheme=SCHEMES[name],
        )
        speeds = [speed_at_last(scene.replace(seed=seed)) for seed in range(seeds)]
        row = {"scheme": name, "angle": angle, "cell": cell, "E": E, "seeds": seeds}
        rows.append(row | {"moving": [speed for speed in speeds if speed]})
        print(rows[-1], flush=True)
    return rows


def closed(quick: bool) -> Numbers:
    """Pressure of plane shear between walls of a fixed distance, which begins at 1000 Pa."""
    columns, layers, start, material = 4, 20, 1000.0, gr.MuI(E=1e6)
    top, rate = layers * CELL, 0.4 * material.xi * math.sqrt(start)  # I/I0 = 0.4
    density = material.rho_c * math.exp(start / material.K)
    rows = []
    for name, scheme in SCHEMES.items():
        scene = gr.Scene(
            name="closed",
            grid=gr.Grid((0.0, 0.0), CELL, (columns, layers), periodic=(True, False)),
            fills=(
                gr.Fill(gr.Box((0.0, 0.0), (columns * CELL, top)), 4, density=density, jitter=0.6),
            ),
            material=material,
            scheme=scheme,
            walls=(gr.Wall(1, 0.0), gr.Wall(1, top, velocity=(rate * top, 0.0))),
            gravity=gr.Gravity((0.0,), ((0.0, 0.0),)),
            duration=8.0,
        )
        sim = gr.Simulation(scene, threads=1)
        sim.buffers["v"][0] = rate * sim.buffers["x"][1]
        for time in (0.1,) if quick else (0.1, 0.5, 2.0, 8.0):
            state = sim.run(until=time, monitor=False).state
            mean = np.average(state.pressure, weights=state.mass / state.density)
            rows.append({"scheme": name, "time": time, "pressure": float(mean)})
            print(rows[-1], flush=True)
    return rows


REACHES = ("up to 0.5", "0.5 to 1", "1 to 1.5", "more")
"""Distances from an edge [cells] by which points are counted."""


def reached(offset: float) -> list[float]:
    """Largest speeds behind a thin body after the first step, over the speed of the material that
    hits its front.

    The edge of the body is `offset` cells beyond a grid line. One speed for each of `REACHES`.
    """
    n, thrown = 20, (0.6, -0.5)
    edge, middle, top = (n / 2 + offset) * CELL, 6 * CELL, 12 * CELL
    body = gr.Body(gr.shapes.Box(size=(n * CELL, 0.2 * CELL)), (edge - n * CELL / 2, middle))
    scene = gr.Scene(
        name="edge",
        grid=gr.Grid((0.0, 0.0), CELL, (n, 16)),
        fills=(
            gr.Fill(gr.Box((0.0, CELL), (n * CELL, middle)), 4, jitter=0.5),
            gr.Fill(gr.Box((0.0, middle), (n * CELL, top)), 4, velocity=thrown, jitter=0.5),
        ),
        material=gr.MuI(E=1e6),
        scheme=gr.Scheme(transfer="apic", density=gr.ParticleDensity()),
        gravity=gr.Gravity((0.0,), ((0.0, 0.0),)),
        bodies=(body,),
        duration=1.0,
        seed=2,
    )
    sim = gr.Simulation(scene, threads=1)
    before = sim.state
    sim.step(1)
    behind = (before.x[:, 1] < middle) & (before.x[:, 0] < edge)
    away = (edge - before.x[behind, 0]) / CELL
    speed = np.linalg.norm(sim.state.v[behind], axis=1) / np.linalg.norm(thrown)
    which = np.minimum((2 * away).astype(int), len(REACHES) - 1)
    return [float(speed[which == k].max()) for k in range(len(REACHES))]


def edges(quick: bool) -> Numbers:
    """Speeds behind a thin body whose edge is anywhere, or on a grid line."""
    offsets = np.arange(2 if quick else 10) / 10
    shares = np.array([reached(offset) for offset in offsets])
    return [
        {"edge": "anywhere", "shares": shares.max(axis=0).tolist()},
        {"edge": "on a grid line", "shares": shares[0].tolist()},
    ]


def impulse(diameter: float, offset: float, seed: int) -> float:
    """Impulse [N s/m] on a disc of so many cells that is driven 3 cm into a bed.

    The axis of the disc is `offset` cells beyond a grid line.
    """
    nx, ny, top, radius, speed = 40, 28, 20 * CELL, 0.5 * diameter * CELL, 0.3
    disc = gr.Body(
        gr.shapes.Cylinder(radius, center=(0.0, 0.0)),
        ((nx / 2 + offset) * CELL, top + radius),
        motion=gr.bodies.Motion(velocity=((0.0, -speed),)),
        friction=0.3,
    )
    parts = {"bodies": (disc,), "duration": 0.03 / speed, "seed": seed}
    scene = bed("disc", (nx * CELL, top), CELL, ny - 20, jitter=0.5, **parts)
    return float(gr.Simulation(scene, threads=1).run(monitor=False).bodies[0].impulse[1])


def discs(quick: bool) -> Numbers:
    """Least and largest impulse on a disc over its mean, of eight positions in a cell.

    Each impulse is a mean over seedings, which scatter as much.
    """
    rows, places, seeds = [], 1 if quick else 8, 1 if quick else 5
    for diameter in (2.0,) if quick else (1.5, 2.0, 3.0, 4.0):
        impulses = np.array(
            [[impulse(diameter, k / places, seed) for seed in range(seeds)] for k in range(places)]
        )
        impulses, scatter = (
            impulses.mean(axis=1) / impulses.mean(),
            impulses.std(axis=1) / impulses.mean(),
        )
        rows.append(
            {
                "diameter": diameter,
                "least": float(impulses.min()),
                "most": float(impulses.max()),
                "scatter": float(scatter.mean()),
            }
        )
        print(rows[-1], flush=True)
    return rows


TABLES: dict[str, Callable[[bool], Numbers]] = {
    "resting": resting,
    "closed": closed,
    "edges": edges,
    "discs": discs,
}


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page."""
    lines_of, rows = {}, results["rows"]
    if layers := rows.get("resting"):
        head = ("scheme", "slope", "cell [m]", "E [Pa]", "layers that rest", "others [m/s]")
        lines_of["resting"] = markdown(head, map(_resting_line, layers))
    if pressures := rows.get("closed"):
        times = sorted({row["time"] for row in pressures})
        values = {(row["scheme"], row["time"]): row["pressure"] for row in pressures}
        lines_of["closed"] = markdown(
            ("scheme", *(f"{time:g} s" for time in times)),
            [(name, *(f"{values[name, time]:.0f} Pa" for time in times)) for name in SCHEMES],
        )
    if shares := rows.get("edges"):
        lines_of["edges"] = markdown(
            ("edge", *(f"{reach} cells" for reach in REACHES[:-1]), REACHES[-1]),
            [(row["edge"], *(f"{100 * share:.2g} %" for share in row["shares"])) for row in shares],
        )
    if sizes := rows.get("discs"):
        lines_of["discs"] = markdown(
            ("diameter [cells]", *(f"{row['diameter']:g}" for row in sizes)),
            [
                ("impulse over its mean", *(f"{r['least']:.2f} to {r['most']:.2f}" for r in sizes)),
                ("scatter between seedings", *(f"{r['scatter']:.2f}" for r in sizes)),
            ],
        )
    return lines_of


def _resting_line(row: dict[str, Any]) -> tuple[object, ...]:
    moving = row["moving"]
    ends = (min(moving), max(moving)) if moving else ()
    speeds = " to ".join(dict.fromkeys(f"{v:.3f}" for v in ends))
    rest = f"{row['seeds'] - len(moving)} of {row['seeds']}"
    slope, E = f"{row['angle']:g} deg", f"{row['E']:.0e}".replace("e+0", "e")
    return row["scheme"], slope, row["cell"], E, rest, speeds


def main(arguments: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, quick="one short case of each table, to see that it runs")
    parser.add_argument("--only", nargs="*", choices=TABLES, default=list(TABLES), metavar="NAME")
    given = parser.parse_args(arguments)
    table = stored(given.out, rows={})
    for name in given.only:
        table["rows"][name] = rounded(TABLES[name](given.quick), 4)
        write(given.out, table, [name])
