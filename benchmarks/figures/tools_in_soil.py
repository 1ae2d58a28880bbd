"""Tools in soil: forces over depth, what fails before a blade by law, an excavator at work.

Draws the records of `benchmarks/three_d.py`, which makes them:

    python benchmarks/three_d.py narrow_5 narrow_5_local narrow_5_drucker_prager excavator ...
    python benchmarks/figures/tools_in_soil.py --records build/three_d --out build/figures
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from common import DPI, OUT

import granular as gr
from granular import plot

RESULTS = Path(__file__).parents[1] / "results" / "three_d.json"
LAWS = {
    "thin_5": "6 mm, two sides; nonlocal, d = 0.3 mm",
    "thin_5_local": "6 mm, two sides; local (A = 0)",
    "narrow_5": "25 mm, nodes within; nonlocal, d = 0.3 mm",
    "narrow_5_drucker_prager": "25 mm, nodes within; Drucker-Prager",
}
FORCES = {
    "thin_5": "two sides, 5 cm",
    "thin_5_local": "two sides, 5 cm, A = 0",
    "thin_2": "two sides, 2 cm",
    "narrow_5": "nodes within, 5 cm",
    "narrow_5_fine": "the same, cells of 8.3 mm",
}
WIDTH = 0.305
"""Of the blade [m]: forces between walls 0.05 m apart are shown as for it."""
STATES = (0.5, 2.5, 4.5, 6.5)
"""Times at which the excavator is seen [s]."""
WHEELS = (20, 40, 70)


def forces(table: dict, names: list[str]) -> plot.Picture:
    """Forward and vertical force over time."""
    picture = plot.Picture(figsize=(9, 3.8), layout="compressed")
    axes = picture.subplots(1, 2, sharex=True)
    for name in names:
        times, _, forward, vertical, *_ = np.array(table[name]["course"])
        for ax, force in zip(axes, (forward, vertical), strict=True):
            ax.plot(times, force * WIDTH / 0.05, label=FORCES[name])
    for ax, text in zip(axes, ("forward", "vertical"), strict=True):
        ax.set(xlabel="t [s]", ylabel=f"{text} force [N]")
    axes[0].legend(fontsize="small")
    return picture


def failure(records: dict[str, Path]) -> plot.Picture:
    """Speed before the blade at the end, and where it parts from rest, by law."""
    rows = (len(records) + 1) // 2
    picture = plot.Picture(figsize=(11, 2.6 * rows), layout="compressed")
    axes = picture.subplots(rows, 2, squeeze=False).ravel()
    for ax in axes[len(records) :]:
        ax.set_axis_off()
    for ax, (name, path) in zip(axes, records.items(), strict=False):
        with gr.open(path) as record:
            late = [record[i] for i in range(max(len(record) - 10, 0), len(record))]
            speed = record.scene.parameters["speed"]
        end = late[-1].scene.grid
        extent = ((end.lower[0], end.upper[0]), (end.lower[2], 0.1))
        plot.frame(
            late[-1], "speed", ax=ax, limits=(0.0, speed), extent=extent, title=LAWS.get(name, name)
        )
        found = gr.measure.failure_surface(late, speed=speed)
        ax.step(found.x, found.z, where="mid", color="black")
    return picture


def excavator(path: Path) -> plot.Picture:
    """Shear rate next to the symmetry plane: at rest, flowing, and falling (free of stress)."""
    with gr.open(path) as record:
        cell = record.scene.grid.cell
        chosen = [record[int(np.argmin(np.abs(record.times - t)))] for t in STATES]
    picture = plot.Picture(figsize=(11, 6.5), layout="compressed")
    for ax, state in zip(picture.subplots(2, 2).ravel(), chosen, strict=True):
        low, high = state.scene.grid.lower, state.scene.grid.upper
        extent = ((low[0], high[0]), (low[2], 0.45))
        rate = np.where(state.dense, state.shear_rate, np.nan)
        options = {"ax": ax, "extent": extent, "slab": (0.0, 2 * cell), "limits": (0.0, 5.0)}
        plot.frame(state, np.nan_to_num(rate), log=False, label="shear rate [1/s]", **options)
        free = ~state.dense & (state.x[:, 1] < 2 * cell)
        ax.plot(*state.x[free][:, [0, 2]].T, ".", color="red", markersize=3)
    return picture


def wheels(table: dict) -> plot.Picture:
    """Drawbar pull over load, and sinkage, by slip."""
    picture = plot.Picture(figsize=(8, 3.5), layout="compressed")
    axes = picture.subplots(1, 2)
    rows = {slip: table[f"wheel_{slip}"] for slip in WHEELS if f"wheel_{slip}" in table}
    for ax, quantity, text, unit in zip(
        axes,
        ("pull_over_load", "sinkage"),
        ("drawbar pull/load", "sinkage [mm]"),
        (1, 1e3),
        strict=True,
    ):
        ax.plot(list(rows), [unit * row[quantity] for row in rows.values()], "o-")
        ax.set(xlabel="slip [%]", ylabel=text)
    return picture


def main(argv: list[str] | None = None) -> None:
    """Draw what there are records and numbers of."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--records", type=Path, default=Path("build/three_d"))
    parser.add_argument("--results", type=Path, default=RESULTS)
    parser.add_argument("--out", type=Path, default=OUT)
    chosen = parser.parse_args(argv)
    table = json.loads(chosen.results.read_text())
    paths = {name: chosen.records / f"{name}.h5" for name in (*LAWS, "excavator")}
    there = {name: path for name, path in paths.items() if path.exists()}
    pictures = {"tools_forces": forces(table, [name for name in FORCES if name in table])}
    if any(f"wheel_{slip}" in table for slip in WHEELS):
        pictures["tools_wheel"] = wheels(table)
    laws = {name: path for name, path in there.items() if name in LAWS}
    if laws:
        pictures["tools_failure"] = failure(laws)
    if "excavator" in there:
        pictures["tools_excavator"] = excavator(there["excavator"])
    chosen.out.mkdir(parents=True, exist_ok=True)
    for name, picture in pictures.items():
        picture.savefig(chosen.out / f"{name}.png", dpi=DPI)
        print(chosen.out / f"{name}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
