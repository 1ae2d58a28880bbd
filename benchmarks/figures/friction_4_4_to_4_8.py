"""Figures 4.4 to 4.8 of Hurley's thesis, from the results of `friction_law`."""

import argparse
import json
from pathlib import Path

from shared import RESULTS

import granular as gr
from figures.common import OUT, save
from granular import plot
from granular.grain_scale.friction_law import SteadyShear

TABLE = RESULTS / "friction_law.json"
NAMES = {"low": "e = 0.5", "high": "e = 0.85", "walls": "walls, e = 0.5"}
"""Names of the sets, by their restitution at an impact speed of a tenth of sqrt(p/rho_s)."""


def beads(inertial):
    """mu(I) of the glass beads of the continuum scenes."""
    grains = gr.materials.glass_beads_5mm
    return grains.mu_s + (grains.mu_2 - grains.mu_s) * inertial / (grains.I0 + inertial)


def main(argv: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", type=Path, default=TABLE, help="results to draw")
    parser.add_argument("--out", type=Path, default=OUT, help=f"folder of the PNG ({OUT})")
    chosen = parser.parse_args(argv)
    rows = json.loads(chosen.table.read_text())["rows"]
    sets = {}
    for row in sorted(rows, key=lambda row: row["flow"]["inertial_number"]):
        flow = SteadyShear(**row["flow"])
        sets.setdefault(row["set"], []).append(flow)
    sets = {NAMES[name]: sets[name] for name in NAMES if name in sets}
    first = next(iter(sets.values()))
    chosen.note = f"{rows[0]['case']['count']} grains and fewer below I = 0.01"
    pictures = {
        "friction_4_4": plot.friction_and_packing(sets, {"glass beads": beads}),
        "friction_4_5": plot.friction_by_law(first),
        "friction_4_6": plot.friction_shares(
            {name: flows for name, flows in sets.items() if len(flows) > 1}
        ),
        "friction_4_7": plot.scaling_of_dilation(first),
        "friction_4_8": plot.scaling_of_dissipation(first),
    }
    for name, picture in pictures.items():
        save(picture, chosen, name)
