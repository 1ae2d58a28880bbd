"""Tall cylinders that collapse: the friction angle of the cone, and refinement, against Lube 2004.

python benchmarks/tall_columns.py run     # about 6 minutes by one thread
python benchmarks/tall_columns.py table   # the table of docs/reports/tall_columns.md
"""

import json
import math
import sys
from pathlib import Path

import numpy as np

import granular as gr

RESULTS = Path(__file__).parent / "results" / "tall_columns.json"
RADIUS = 0.2
NAMES = {"mu(I)": "mu(I) of glass beads", "24": "cone of 24°", "31": "cone of 31°"}
RUNS = [(a, law, 8) for law in NAMES for a in (3, 6)] + [(3, law, 12) for law in ("31", "mu(I)")]


def material(law):
    """Glass beads, or a cone with this friction angle in triaxial compression [deg]."""
    if law == "mu(I)":
        return gr.materials.glass_beads.replace(E=1e6)
    sin = math.sin(math.radians(float(law)))
    mu = 2.0 * math.sqrt(3.0) * sin / (3.0 - sin)
    return gr.materials.DruckerPrager(E=1e6, nu=0.3, rho_c=1500.0, rho_s=2450.0, mu=mu)


def collapsed(aspect, law, cells):
    """Height within a quarter of the radius, and run-out, in radii."""
    lip = RADIUS * (2.6 + 2.0 * math.sqrt(aspect))
    scene = gr.scenes.cylinder_collapse(
        aspect=aspect,
        radius=RADIUS,
        cell=RADIUS / cells,
        lip=lip,
        duration=1.6,
        material=material(law),
    )
    state = gr.Simulation(scene, threads=1).run().state
    near = np.hypot(state.x[:, 0], state.x[:, 1]) < RADIUS / 4
    volume = 4.0 * state.mass[near].sum() / scene.material.rho_c
    height = volume / (math.pi * (RADIUS / 4) ** 2) / RADIUS
    return {"height": height, "runout": gr.measure.runout(state).quantile}


def run():
    """Run all, and keep what is done after each."""
    rows = []
    for aspect, law, cells in RUNS:
        found = collapsed(aspect, law, cells)
        rows.append({"aspect": aspect, "law": law, "cells": cells, **found})
        RESULTS.write_text(json.dumps(rows, indent=1) + "\n")


def table():
    """Print the rows, with the laws of Lube et al. beside them."""
    print("| aspect | law | cells in a radius | height | of Lube | run-out | of Lube |")
    print("|---|---|---|---|---|---|---|")
    for row in json.loads(RESULTS.read_text()):
        a = row["aspect"]
        print(
            f"| {a} | {NAMES[row['law']]} | {row['cells']} | {row['height']:.2f} "
            f"| {0.88 * a ** (1 / 6):.2f} | {row['runout']:.2f} | {1.6 * a**0.5:.2f} |"
        )


if __name__ == "__main__":
    {"run": run, "table": table}[sys.argv[1]]()
