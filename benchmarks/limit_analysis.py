"""Earth pressure and bearing capacity: cells, speeds, stiffness and schemes, one at a time.

    python benchmarks/limit_analysis.py [--quick] [--out FILE] [--page FILE]

The problems are those of `granular verify --external limit_analysis`, with a rough base and
footing. Each row changes what its name says, and nothing else.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from pathlib import Path

from shared import machine, markdown, parser_of, rounded, write, write_tables

import granular as gr
from granular.mpm.schemes import ParticleDensity, Scheme, SmoothedDensity
from granular.verify.external import limit_analysis as cases

HEADER = ("problem", "changed", "cells", "coefficient", "over that of the upper angle", "time [s]")
SCHEMES = {
    "no damping of short waves": Scheme(density=SmoothedDensity(damped_waves=0.0)),
    "density of each particle": Scheme(density=ParticleDensity()),
    "cell-averaged density": gr.schemes.cell_averaged,
}


def row(problem: str, changed: str, cells: int, scene: gr.Scene, known: float, kind: str) -> dict:
    """Coefficient of a run and what it costs."""
    stops = cases.WALL_STOPS if kind == "wall" else cases.FOOTING_STOPS[kind]
    begin = time.process_time()
    force = cases.reaction(scene, stops).at_rest(cases.STEADY[kind])
    unit = cases.RHO * cases.G * cases.SIZE**2 * (0.5 if kind == "wall" else 0.25)
    seconds = time.process_time() - begin
    found = {"problem": problem, "changed": changed, "cells": cells, "coefficient": force / unit}
    return found | {"share": force / unit / known, "seconds": seconds}


def walls(quick: bool) -> Iterator[dict]:
    """Smooth wall, phi = 20 deg unless said otherwise, as in the case but for one thing."""
    turns = ((0.0, 8), (0.0, 16), (0.0, 32), (17.0, 32))
    variants = [(20.0, passive, *turn) for passive in (True, False) for turn in turns]
    variants += [(30.0, passive, *turn) for passive in (True, False) for turn in turns[2:]]
    for phi, passive, angle, cells in variants[:1] if quick else variants:
        kind, known = "K_p" if passive else "K_a", cases.rankine(phi, passive)
        scene = cases.wall_scene(phi, passive=passive, rough=True, angle_deg=angle, cells=cells)
        turned = f"turned by {angle:g} deg"
        name = turned if phi == 20.0 else f"phi = {phi:g} deg, {turned}"
        yield row(kind, name, cells, scene, known, "wall")
    if quick:
        return
    given = {"passive": True, "rough": True, "angle_deg": 0.0}
    known, plain = cases.rankine(20.0, True), cases.wall_scene(20.0, cells=16, **given)
    for name, numbers in (
        ("a quarter of the speed", {"speed": cases.SPEED["wall"] / 4}),
        ("four times as stiff", {"E": 1.2e7}),
    ):
        scene = cases.wall_scene(20.0, cells=16, **given, **numbers)
        yield row("K_p", name, 16, scene, known, "wall")
    for name, scheme in SCHEMES.items():
        yield row("K_p", name, 16, plain.replace(scheme=scheme), known, "wall")
    floor = gr.Body(gr.bodies.HalfSpace((0.0, 1.0)), (0.0, 0.0), contact="sticky")
    for cells in (8, 16, 32):
        scene = cases.wall_scene(20.0, cells=cells, **given)
        held = scene.replace(walls=(gr.Wall(1, 0.0, kind="no_slip"), *scene.walls[1:]))
        yield row("K_p", "no_slip base", cells, held, known, "wall")
    for cells in (8, 16, 32):
        scene = cases.wall_scene(20.0, cells=cells, **given)
        below = gr.Grid(
            (scene.grid.lower[0], -4 * scene.grid.cell), scene.grid.cell,
            (scene.grid.shape[0], scene.grid.shape[1] + 4),
        )  # fmt: skip
        stuck = scene.replace(grid=below, walls=scene.walls[1:], bodies=(*scene.bodies, floor))
        yield row("K_p", "a sticky body as the base", cells, stuck, known, "wall")


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


def table(rows: list[dict]) -> list[str]:
    """Markdown of the rows."""
    return markdown(HEADER, [
        (
            r["problem"], r["changed"], r["cells"], f"{r['coefficient']:.4g}",
            f"{r['share']:.3f}", f"{r['seconds']:.0f}",
        )
        for r in rows
    ])  # fmt: skip


def main(argv: list[str] | None = None) -> None:
    parser = parser_of(__doc__, "one coarse run of each kind")
    parser.add_argument("--page", type=Path, help="page whose table is written")
    arguments = parser.parse_args(argv)
    rows = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", gr.StabilityWarning)
        for part in (walls, footings):
            for found in part(arguments.quick):
                rows.append(found)
                print(found, flush=True)
    write(arguments.out, machine() | {"rows": rounded(rows)})
    if arguments.page:
        write_tables(arguments.page, {"limit_analysis_study": table(rows)})


if __name__ == "__main__":
    main()
