"""Tall cylinders that collapse: the friction angle of the cone, and refinement, against Lube 2004.

    python benchmarks/tall_columns.py    # what is not in the results yet, and the table

All runs take about 9 minutes by one thread.
"""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from shared import markdown, write_tables

import granular as gr

RESULTS = Path(__file__).parent / "results" / "tall_columns.json"
PAGE = Path(__file__).parents[1] / "docs" / "reports" / "tall_columns.md"
RADIUS = 0.2
NAMES = {"mu(I)": "mu(I) of glass beads", "24": "cone of 24°", "31": "cone of 31°"}
SCHEMES = {"default": gr.schemes.default, "cell_averaged": gr.schemes.cell_averaged}
REACHES = (0.99, 0.999)
"""Shares of the mass whose radius is a run-out."""
RUNS = [
    *((a, law, 8, "default") for law in NAMES for a in (3, 6)),
    *((3, law, 12, "default") for law in ("mu(I)", "31")),
    *((a, law, 8, "cell_averaged") for law in ("mu(I)", "31") for a in (3, 6)),
    *((6, law, 12, "cell_averaged") for law in ("mu(I)", "31")),
]
"""Aspect, law, cells in a radius, scheme."""


def material(law: str) -> gr.materials.Material:
    """Glass beads, or a cone with this friction angle in triaxial compression [deg]."""
    if law == "mu(I)":
        return gr.materials.glass_beads.replace(E=1e6)
    sin = math.sin(math.radians(float(law)))
    mu = 2.0 * math.sqrt(3.0) * sin / (3.0 - sin)
    return gr.materials.DruckerPrager(E=1e6, nu=0.3, rho_c=1500.0, rho_s=2450.0, mu=mu)


def collapsed(aspect: int, law: str, cells: int, scheme: str) -> dict[str, Any]:
    """Height within a quarter of the radius, and run-outs, in radii."""
    scene = gr.scenes.cylinder_collapse(
        aspect=aspect,
        radius=RADIUS,
        cell=RADIUS / cells,
        lip=RADIUS * (2.6 + 2.0 * math.sqrt(aspect)),
        duration=1.6,
        material=material(law),
        scheme=SCHEMES[scheme],
    )
    state = gr.Simulation(scene, threads=1).run().state
    r = np.hypot(state.x[:, 0], state.x[:, 1])
    near = r < RADIUS / 4
    volume = 4.0 * state.mass[near].sum() / scene.material.rho_c
    height = volume / (math.pi * (RADIUS / 4) ** 2) / RADIUS
    return {"height": height, "runout": (np.quantile(r, REACHES) / RADIUS - 1.0).tolist()}


def main() -> None:
    rows = json.loads(RESULTS.read_text()) if RESULTS.exists() else []
    done = {(r["aspect"], r["law"], r["cells"], r["scheme"]): r for r in rows}
    for case in RUNS:
        if case not in done:
            aspect, law, cells, scheme = case
            done[case] = {"aspect": aspect, "law": law, "cells": cells, "scheme": scheme}
            done[case] |= collapsed(*case)
            kept = [done[k] for k in RUNS if k in done]
            RESULTS.write_text(json.dumps(kept, indent=1) + "\n")
    lines = []
    for case in RUNS:
        (a, law, cells, scheme), row = case, done[case]
        out_99, out_999 = row["runout"]
        lines.append([
            f"{a}", NAMES[law], scheme, f"{cells}", f"{row['height']:.2f}",
            f"{0.88 * a ** (1 / 6):.2f}", f"{out_99:.2f}", f"{out_999:.2f}", f"{1.6 * a**0.5:.2f}",
        ])  # fmt: skip
    head = ("aspect", "law", "scheme", "cells in a radius", "height", "of Lube", "run-out of 99 %")
    write_tables(PAGE, {"": markdown((*head, "of 99.9 %", "of Lube"), lines)})


if __name__ == "__main__":
    main()
