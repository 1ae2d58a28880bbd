"""Tall cylinders that collapse, against Lube 2004: yield surface, dilation, damping, refinement.

All runs take about 15 minutes by one thread.
"""

import argparse
import math
from typing import Any

import numpy as np
from shared import RESULTS, markdown, stored, write

import granular as gr
from accuracy import own_mohr_coulomb

OUT = RESULTS / "tall_columns.json"
RADIUS = 0.2
NAMES = {
    "mu(I)": "mu(I) of glass beads",
    "24": "cone of 24°",
    "31": "cone of 31°",
    "31 free": "cone of 31°, undamped",
    "31 dilating": "cone of 31°, undamped, dilating",
    "MC": "Mohr-Coulomb of 31°, undamped",
    "MC dilating": "Mohr-Coulomb of 31°, undamped, dilating",
}
LOOSENED, DILATANCY = 0.05, 0.3
"""Logarithm of the volume that the dilating laws gain, and the rate at first, by shear strain."""
SCHEMES = {"default": gr.schemes.default, "cell_averaged": gr.schemes.cell_averaged}
REACHES = (0.99, 0.999)
"""Shares of the mass whose radius is a run-out."""
RUNS = [
    *((a, law, 8, "default") for law in list(NAMES)[:3] for a in (3, 6)),
    *((3, law, 12, "default") for law in ("mu(I)", "31")),
    *((a, law, 8, "cell_averaged") for law in ("mu(I)", "31") for a in (3, 6)),
    *((6, law, 12, "cell_averaged") for law in ("mu(I)", "31")),
    *((a, law, 8, "cell_averaged") for law in list(NAMES)[3:] for a in (3, 6)),
    *((a, "31 free", 12, "cell_averaged") for a in (3, 6)),
]
"""Aspect, law, cells in a radius, scheme."""


def material(law: str) -> gr.materials.Material:
    """Glass beads, or a friction angle in triaxial compression [deg]: a cone or Mohr-Coulomb.

    Names without "undamped" are laws of the package. The schemes know their friction and damp slow
    flow; the others are user-defined laws.
    """
    numbers = {"E": 1e6, "nu": 0.3, "rho_c": 1500.0}
    if law == "mu(I)":
        return gr.materials.glass_beads.replace(E=1e6)
    if law.startswith("MC"):
        return own_mohr_coulomb.material(phi_deg=31.0, **dilation(law), **numbers)
    sin = math.sin(math.radians(float(law[:2])))
    mu = 2.0 * math.sqrt(3.0) * sin / (3.0 - sin)
    if law in ("24", "31"):
        return gr.materials.DruckerPrager(rho_s=2450.0, mu=mu, **numbers)
    return own_mohr_coulomb.material(mu=mu, **dilation(law), **numbers)


def dilation(law: str) -> dict[str, float]:
    """Numbers of the dilating laws."""
    dilates = law.endswith("dilating")
    return {"dilatancy": DILATANCY, "dilation": LOOSENED} if dilates else {}


def collapsed(aspect: int, law: str, cells: int, scheme: str) -> dict[str, Any]:
    """Height within a quarter of the radius at rho_c, and run-outs, in radii."""
    scene = gr.scenes.cylinder_collapse(
        aspect=aspect,
        radius=RADIUS,
        cell=RADIUS / cells,
        lip=RADIUS * (2.6 + 2.0 * math.sqrt(aspect)),
        duration=1.6,
        material=material(law),
        scheme=SCHEMES[scheme],
    )
    sim = gr.Simulation(scene, threads=1)
    if dilation(law):  # rho_c is the critical density, and the column is denser
        filled = sim.buffers["mass"] > 0
        sim.buffers["mass"][:] *= math.exp(LOOSENED)
        sim.buffers["log_density"][filled] += LOOSENED
    state = sim.run().state
    r = np.hypot(state.x[:, 0], state.x[:, 1])
    near = r < RADIUS / 4
    volume = 4.0 * state.mass[near].sum() / scene.material.rho_c
    height = volume / (math.pi * (RADIUS / 4) ** 2) / RADIUS
    return {"height": height, "runout": (np.quantile(r, REACHES) / RADIUS - 1.0).tolist()}


def by_case(rows: list[dict[str, Any]]) -> dict[tuple, dict[str, Any]]:
    """Rows by aspect, law, cells and scheme."""
    return {(r["aspect"], r["law"], r["cells"], r["scheme"]): r for r in rows}


def tables(results: dict[str, Any]) -> dict[str, list[str]]:
    """Tables of the page."""
    done = by_case(results["rows"])
    done = {case: done[case] for case in RUNS if case in done}
    return {"columns": heights_and_runouts(done), "exponents": exponents(done)}


def heights_and_runouts(done: dict[tuple, dict[str, Any]]) -> list[str]:
    """Table of the runs."""
    lines = []
    for (a, law, cells, scheme), row in done.items():
        out_99, out_999 = row["runout"]
        lines.append([
            f"{a}", NAMES[law], scheme, f"{cells}", f"{row['height']:.2f}",
            f"{0.88 * a ** (1 / 6):.2f}", f"{out_99:.2f}", f"{out_999:.2f}", f"{1.6 * a**0.5:.2f}",
        ])  # fmt: skip
    head = ("aspect", "law", "scheme", "cells in a radius", "height", "of Lube", "run-out of 99 %")
    return markdown((*head, "of 99.9 %", "of Lube"), lines)


def exponents(done: dict[tuple, dict[str, Any]]) -> list[str]:
    """Table of the exponents of run-outs and height between the aspects 3 and 6."""
    lines = []
    for law, cells, scheme in dict.fromkeys(case[1:] for case in done):
        pair = [done.get((a, law, cells, scheme)) for a in (3, 6)]
        if None in pair:
            continue
        low, high = ((*row["runout"], row["height"]) for row in pair)
        rises = [f"{math.log2(b / a):.2f}" for a, b in zip(low, high, strict=True)]
        lines.append([NAMES[law], scheme, f"{cells}", *rises])
    lines.append(["Lube et al. 2004", "", "", "0.50", "0.50", f"{1 / 6:.2f}"])
    head = ("law", "scheme", "cells in a radius", "run-out of 99 %", "of 99.9 %", "height")
    return markdown(head, lines)


def main(argv: list[str] | None = None) -> None:
    """Run the cases that the results lack."""
    argparse.ArgumentParser(description=__doc__.splitlines()[0]).parse_args(argv)
    done = by_case(stored(OUT, rows=[])["rows"])
    for case in RUNS:
        if case not in done:
            aspect, law, cells, scheme = case
            done[case] = {"aspect": aspect, "law": law, "cells": cells, "scheme": scheme}
            done[case] |= collapsed(*case)
            ordered = [done[k] for k in RUNS if k in done]
            write(OUT, {"rows": ordered})
