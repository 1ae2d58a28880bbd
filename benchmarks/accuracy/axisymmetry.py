"""Axisymmetric runs compared with the same set-ups in 3D: results and processor time.

All runs take about 25 minutes by one thread, nearly all of it for those in 3D.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from shared import markdown, parser_of, rounded, stored, write

import granular as gr

SEEDS = 4
"""Axisymmetric runs of a case, whose points are jittered; there is one run in 3D."""
Numbers = dict[str, float]


def cylinder(aspect: float, cells: int, plane: bool, seed: int, quick: bool) -> Numbers:
    """Radii within which shares of the mass lie, and the height, over the radius at the start."""
    radius = 0.2
    scene = gr.scenes.cylinder_collapse(
        aspect=aspect, radius=radius, axisymmetric=plane, cell=radius / cells, ramp=0.0, E=1e7,
        jitter=0.5 * plane, seed=seed, duration=0.2 if quick else 1.0,
    )  # fmt: skip
    state = gr.Simulation(scene, threads=1).run().state
    r = np.linalg.norm(state.x[:, :-1], axis=1)
    order = np.argsort(r)
    mass = np.cumsum(state.mass[order]) / state.mass.sum()
    radii = {f"r{share}": np.interp(0.01 * share, mass, r[order]) / radius for share in (50, 95)}
    return {**radii, "height": state.x[:, -1].max() / radius}


def penetration(kind: str, cells: int, plane: bool, seed: int, quick: bool) -> Numbers:
    """Mean forces on a ball or cone of 0.08 m in windows of its depth [N].

    The bed is square in 3D. The round one has, in whole cells, the radius that is nearest to its
    area: a ball at the depth of its diameter feels the walls.
    """
    scene = gr.scenes.penetration(
        kind=kind, axisymmetric=plane, dim=None if plane else 3, diameter=0.08, cell=0.08 / cells,
        width=0.28 if plane else 0.24, soil=0.16, headroom=0.04, duration=0.3 if quick else 1.2,
        material=gr.materials.glass_beads, E=1e6, jitter=0.5 * plane, seed=seed,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "run.h5")
        gr.Simulation(scene, threads=1).run(save=file, every=0.02)
        with gr.open(file) as record:
            motion = gr.measure.body_motion(record, 0)
            force = gr.measure.body_force(record, 0).force[:, -1]
    depth = -motion.position[:, -1]
    middle = 0.5 * (depth[1:] + depth[:-1])
    windows = [(a, a + 0.02) for a in np.arange(0.01, depth.max() - 0.02, 0.04)]
    return {
        f"force from {1e3 * a:.0f} to {1e3 * b:.0f} mm [N]": force[
            (middle > a) & (middle < b)
        ].mean()
        for a, b in windows
    }


def hopper(points: int, cells: int, plane: bool, seed: int, quick: bool) -> Numbers:
    """Rates of discharge of a conical hopper [kg/s]; points per cell of the axisymmetric runs."""
    scene = gr.scenes.hopper(
        axisymmetric=plane, dim=None if plane else 3, orifice=0.1, cell=0.1 / cells, width=0.3,
        fill_height=0.3, angle_deg=45.0, opens_at=0.1, duration=0.3 if quick else 1.0, E=1e6,
        points_per_cell=points if plane else 8, jitter=0.5 * plane, seed=seed,
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "run.h5")
        gr.Simulation(scene, threads=1).run(save=file, every=0.02)
        with gr.open(file) as record:
            history = gr.measure.mass_history(record)
    ends = [(a, a + 0.2) for a in (0.3, 0.5, 0.7) if a + 0.2 < history.times[-1]]
    mass = [np.interp(pair, history.times, history.mass) for pair in ends]
    return {
        f"rate from {a:g} to {b:g} s [kg/s]": (m[0] - m[1]) / (b - a)
        for (a, b), m in zip(ends, mass, strict=True)
    }


def crater(cells: int, plane: bool, seed: int, quick: bool) -> Numbers:
    """Depth that a ball of 0.0254 m reaches [mm]."""
    diameter = 0.0254
    scene = gr.scenes.sphere_drop(
        axisymmetric=plane, diameter=diameter, cell=0.16 / cells, soil=0.08, headroom=0.04,
        duration=0.02 if quick else 0.15, jitter=0.5 * plane, seed=seed,
    )  # fmt: skip
    sim = gr.Simulation(scene, threads=1).run()
    return {"depth [mm]": 1e3 * (0.5 * diameter - float(sim.bodies[0].position[-1]))}


Case = Callable[[bool, int, bool], Numbers]
CASES: dict[str, Case] = {
    "cylinder, aspect 1, 8 cells": lambda *run: cylinder(1.0, 8, *run),
    "cylinder, aspect 1, 16 cells": lambda *run: cylinder(1.0, 16, *run),
    "cylinder, aspect 3, 8 cells": lambda *run: cylinder(3.0, 8, *run),
    "ball, 8 cells": lambda *run: penetration("ball", 8, *run),
    "cone of 60°, 8 cells": lambda *run: penetration("cone", 8, *run),
    "hopper, 8 cells, 4 points": lambda *run: hopper(4, 8, *run),
    "hopper, 8 cells, 16 points": lambda *run: hopper(16, 8, *run),
    "crater, 5 cells": lambda *run: crater(32, *run),
}


def timed(case: Case, plane: bool, seed: int, quick: bool) -> tuple[Numbers, float]:
    """Numbers of a run, and its processor time [s]."""
    begin = time.process_time()
    numbers = case(plane, seed, quick)
    return numbers, time.process_time() - begin


def row_of(name: str, quick: bool) -> dict[str, Any]:
    """Means and scatter of axisymmetric runs, and the numbers of a run in 3D."""
    runs = [timed(CASES[name], True, seed, quick) for seed in range(1 if quick else SEEDS)]
    whole, seconds = timed(CASES[name], False, 0, quick)
    values = {key: [numbers[key] for numbers, _ in runs] for key in whole}
    return rounded(
        {
            "case": name,
            "axisymmetric": {key: float(np.mean(of)) for key, of in values.items()},
            "scatter": {key: float(np.std(of)) for key, of in values.items()},
            "3D": {key: float(value) for key, value in whole.items()},
            "seconds": [float(np.mean([spent for _, spent in runs])), seconds],
        },
        5,
    )


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Table of the page."""
    lines = []
    for row in results["rows"]:
        ratio = row["seconds"][1] / row["seconds"][0]
        for k, (key, value) in enumerate(row["axisymmetric"].items()):
            full, scatter = row["3D"][key], row["scatter"][key]
            lines.append([
                row["case"] if not k else "", key, f"{value:.3g} ± {scatter:.1g}", f"{full:.3g}",
                f"{100 * (value / full - 1):+.1f} %", f"{ratio:.0f}" if not k else "",
            ])  # fmt: skip
    head = ("case", "number", "axisymmetric", "3D", "difference", "times as fast")
    return {"3D": markdown(head, lines)}


def main(argv: Sequence[str] | None = None) -> None:
    """Run the cases that the results lack."""
    parser = parser_of(__name__, __doc__ or "")
    parser.add_argument("--only", nargs="+", choices=list(CASES), help="some of the cases")
    chosen = parser.parse_args(None if argv is None else list(argv))
    results = stored(chosen.out, rows=[])
    for name in chosen.only or CASES:
        if any(row["case"] == name for row in results["rows"]):
            continue
        row = row_of(name, chosen.quick)
        results["rows"].append(row)
        results["rows"].sort(key=lambda r: list(CASES).index(r["case"]))
        print(row["case"], *tables({"rows": [row]})["3D"], sep="\n", flush=True)
        if chosen.out:
            write(chosen.out, results)


if __name__ == "__main__":
    main()
