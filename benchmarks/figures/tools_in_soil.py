"""Tools in soil and flow between cylinders: Haeri & Skonieczny 2021, figures 8, 9, 12 to 14, 17.

The pictures show forces over time, the failure zone before a blade for several laws, a blade of
finite width, soil below a wheel, an excavator at work, the convergence, and the profile between
cylinders.

It draws the records that `three_d` makes of narrow_5, narrow_5_local, narrow_5_drucker_prager,
excavator and others.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import numpy as np
from bodies.three_d import SOFT, WIDTH, arrival, scale
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from shared import RESULTS

import granular as gr
from figures.common import OUT, save
from granular import plot

TABLE = RESULTS / "three_d.json"
LAWS = {
    "thin_5_fine": "6 mm; nonlocal, d = 0.3 mm",
    "thin_5_local_fine": "6 mm; local (A = 0)",
    "narrow_5_fine": "25 mm; nonlocal, d = 0.3 mm",
    "narrow_5_local_fine": "25 mm; local (A = 0)",
    "narrow_5_drucker_prager_fine": "25 mm; Drucker-Prager",
    "narrow_5": "25 mm; nonlocal, cells of 12.5 mm",
}
FORCES = {
    "excavation_5": ("5 cm", "C0-"),
    "excavation_5_fine": ("5 cm, cells of 8.3 mm", "C1-"),
    "excavation_2": ("2 cm", "C2-"),
    "thin_5": ("5 cm, between walls", "C0--"),
    "thin_5_fine": ("5 cm, between walls, cells of 8.3 mm", "C1--"),
    "thin_2": ("2 cm, between walls", "C2--"),
    "narrow_5": ("5 cm, between walls, 25 mm thick", "C3:"),
}
"""Labels and styles of the forces: dashed between walls, dotted for a thick blade."""
WHOLE = "excavation_5_whole"
"""Run of the whole width; its lateral force should vanish, so that it shows the scatter."""
GRAINS, BEADS = 3e-4, 4e-3
"""Grain diameters for the axis of figure 8 [m]."""
SHALLOW = ("couette_shallow_8", "couette_shallow_6", "couette_shallow")
BLADES = {"thin_5_coarse": ("d", 8), "thin_5": ("d", 8), "thin_5_one": ("v", 1)}
FINEST = "thin_5_fine"
LABELS = {"thin_5": "blade, against cells of 8.33 mm", "thin_5_one": "the same, one point a cell"}
STATES = (0.5, 2.5, 4.5, 6.5)
"""Times at which the excavator is drawn [s]."""
WHEELS = (20, 40, 70)
FLOWS = {
    "couette": "H = 100 mm",
    "couette_shallow": "H = 24 mm",
    "couette_shallow_local": "H = 24 mm, A = 0",
}


def forces(table: dict, names: list[str]) -> plot.Picture:
    """Forward, vertical and lateral force over time (figure 13), and Coulomb's on a level bed."""
    picture = plot.Picture(figsize=(7.0, 3.2), layout="constrained")
    axes = picture.subplots(1, 3, sharex=True)
    for name in names:
        times, _, forward, vertical, *_ = np.array(table[name]["course"])
        label, style = FORCES[name]
        for ax, force in zip(axes, (forward, vertical), strict=False):
            ax.plot(times, force * scale(name), style, label=label)
    for depth in (0.02, 0.05):
        force = coulomb(depth)
        axes[0].axhline(force, color="0.5", lw=0.8, zorder=0)
        text = f"Coulomb, {100 * depth:g} cm"
        place = {"ha": "right", "transform": axes[0].get_yaxis_transform()}
        axes[0].text(0.98, force, text, va="bottom", **place)
    if WHOLE in table:
        times, *_, lateral = np.array(table[WHOLE]["course"])
        axes[2].plot(times, lateral, color="black")
        axes[2].set_title("whole width, cells of 25 mm")
    for ax, text in zip(axes, ("forward", "vertical", "lateral"), strict=True):
        ax.set(xlabel="t [s]", ylabel=f"{text} force [N]")
    lines = axes[0].get_legend_handles_labels()
    picture.legend(*lines, loc="outside lower center", ncols=3)
    return picture


def coulomb(depth: float) -> float:
    """Passive force of Coulomb on an upright blade in a level bed [N]: tan(phi) = mu_s, a friction
    of the blade of 30 degrees."""
    soil, phi, wall = SOFT, math.atan(SOFT.mu_s), math.radians(30.0)
    root = math.sqrt(math.sin(phi + wall) * math.sin(phi) / math.cos(wall))
    return 0.5 * soil.rho_c * 9.81 * depth**2 * WIDTH * (math.cos(phi) / (1 - root)) ** 2


