"""Pictures of the maps: colours for verdicts, numbers in the cells."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from PIL import Image

from stability.cells import DEGRADED, REFUSED, STABLE, Map

COLOURS = {STABLE: "#8fd694", DEGRADED: "#f6a15a", REFUSED: "#c9c9d6"}

FIGURES: dict[str, tuple[str, ...]] = {
    "stability_time_step": (
        "courant_published_flip",
        "courant_ugimp_flip",
        "courant_quadratic_flip",
        "courant_quadratic_apic",
        "courant_default_tpic",
        "courant_cell_averaged_tpic",
        "courant_space",
        "courant_nu",
        "courant_speed",
        "incline_courant",
        "arrangement",
    ),
    "stability_flows": (
        "incline_angles",
        "incline_columns",
        "incline_seeding",
        "incline_refinement",
        "law_ends",
        "softness",
    ),
    "stability_schemes": (
        "patch",
        "locking",
        "tearing",
        "null_space",
        "wave",
        "rotation",
        "rest_speed",
        "rest_pressure",
        "slug",
    ),
}
"""Maps of each figure."""


def number(value: float) -> str:
    """A number short enough for a cell; empty for a run that stopped with an error."""
    if math.isnan(value):
        return "stop"
    if math.isinf(value):
        return "inf"
    if value != 0 and (abs(value) >= 1e4 or abs(value) < 1e-3):
        mantissa, exponent = f"{value:.0e}".split("e")
        return f"{mantissa}e{int(exponent)}"
    return f"{value:.2g}" if abs(value) < 100 else f"{value:.0f}"


def panel(axes: Axes, limits: Map) -> None:
    """One map."""
    rows = list(dict.fromkeys(cell.row for cell in limits.cells))
    columns = list(dict.fromkeys(cell.column for cell in limits.cells))
    order = list(COLOURS)
    table = [[math.nan] * len(columns) for _ in rows]
    for cell in limits.cells:
        i, j = rows.index(cell.row), columns.index(cell.column)
        table[i][j] = order.index(cell.verdict)
        axes.text(j, i, number(cell.value), ha="center", va="center")
    axes.imshow(table, cmap=ListedColormap(COLOURS.values()), vmin=-0.5, vmax=2.5, aspect="auto")
    heads = [name.replace(": ", " deg\nI/I0 = ") for name in columns]  # of slopes
    axes.set_xticks(range(len(columns)), heads)
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xticks([j + 0.5 for j in range(len(columns) - 1)], minor=True)
    axes.set_yticks([i + 0.5 for i in range(len(rows) - 1)], minor=True)
    axes.grid(which="minor", color="white", linewidth=1.5)
    axes.tick_params(which="both", length=0)
    axes.set_xlabel(limits.columns)
    axes.set_ylabel(limits.rows)
    bound = f"{'>=' if limits.least else '<='} {limits.sound:g}"
    axes.set_title(f"{limits.title}\n{limits.quantity}; stable {bound}")


def figures(maps: dict[str, Map], folder: Path) -> None:
    """Write the figures for which maps exist."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, members in FIGURES.items():
        present = [maps[m] for m in members if m in maps]
        if not present:
            continue
        heights = [len({cell.row for cell in limits.cells}) + 3.6 for limits in present]
        figure = Figure(figsize=(7.0, 0.19 * sum(heights) + 0.4), layout="constrained")
        grid = figure.add_gridspec(len(present), 1, height_ratios=heights)
        for place, limits in zip(grid, present, strict=True):
            panel(figure.add_subplot(place), limits)
        patches = [Patch(color=colour, label=verdict) for verdict, colour in COLOURS.items()]
        figure.legend(handles=patches, loc="outside lower center", ncols=3)
        path = folder / f"{name}.png"
        figure.savefig(path)
        with Image.open(path) as picture:  # few colours: a third of the size
            picture.convert("RGB").quantize(64).save(path, optimize=True)
