"""Figures 5.5 and 5.6, table 5.4: columns that collapse on a level floor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from granular import plot, scenes, sph
from granular.papers.dunatunga2015.panels import axes_grid
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.sph_measures import BETAS, far, packed, power_laws
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.sph import Scene, Viscoplastic
from granular.tools.arrays import Array

GRIT = (1.8, 2.4, 3.2, 4.2, 5.6, 7.5, 10.0, 13.0)
GLASS = (*GRIT, 18.0)
"""Aspect ratios of the fits, which hold above 1.7; the thesis does not list its own."""
LOW = (0.5, 1.0)
"""Aspect ratios below, which are drawn."""
QUICK = (1.8, 2.4)
LENGTHS = {"grit": 0.09, "glass": 0.025}
SPACINGS = {"grit": 0.01, "glass": 0.005}
"""Length of the columns and spacing of the particles of each material [m]."""
WIDTH = 0.1
"""Period across in full size [m], that of the thesis; otherwise columns are 2D."""
PACKINGS = 2

TABLE_5_4 = {
    ("grit", "no dilation"): (1.24, 0.55, 1.99, 0.72),
    ("glass", "no dilation"): (2.07, 0.61, 3.49, 0.72),
    ("grit", "dilation"): (0.97, 0.61, 0.79, 1.01),
    ("glass", "dilation"): (1.38, 0.68, 1.36, 0.96),
}
"""lambda_1, alpha_1, lambda_2 and alpha_2 of the thesis."""
NAMES = {"lambda_1": "lambda_1", "alpha_1": "alpha_1", "lambda_L": "lambda_2", "alpha_L": "alpha_2"}
"""Names of the thesis for those of `power_laws`."""

Runout = tuple[float, dict[str, float]]
"""Aspect ratio, and the distances at rest."""


def material(name: str, beta: float) -> Viscoplastic:
    """Grit or glass with this largest rate of dilation."""
    grains: Viscoplastic = {"grit": sph.grit, "glass": sph.glass}[name]
    return grains.replace(dilation=beta)


def column(runs: Runs, name: str, beta: float, aspect: float) -> Scene:
    """A column of one material."""
    return scenes.column_collapse_sph(
        aspect=aspect,
        width=WIDTH if runs.full else 0.0,
        material=material(name, beta),
        length=LENGTHS[name],
        spacing=SPACINGS[name],
    )


# ---- figure 5.5 ----


@PAPER.figure(
    "5.5",
    "columns of grit and of glass before they collapse",
    seconds=4.0,
    paper={"length of grit [m]": 0.09, "length of glass [m]": 0.025},
)
def initial(runs: Runs) -> Drawn:
    """Let two columns settle behind their gate."""
    picture = Picture(figsize=(8.0, 4.0), layout="compressed")
    numbers: dict[str, Number] = {}
    for ax, name in zip(picture.subplots(1, 2), LENGTHS, strict=True):
        scene = column(runs, name, 0.0, 3.2)
        length = LENGTHS[name]
        # The last state before the gate is removed.
        (state,) = runs.states_at(scene, (0.98 * float(scene.parameters["settle"]),), name)
        extent = ((0.0, 3 * length), (0.0, 1.2 * 3.2 * length))
        plot.frame(state, "pressure", ax=ax, extent=extent, title=name)
        numbers[f"length of {name} [m]"] = float(state.x[:, 0].max()) + 0.5 * scene.grid.cell
    return Drawn({"": picture}, numbers)


# ---- figure 5.6 and table 5.4 ----


def runouts(runs: Runs) -> dict[tuple[str, str], list[Runout]]:
    """Columns at rest, by material and dilation; several packings of each aspect ratio."""
    rows: dict[tuple[str, str], list[Runout]] = {}
    for name, aspects in (("grit", GRIT), ("glass", GLASS)):
        for words, beta in BETAS.items():
            for aspect in QUICK if runs.quick else (*LOW, *aspects):
                for seed in range(1 if runs.quick else PACKINGS):
                    scene = packed(column(runs, name, beta, aspect), seed)
                    label = f"{name}, {words}, a = {aspect:g}, packing {seed + 1}"
                    (state,) = runs.states_at(scene, (scene.duration,), label)
                    rows.setdefault((name, words), []).append((aspect, far(state)))
    return rows


def fits(rows: Sequence[Runout], name: str) -> dict[str, float]:
    """Constants of eq. 5.32 for a > 1.7, with those of the distance of 99 % of the mass."""
    tall = [(aspect, ends) for aspect, ends in rows if aspect > 1.7]
    aspects, distances = zip(*tall, strict=True)
    return power_laws(aspects, LENGTHS[name], distances)


def numbers_of(rows: Mapping[tuple[str, str], Sequence[Runout]]) -> dict[str, Number]:
    """Constants of all materials, by the names of the thesis."""
    numbers: dict[str, Number] = {}
    for (name, words), of_material in rows.items():
        fit = fits(of_material, name)
        for key, symbol in (*NAMES.items(), ("alpha_L99", "alpha_2 of 99 % of the mass")):
            numbers[f"{symbol}, {name}, {words}"] = fit[key]
    return numbers


THESIS = {
    f"{symbol}, {name}, {words}": value
    for (name, words), values in TABLE_5_4.items()
    for symbol, value in zip(("lambda_1", "alpha_1", "lambda_2", "alpha_2"), values, strict=True)
}


@PAPER.figure(
    "5.6",
    "heights and run-outs of columns against their aspect ratio, with power laws",
    seconds=280.0,
    paper=THESIS,
)
def scaling(runs: Runs) -> Drawn:
    """Let columns of both materials collapse, and fit eq. 5.32 above an aspect ratio of 1.7.

    L is the farthest particle and H the highest, as in the thesis.
    """
    rows = runouts(runs)
    picture, ((plain_H, plain_L), (dilative_H, dilative_L)) = axes_grid(2, 2)
    for words, up, along in (
        ("no dilation", plain_H, plain_L), ("dilation", dilative_H, dilative_L)
    ):  # fmt: skip
        for name, marker, color in (("grit", "s", "C0"), ("glass", "o", "C1")):
            of_material = rows[name, words]
            draw_scaling(up, along, of_material, name, marker, color)
        for ax, ylabel in ((up, "$H_0/H$"), (along, "$(L-L_0)/L_0$")):
            ax.set(xscale="log", yscale="log", xlabel="$a = H_0/L_0$", ylabel=ylabel, title=words)
            ax.legend(fontsize="small")
    return Drawn({"": picture}, numbers_of(rows))


@PAPER.figure(
    "table_5.4",
    "constants of the power laws of heights and run-outs",
    seconds=280.0,
    paper=THESIS,
)
def table_5_4(runs: Runs) -> Drawn:
    """Numbers of figure 5.6 alone."""
    return Drawn({}, numbers_of(runouts(runs)))


def draw_scaling(
    up: Axes, along: Axes, rows: Sequence[Runout], name: str, marker: str, color: str
) -> None:
    """Heights and run-outs of a material, and their power laws."""
    length, fit = LENGTHS[name], fits(rows, name)
    a: Array = np.array([aspect for aspect, _ in rows])
    heights = np.array([ends["H"] for _, ends in rows])
    reach = np.array([ends["L"] for _, ends in rows])
    tall = np.array([1.7, a.max()])
    for ax, values, key in ((up, a * length / heights, "1"), (along, reach / length - 1, "L")):
        ax.plot(a, values, marker, color=color, fillstyle="none", label=name)
        law = fit[f"lambda_{key}"] * tall ** fit[f"alpha_{key}"]
        ax.plot(tall, law, "--", color=color, label=f"slope {fit[f'alpha_{key}']:.2f}")