def convergence(table: dict) -> plot.Picture:
    """Errors against dx/(d ppc) (figure 8): of the profile against its theory, and of the force
    against that with the finest cells."""
    picture = plot.Picture(figsize=(6, 4.2), layout="compressed")
    ax = picture.subplots()
    flows = [table[name] for name in SHALLOW if name in table]
    size = [row["cell"] / (BEADS * 8) for row in flows]
    ax.loglog(size, [100 * row["mean_error"] for row in flows], "s", label="between cylinders")
    if FINEST in table:
        finest = arrival(table[FINEST])[0]
        for name, (marker, ppc) in BLADES.items():
            if name in table:
                error = 100 * abs(arrival(table[name])[0] / finest - 1)
                x = table[name]["cell"] / (GRAINS * ppc)
                ax.loglog(x, error, marker, color="C1", label=LABELS.get(name))
    ax.set(xlabel="dx/(d ppc)", ylabel="mean error [%]")
    ax.legend()
    return picture


def profile(table: dict, names: list[str]) -> plot.Picture:
    """Angular velocity at the top between cylinders, relative to the inner one (figure 9)."""
    picture = plot.Picture(figsize=(7.0, 3.0), layout="compressed")
    axes = picture.subplots(1, 2)
    for name in names:
        r, omega, _ = np.array(table[name]["profile"])
        for ax in axes:
            ax.plot(1e3 * r, omega, "o", markersize=3, label=FLOWS[name])
    r, _, theory = np.array(table[names[0]]["profile"])
    for ax in axes:
        ax.plot(1e3 * r, theory, color="black", label="slow limit, theory")
        ax.set(xlabel="r [mm]", ylabel="angular velocity/inner cylinder")
    axes[1].set(yscale="log", ylim=(1e-5, 1))
    axes[0].legend()
    return picture


def failure(records: dict[str, Path]) -> plot.Picture:
    """Speed before the blade at the end, and the boundary of the moving zone, for each law."""
    rows = (len(records) + 1) // 2
    picture = plot.Picture(figsize=(7.0, 1.5 * rows), layout="compressed")
    axes = picture.subplots(rows, 2, squeeze=False, sharex=True, sharey=True).ravel()
    for ax in axes[len(records) :]:
        ax.set_axis_off()
    for ax, (name, path) in zip(axes, records.items(), strict=False):
        with gr.open(path) as record:
            late = [record[i] for i in range(max(len(record) - 10, 0), len(record))]
            speed = record.scene.parameters["speed"]
            blade = gr.measure.body_motion(record).position[-1]
        end = late[-1].scene.grid
        extent = ((end.lower[0], end.upper[0]), (end.lower[2], 0.1))
        options = {"limits": (0.0, speed), "extent": extent, "bar": False, "title": LAWS[name]}
        plot.frame(late[-1], "speed", ax=ax, slab=(0.0, end.upper[1]), **options)
        surface = gr.measure.soil_tools.failure_surface(late, speed=speed)
        before = surface.x > blade[0]
        ax.plot(surface.x[before], surface.z[before], color="white", lw=2.2)
        ax.plot(surface.x[before], surface.z[before], color="black")
        ax.label_outer()
    scale = ScalarMappable(Normalize(0.0, speed), "viridis")
    picture.colorbar(scale, ax=axes.tolist(), label="speed [m/s]", aspect=40)
    return picture


def wide(path: Path) -> plot.Picture:
    """A blade of finite width at the end of its path (figure 12): at its middle and from above."""
    with gr.open(path) as record:
        state, parameters = record[len(record) - 1], record.scene.parameters
        blade = gr.measure.body_motion(record).position[-1]
    grid, speed = state.scene.grid, parameters["speed"]
    picture = plot.Picture(figsize=(7.0, 2.1), layout="compressed")
    axes = picture.subplots(1, 2, width_ratios=(2.2, 1))
    extent = ((grid.lower[0], grid.upper[0]), (grid.lower[2], 0.1))
    options = {"slab": (0.0, 2 * grid.cell), "limits": (0.0, speed), "extent": extent}
    plot.frame(state, "speed", ax=axes[0], **options)
    column = np.floor((state.x[:, :2] - grid.lower[:2]) / grid.cell).astype(int)
    height = np.full(grid.shape[:2], np.nan)
    np.fmax.at(height, tuple(column.T), state.x[:, 2])
    x, y = (grid.lower[k] + (np.arange(grid.shape[k]) + 0.5) * grid.cell for k in (0, 1))
    both = 1e3 * np.concatenate([height[:, ::-1], height], axis=1).T
    levels = np.linspace(-50.0, 50.0, 21)
    image = axes[1].contourf(
        x, np.concatenate([-y[::-1], y]), both, levels, cmap="RdBu_r", extend="both"
    )
    half = parameters["blade"][1] / 2
    axes[1].plot([blade[0]] * 2, [-half, half], color="black")
    axes[1].set(xlabel="x [m]", ylabel="y [m]", title="surface from above", aspect="equal")
    picture.colorbar(image, ax=axes[1], label="z [mm]", ticks=levels[::5])
    return picture


