"""Picture of the columns of contact dynamics: error against core-seconds for each code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from accuracy.errors import front
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from granular.plot import Picture
from peers.columns import ASPECTS, CODES
from peers.columns_errors import PANELS, Reference, Row, of_panel

STYLES: dict[str, dict[str, Any]] = {
    "default": {"color": "tab:blue", "marker": "D"},
    "cell_averaged": {"color": "goldenrod", "marker": "h"},
    "published": {"color": "tab:red", "marker": "*"},
    "taichi": {"color": "tab:brown", "marker": "P"},
    "taichi_wall": {"color": "black", "marker": "p"},
    "taichi_sand": {"color": "tab:purple", "marker": "v"},
    "newton": {"color": "tab:pink", "marker": "X"},
    "newton_long": {"color": "tab:cyan", "marker": "d"},
    "kratos": {"color": "tab:green", "marker": "s"},
    "kratos_implicit": {"color": "tab:olive", "marker": "^"},
}
LAW_NAMES = {"mu_I": "mu(I)", "drucker_prager": "Drucker-Prager"}
KINDS = {
    "discs": "against contact dynamics",
    "finest": "against our finest runs",
    "peer": "against the finest run of Taichi",
}
CEILING = 2.0
"""Larger errors are drawn at this value."""


def _panel(ax: Axes, points: Sequence[tuple[Row, float]], reference: Reference) -> None:
    """Errors of one law and column, the front, and the uncertainty of the reference."""
    for code, look in STYLES.items():
        for per_cell in sorted({r["points"] for r, _ in points}):
            mine = [(r, e) for r, e in points if (r["code"], r["points"]) == (code, per_cell)]
            mine.sort(key=lambda pair: pair[0]["cells"])
            if mine:
                cost = [r["core_seconds"] for r, _ in mine]
                error = [min(e, CEILING) for _, e in mine]
                fill = {} if per_cell == 4 else {"markerfacecolor": "white"}
                ax.plot(cost, error, linewidth=0.8, markersize=4.5, **look, **fill)
    floor = reference.uncertainty["surface"]
    on = front(points, floor)
    if on:
        cost = [r["core_seconds"] for r, _ in on]
        ax.step(cost, [e for _, e in on], where="post", color="black", linewidth=1.4, zorder=0)
    ax.axhspan(1e-4, floor, color="0.9", zorder=-1)
    low = min((e for _, e in points), default=0.01)
    ax.set(xscale="log", yscale="log", ylim=(0.7 * min(low, floor), 1.0))
    ax.grid(True, which="major", linewidth=0.4, color="0.85")


def chart(
    rows: Sequence[Row], references: Mapping[tuple[str, str, float], Reference]
) -> Picture | None:
    """A row of panels for each law and reference, a column for each aspect ratio."""
    if not references:
        return None
    fig = Picture(figsize=(7.0, 7.2), layout="constrained")
    axes = fig.subplots(len(PANELS), len(ASPECTS), sharex="col")
    for line, (law, kind) in zip(axes, PANELS, strict=True):
        for ax, aspect in zip(line, ASPECTS, strict=True):
            reference = references.get((law, kind, aspect))
            if reference is None:
                ax.set_axis_off()
                continue
            _panel(ax, of_panel(rows, law, aspect, reference), reference)
            ax.set_title(f"{LAW_NAMES[law]}, a = {aspect:g}\n{KINDS[kind]}")
            if aspect == ASPECTS[0]:
                ax.set_ylabel("L1 of the deposit over its area")
            if (law, kind) == PANELS[-1]:
                ax.set_xlabel("core-seconds")
    known = {r["code"] for r in rows}
    handles = [
        Line2D([], [], linewidth=0.8, label=CODES[code].label, **look)
        for code, look in STYLES.items()
        if code in known
    ]
    white = {"marker": "o", "color": "0.3", "markerfacecolor": "white", "linestyle": ""}
    handles += [Line2D([], [], label="16 points per cell, else 4", **white)]
    handles += [Line2D([], [], color="black", linewidth=1.4, label="front")]
    fig.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return fig
