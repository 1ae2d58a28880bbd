"""Earth pressure and bearing capacity: cells, speeds, stiffness and schemes, one at a time.

The problems are the ones of `granular verify --external limit_analysis`, with a rough base and
footing. Each row changes only the setting that it names. Walls at 30 degrees of friction, where the
two friction angles differ most, have a separate table, by cells and positions of the points. A
study that is run replaces its rows in the file of results; the page is written from the whole file.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from shared import markdown, parser_of, run_studies, table

import granular as gr
from granular.verify.external import limit_analysis as cases

ANGLES, CELLS, SEEDS = (0.0, 17.0, 30.0), (16, 24, 32, 48), (1, 2)
"""Angles against the grid [deg], cells over the height, seeds of random positions of the points."""

JITTER = 0.3
"""Amplitude of the random displacements, in spacings of the points."""

COLUMNS = {
    "problem": "{problem}",
    "changed": "{changed}",
    "cells": "{cells}",
    "coefficient": "{coefficient:.4g}",
    "over the upper angle": "{share:.3f}",
    "time [s]": "{seconds:.0f}",
}
SCHEMES = {
    "no damping of flutter": gr.Scheme(density=gr.SmoothedDensity(flutter_damping=0.0)),
    "density of each particle": gr.Scheme(density=gr.ParticleDensity()),
    "cell-averaged density": gr.schemes.cell_averaged,
}


def row(
    problem: str, changed: str, cells: int, scene: gr.Scene, known: float, kind: str,
    banded: bool = False,
) -> dict:  # fmt: skip
    """Coefficient of a run and its cost, and the inclination of its band if `banded`."""
    begin = time.process_time()
    reaction = cases.reaction(scene, cases.STOPS[kind])
    force = reaction.at_rest(cases.STEADY[kind])
    unit = cases.RHO * cases.G * cases.SIZE**2 * (0.5 if kind in ("K_p", "K_a") else 0.25)
    seconds = time.process_time() - begin
    entry = {"problem": problem, "changed": changed, "cells": cells, "coefficient": force / unit}
    entry |= {"share": force / unit / known, "seconds": seconds}
    return entry | ({"band_deg": band(scene, reaction)} if banded else {})


def band(scene: gr.Scene, reaction: cases.Reaction) -> float:
    """Inclination of the edge of a wedge to the surface of the bed [deg], through its heights.

    At a height the edge is the farthest point at which the speed, smoothed over five points, is
    half of the speed at the wall above the middle of its height.
    """
    along = np.array(scene.bodies[0].motion.velocity[-1])
    along *= np.sign(along[0]) / np.hypot(*along)
    x, speed = reaction.points
    a, h = x @ along / cases.SIZE, x @ [-along[1], along[0]] / cases.SIZE
    half = 0.5 * np.median(speed[(a < 0.25) & (h > 0.6)])
    heights, edges = np.arange(0.1, 0.95, 0.05), []
    for height in heights:
        near = np.flatnonzero(np.abs(h - height) < 0.03)
        near = near[np.argsort(a[near])]
        smooth = np.convolve(speed[near], np.full(5, 0.2), "same")
        edges.append(a[near[np.flatnonzero(smooth > half)[-1]]])
    return float(np.degrees(np.arctan(np.polyfit(edges, heights, 1)[0])))


def walls(quick: bool) -> Iterator[dict]:
    """Smooth wall, phi = 20 deg, as in the case but for one thing."""
    turns = ((0.0, 8), (0.0, 16), (0.0, 32), (17.0, 32))
    variants = [(passive, *turn) for passive in (True, False) for turn in turns]
    for passive, angle, cells in variants[:1] if quick else variants:
        kind, known = "K_p" if passive else "K_a", cases.rankine(20.0, passive)
        scene = cases.wall_scene(20.0, passive=passive, rough=True, angle_deg=angle, cells=cells)
        yield row(kind, f"turned by {angle:g} deg", cells, scene, known, kind)
    if quick:
        return
    given = {"passive": True, "rough": True, "angle_deg": 0.0}
    known, plain = cases.rankine(20.0, True), cases.wall_scene(20.0, cells=16, **given)
    for name, numbers in (
        ("a quarter of the speed", {"speed": cases.SPEED["wall"] / 4}),
        ("four times as stiff", {"E": 1.2e7}),
    ):
        scene = cases.wall_scene(20.0, cells=16, **given, **numbers)
        yield row("K_p", name, 16, scene, known, "K_p")
    for name, scheme in SCHEMES.items():
        yield row("K_p", name, 16, plain.replace(scheme=scheme), known, "K_p")
    floor = gr.Body(gr.shapes.HalfSpace((0.0, 1.0)), (0.0, 0.0), contact="sticky")
    for cells in (8, 16, 32):
        scene = cases.wall_scene(20.0, cells=cells, **given)
        held = scene.replace(walls=(gr.Wall(1, 0.0, kind="no_slip"), *scene.walls[1:]))
        yield row("K_p", "no_slip base", cells, held, known, "K_p")
    for cells in (8, 16, 32):
        scene = cases.wall_scene(20.0, cells=cells, **given)
        below = gr.Grid(
            (scene.grid.lower[0], -4 * scene.grid.cell), scene.grid.cell,
            (scene.grid.shape[0], scene.grid.shape[1] + 4),
        )  # fmt: skip
        stuck = scene.replace(grid=below, walls=scene.walls[1:], bodies=(*scene.bodies, floor))
        yield row("K_p", "a sticky body as the base", cells, stuck, known, "K_p")


def wedges(quick: bool) -> Iterator[dict]:
    """Smooth wall, phi = 30 deg, by angle, cells and positions of the points."""
    variants = [(angle, cells, None) for cells in CELLS for angle in ANGLES]
    variants += [(ANGLES[0], 32, seed) for seed in SEEDS]
    variants.sort(key=lambda one: one[1])  # the dear ones last
    every = [(*one, passive) for one in variants for passive in (True, False)]
    for angle, cells, seed, passive in every[:1] if quick else every:
        scene = cases.wall_scene(30.0, passive=passive, rough=True, angle_deg=angle, cells=cells)
        if seed is not None:
            fills = tuple(replace(fill, jitter=JITTER) for fill in scene.fills)
            scene = scene.replace(fills=fills, seed=seed)
        kind, known = "K_p" if passive else "K_a", cases.rankine(30.0, passive)
        turned = f"turned by {angle:g} deg"
        yield row(kind, turned, cells, scene, known, kind, banded=True) | {"seed": seed}


def footings(quick: bool) -> Iterator[dict]:
    """Rough footing on soil with weight, phi = 20 deg, as in the case but for one thing."""
    known = cases.bearing(20.0, False, True)[0]
    given = {"rough": True, "surcharge": False}
    variants = [(0.0, 10), (0.0, 20), (0.0, 40), (17.0, 20), (17.0, 40)]
    for angle, cells in variants[:1] if quick else variants:
        scene = cases.footing_scene(20.0, angle_deg=angle, cells=cells, **given)
        yield row("N_gamma", f"turned by {angle:g} deg", cells, scene, known, "self-weight")
    if quick:
        return
    for speed in (0.005, 0.0004):
        scene = cases.footing_scene(20.0, angle_deg=0.0, cells=20, speed=speed, **given)
        name = f"{1000 * speed:g} mm/s in place of {1000 * cases.SPEED['self-weight']:g}"
        yield row("N_gamma", name, 20, scene, known, "self-weight")
    plain = cases.footing_scene(20.0, angle_deg=0.0, cells=20, **given)
    stiff = plain.replace(material=plain.material.replace(E=1.2e7))
    yield row("N_gamma", "four times as stiff", 20, stiff, known, "self-weight")
    for name, scheme in SCHEMES.items():
        yield row("N_gamma", name, 20, plain.replace(scheme=scheme), known, "self-weight")


STUDIES: dict[str, Callable[[bool], Iterator[dict]]]
STUDIES = {"walls": walls, "footings": footings, "wedges": wedges}
"""Rows by their names in the file of results."""


def wedge_table(rows: list[dict]) -> list[str]:
    """Markdown of the walls at 30 deg: a line for each turn or seed, a column for each size."""
    by_case = {(r["problem"], r["changed"], r["seed"], r["cells"]): r for r in rows}
    lines = []
    runs = [(f"turned by {angle:g} deg", None) for angle in ANGLES]
    runs += [(runs[0][0], seed) for seed in SEEDS]
    for problem, (turned, seed) in itertools.product(("K_p", "K_a"), runs):
        ends = [cases.rankine(phi, problem == "K_p") for phi in cases.limits(30.0)]
        name = turned if seed is None else f"{turned}, random positions of the points, seed {seed}"
        here = [by_case.get((problem, turned, seed, cells), {}) for cells in CELLS]
        if not any(here):
            continue
        texts = [f"{r['coefficient']:.4g}" if r else "" for r in here]
        texts.append(next((f"{r['band_deg']:.0f}" for r in here if r.get("cells") == 32), ""))
        lines.append((problem, name, *(f"{end:.4g}" for end in ends), *texts))
    sizes = (f"{cells} cells" for cells in CELLS)
    head = ("problem", "", "upper angle", "lower angle", *sizes, "band in 32 cells [deg]")
    return markdown(head, lines)


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page, by study."""
    studies = results["studies"]
    tables = {name: table(studies[name], COLUMNS) for name in ("walls", "footings")}
    return tables | {"wedges": wedge_table(studies["wedges"])}


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__name__, __doc__, "one coarse run of each kind")
    parser.add_argument("--only", nargs="*", choices=STUDIES, default=list(STUDIES))
    arguments = parser.parse_args(argv)
    run_studies(arguments, STUDIES)