def below_wheels(paths: dict[int, Path]) -> plot.Picture:
    """Speed of the soil at the window, relative to the rim (figure 17).

    It is the mean of each point over the last half second of rolling.
    """
    picture = plot.Picture(figsize=(7.0, 1.75 * len(paths)), layout="compressed")
    axes = picture.subplots(len(paths), 1, squeeze=False, sharex=True).ravel()
    for ax, (slip, path) in zip(axes, paths.items(), strict=True):
        with gr.open(path) as record:
            known, late = record.scene.parameters, record.times >= record.times[-1] - 0.5
            states = [record[i] for i in np.flatnonzero(late)]
        rim = known["omega"] * known["diameter"] / 2
        assert all((state.id == states[-1].id).all() for state in states)  # none has left
        speed = np.mean([np.linalg.norm(state.v, axis=1) for state in states], axis=0) / rim
        grid = states[-1].scene.grid
        extent = ((grid.lower[0], grid.upper[0]), (grid.lower[2], 0.06))
        plot.frame(
            states[-1], speed, ax=ax, slab=(0.0, 2 * grid.cell), extent=extent, limits=(0.0, 0.5),
            title=f"slip {slip} %", bar=False,
        )  # fmt: skip
        ax.label_outer()
    scale = ScalarMappable(Normalize(0.0, 0.5), "viridis")
    picture.colorbar(scale, ax=axes.tolist(), label="speed / speed of the rim", aspect=40)
    return picture


def excavator(path: Path) -> plot.Picture:
    """Shear rate next to the symmetry plane: at rest, flowing, and falling (stress-free)."""
    with gr.open(path) as record:
        cell = record.scene.grid.cell
        chosen = [record[int(np.argmin(np.abs(record.times - t)))] for t in STATES]
    picture = plot.Picture(figsize=(7.0, 4.6), layout="compressed")
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
    picture = plot.Picture(figsize=(7.0, 3.1), layout="compressed")
    axes = picture.subplots(1, 2)
    rows = {slip: table[f"wheel_{slip}"] for slip in WHEELS if f"wheel_{slip}" in table}
    quantities = ("pull_over_load", "drawbar pull/load", 1), ("sinkage", "sinkage [mm]", 1e3)
    for ax, (quantity, text, unit) in zip(axes, quantities, strict=True):
        ax.plot(list(rows), [unit * row[quantity] for row in rows.values()], "o-")
        ax.set(xlabel="slip [%]", ylabel=text)
    return picture


def of_table(table: dict) -> dict[str, plot.Picture]:
    """Pictures of the numbers in the table."""
    pictures = {"three_d_forces": forces(table, [name for name in FORCES if name in table])}
    if any(f"wheel_{slip}" in table for slip in WHEELS):
        pictures["three_d_wheel"] = wheels(table)
    if "couette_shallow" in table or FINEST in table:
        pictures["three_d_convergence"] = convergence(table)
    flows = [name for name in FLOWS if name in table]
    if flows:
        pictures["three_d_couette"] = profile(table, flows)
    return pictures


def of_records(folder: Path) -> dict[str, plot.Picture]:
    """Pictures of the existing records."""
    there = {path.stem: path for path in folder.glob("*.h5")}
    pictures = {}
    laws = {name: there[name] for name in LAWS if name in there}
    if laws:
        pictures["three_d_failure"] = failure(laws)
    rolled = {slip: there[f"wheel_{slip}"] for slip in WHEELS if f"wheel_{slip}" in there}
    if rolled:
        pictures["three_d_below_wheels"] = below_wheels(rolled)
    for name, picture in (("excavation_5_fine", wide), ("excavator", excavator)):
        if name in there:
            pictures[f"three_d_{picture.__name__}"] = picture(there[name])
    return pictures


def main(argv: list[str] | None = None) -> None:
    """Draw all pictures for which records or numbers exist."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--records", type=Path, default=Path("build/three_d"))
    parser.add_argument("--results", type=Path, default=TABLE)
    parser.add_argument("--out", type=Path, default=OUT)
    chosen = parser.parse_args(argv)
    table = json.loads(chosen.results.read_text())
    pictures = of_table(table) | of_records(chosen.records)
    for name, picture in pictures.items():
        save(picture, chosen, name)
