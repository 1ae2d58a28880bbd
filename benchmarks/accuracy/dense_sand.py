"""Loose and dense sand with DilatantMuI: cylinders, an impact, layers, plates, walls, times.

Plates and walls take about 20 minutes each by one thread, and all else together as long.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from shared import RESULTS, least_time, parser_of, run_studies, table

import granular as gr
from accuracy import sand_plates, sand_walls

OUT = RESULTS / "dense_sand.json"
RADIUS = 0.2
REPOSE_DEG = 31.0
"""Angle of repose of the sand [deg]."""
MU_S = round(math.tan(math.radians(REPOSE_DEG)), 3)
NUMBERS: dict[str, Any] = {"E": 1e6, "mu_s": MU_S, "mu_2": MU_S + 0.26, "d": 5e-4, "I0": 0.279}
SAND = gr.DilatantMuI(**NUMBERS)
SAME = gr.MuI(**NUMBERS, rho_s=SAND.rho_s, rho_c=SAND.rho_c)
PACKINGS = {"mu(I)": None, "loose": 0.56, "critical": SAND.phi_c, "dense": 0.62}
BEADS = gr.DilatantMuI(E=1e6, d=0.005)


def filled(scene: gr.Scene, packing: float | None) -> gr.Scene:
    """The scene with fills of this packing."""
    return scene.replace(fills=tuple(fill.replace(packing=packing) for fill in scene.fills))


def collapse(scene: gr.Scene, until: float) -> tuple[gr.State, dict[str, float]]:
    """Last state, and how far and how long how much of a cylinder of `RADIUS` runs out.

    The time is that until 99 % of the mass have run out by 95 % of their run-out [s], from the
    middle of the ramp of gravity, by half of which a free fall is late. Mass has moved if it is
    farther than a twentieth of the radius from where it was.
    """
    sim = gr.Simulation(scene, threads=1)
    start, at, outer = sim.state, [0.0], [0.0]
    while sim.time < until:
        state = sim.run(until=min(sim.time + 0.01, until), monitor=False).state
        at.append(sim.time)
        outer.append(runout(state, 0.99))
    end = float(np.interp(0.95 * outer[-1], np.maximum.accumulate(outer), at))
    moved = np.linalg.norm(gr.measure.displacement(state, start), axis=1) > RADIUS / 20
    return state, {
        "runout_99": outer[-1],
        "runout": runout(state, 0.999),
        "time": end - scene.gravity.times[-1] / 2,
        "outside": float(state.mass[state.x[:, 0] > RADIUS].sum() / state.mass.sum()),
        "moved": float(state.mass[moved].sum() / state.mass.sum()),
    }


def runout(state: gr.State, share: float) -> float:
    """Distance from the side of the cylinder within which a share of the mass is, in radii."""
    order = np.argsort(state.x[:, 0])
    mass = np.cumsum(state.mass[order])
    return float(state.x[order, 0][np.searchsorted(mass, share * mass[-1])]) / RADIUS - 1


def columns(quick: bool) -> Iterator[dict[str, Any]]:
    """Height within an eighth of the radius and run-outs in radii, shares of the mass, time."""
    for aspect in (1, 3):
        for cells in (8,) if quick else (16, 32, 64):
            for name, packing in PACKINGS.items():
                scene = gr.scenes.cylinder_collapse(
                    aspect=aspect,
                    radius=RADIUS,
                    axisymmetric=True,
                    cell=RADIUS / cells,
                    jitter=0.5,
                    material=SAME if packing is None else SAND,
                )
                state, numbers = collapse(filled(scene, packing), 0.2 if quick else 1.4)
                near = state.x[:, 0] < RADIUS / 8
                yield {
                    "aspect": aspect,
                    "cells": cells,
                    "material": name,
                    "height": float(
                        state.volume[near].sum() / (math.pi * (RADIUS / 8) ** 2) / RADIUS
                    ),
                    **numbers,
                    "time": numbers["time"] / math.sqrt(aspect * RADIUS / 9.8),
                    "lube_height": 0.88 * aspect ** (1 / 6),
                    "lube_runout": 1.24 * aspect if aspect < 1.7 else 1.6 * aspect**0.5,
                }


def layers(quick: bool) -> Iterator[dict[str, Any]]:
    """Angle between which a layer of ten cells starts, by bisection, and that of its peak."""
    for packing in (BEADS.phi_c, 0.59, 0.6):
        low, high = 18.0, 30.0
        while high - low > (4.0 if quick else 0.1):
            middle = (low + high) / 2
            scene = gr.scenes.incline(
                angle_deg=middle, height=0.05, columns=4, jitter=0.5, material=BEADS
            )
            sim = gr.Simulation(filled(scene, packing), threads=1)
            speed = np.abs(sim.run(until=2.0, monitor=False).state.v).max()
            low, high = (low, middle) if speed > 0.02 else (middle, high)
        yield {
            "packing": packing,
            "start": (low + high) / 2,
            "theory": math.degrees(math.atan(BEADS.peak_friction(packing))),
            "stop": math.degrees(math.atan(BEADS.mu_s)),
        }


SPHERES: dict[str, Any] = {"E": 1e7, "mu_s": 0.38, "mu_2": 0.64, "I0": 0.279, "d": 2e-3}
"""Glass spheres of 2 mm."""
MOMENTS, DEPTHS = (1.7e-3, 3.2e-3, 5.2e-3, 7.2e-3), (7.02e-3, 12.19e-3, 18.13e-3, 23.16e-3)
"""Times after contact [s] and depths [m] of a steel ball of 20 mm in a bed of such spheres at
5.2 m/s, by discrete elements (Dosta et al.)."""


def impacts(quick: bool) -> Iterator[dict[str, Any]]:
    """Depths of the ball at these times, over those."""
    for cell in (4e-3,) if quick else (2e-3, 1e-3):
        for name, packing in (("mu(I)", None), *((f"{p}", p) for p in (0.585, 0.6, 0.62, 0.64))):
            rho = {"rho_s": 2500.0}
            grains = gr.MuI(**SPHERES, **rho, rho_c=1500.0)
            scene = gr.scenes.sphere_drop(
                drop=1.378, diameter=0.02, density=7850.0, width=0.12, soil=0.06, headroom=0.03,
                axisymmetric=True, cell=cell, jitter=0.5,
                material=grains if packing is None else gr.DilatantMuI(**SPHERES, **rho),
            )  # fmt: skip
            sim = gr.Simulation(filled(scene, packing), threads=1)
            speed = abs(float(sim.bodies[0].velocity[-1]))
            path = [(0.0, 0.01 - float(sim.bodies[0].position[-1]))]
            while path[-1][0] < 9e-3 and not (quick and len(path) > 3):
                sim.run(until=path[-1][0] + 1e-4, monitor=False)
                path.append((sim.time, 0.01 - float(sim.bodies[0].position[-1])))
            at, depth = np.array(path).T
            contact = -depth[0] / speed
            depths = np.interp(np.array(MOMENTS) + contact, at, depth)
            yield {
                "material": name,
                "cell": cell,
                "ratios": [float(z / known) for z, known in zip(depths, DEPTHS, strict=True)],
            }


def times(quick: bool) -> Iterator[dict[str, Any]]:
    """Processor time of a point and step in a flowing column, and of mu(I), in turns."""
    for dim in (2, 3):
        sims = {}
        for name, packing in (("mu(I)", None), ("dilatant", 0.6)):
            make = gr.scenes.column_collapse if dim == 2 else gr.scenes.cylinder_collapse
            scene = make(
                cell=0.1 if quick else (0.004, 0.0125)[dim - 2],
                points_per_cell=4 * dim - 4,
                material=SAME if packing is None else SAND,
            )
            sims[name] = gr.Simulation(filled(scene, packing), threads=1)
            sims[name].step(5 if quick else 1000)
        steps = 2 if quick else 50
        best = dict.fromkeys(sims, math.inf)
        for _ in range(1 if quick else 5):
            for name, sim in sims.items():
                best[name] = min(best[name], least_time(partial(sim.step, steps), 1))
        for name, sim in sims.items():
            yield {
                "dim": f"{dim}D",
                "material": name,
                "points": sim.n_points,
                "nanoseconds": best[name] / steps / sim.n_points * 1e9,
                "ratio": best[name] / best["mu(I)"],
            }


STUDIES = {
    "columns": columns,
    "impacts": impacts,
    "layers": layers,
    "discs": sand_plates.discs,
    "plates": sand_plates.plates,
    "smooth_plates": sand_plates.smooth_plates,
    "walls": sand_walls.walls,
    "times": times,
}


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page."""
    studies = results["studies"]
    return (
        sand_plates.tables(studies)
        | sand_walls.tables(studies)
        | {
            "columns": table(
                studies.get("columns", []),
                {
                    "aspect": "{aspect}",
                    "cells in a radius": "{cells}",
                    "material": "{material}",
                    "height": "{height:.2f}",
                    "of Lube": "{lube_height:.2f}",
                    "run-out of 99 %": "{runout_99:.2f}",
                    "of 99.9 %": "{runout:.2f}",
                    " of Lube": "{lube_runout:.2f}",
                    "time": "{time:.1f} √(h/g)",
                    "moved": "{moved:.0%}",
                    "outside": "{outside:.0%}",
                },
            ),
            "impacts": table(
                [
                    row | {f"at {k}": ratio for k, ratio in enumerate(row["ratios"])}
                    for row in studies.get("impacts", [])
                ],
                {"packing": "{material}", "cell": "{cell} m"}
                | {f"after {1e3 * t:.1f} ms": f"{{at {k}:.2f}}" for k, t in enumerate(MOMENTS)},
            ),
            "layers": table(
                studies.get("layers", []),
                {
                    "packing": "{packing}",
                    "starts at": "{start:.1f}°",
                    "peak friction": "{theory:.1f}°",
                    "critical friction": "{stop:.1f}°",
                },
            ),
            "times": table(
                studies.get("times", []),
                {
                    "": "{dim}",
                    "material": "{material}",
                    "points": "{points:,}",
                    "time of a point and step": "{nanoseconds:.0f} ns",
                    "over mu(I)": "{ratio:.2f}",
                },
            ),
        }
    )


def main(argv: list[str] | None = None) -> None:
    """Run some of the studies, by default all."""
    parser = parser_of(__name__, __doc__)
    parser.add_argument("--only", nargs="+", choices=STUDIES, default=list(STUDIES))
    run_studies(parser.parse_args(argv), STUDIES)
