"""Pictures of the error against core-seconds, and of the dependence of the error on settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from accuracy.cases import HYDRODYNAMICS, PEERS, SCHEMES
from accuracy.errors import Reference, Row, front, of_panel
from granular.plot import Picture

TITLES = {
    "incline": "incline, one column: v(y)",
    "incline_2d": "incline, 8 columns, jittered: v(y)",
    "collapse": "column collapse: profile of the heap",
    "runout": "column collapse: run-out",
    "silo": "silo: rate of discharge",
}
BASES = {"linear": "o", "ugimp": "^", "quadratic": "s"}
TRANSFERS = {"flip": "tab:orange", "xpic": "tab:green", "apic": "tab:purple", "tpic": "tab:cyan"}
OWN = {
    "default": {"marker": "D", "color": "tab:blue"},
    "cell_averaged": {"marker": "h", "color": "gold"},
    "published": {"marker": "*", "color": "tab:red"},
    HYDRODYNAMICS: {"marker": "v", "color": "black"},
    "taichi": {"marker": "P", "color": "tab:brown"},
    "newton": {"marker": "X", "color": "tab:pink"},
}
SHADES = {
    "incline": "tab:blue",
    "incline_2d": "tab:green",
    "collapse": "tab:orange",
    "silo": "tab:red",
}
LINES = {
    "default": {"linestyle": "-", "marker": "D"},
    "linear flip": {"linestyle": "--", "marker": "o"},
    "cell_averaged": {"linestyle": ":", "marker": "h"},
}
SCALES = {"cell": 1e3, "points": 1}
"""Factor for cells, which are drawn in millimetres."""
WIDE, HIGH = 0.5, 0.12
"""Least distance between two labels [decades]."""
CEILING = 3.0
"""Larger errors are drawn at this value, as the results are useless anyway."""


def style(scheme: str) -> dict[str, Any]:
    """Marker by basis and colour by transfer; some schemes have their own."""
    if scheme in OWN:
        return OWN[scheme]
    basis, transfer = scheme.split()
    return {"marker": BASES[basis], "color": TRANSFERS[transfer]}


def label(row: Row) -> str:
    """Label of a point on the front: modulus, cell, points per cell."""
    modulus = f"{row['E']:.0e}".replace("e+0", "e")
    return f"{modulus}, {row['cell'] * 1e3:.3g} mm, {row['points']}"


def _moduli(ax: Axes, points: Sequence[tuple[Row, float]]) -> None:
    """Draw lines through runs that differ in E only."""
    series: dict[tuple[Any, ...], list[tuple[float, float, float]]] = {}
    for row, e in points:
        key = tuple(row[n] for n in ("solver", "scheme", "cell", "points", "seed"))
        series.setdefault(key, []).append((row["E"], row["core_seconds"], e))
    for key, runs in series.items():
        _, cost, e = zip(*sorted(runs), strict=True)
        ax.plot(cost, e, color=style(key[1])["color"], linewidth=0.7, alpha=0.6, zorder=1)


def apart(points: Sequence[tuple[Row, float]]) -> list[tuple[Row, float]]:
    """Points far enough from the previous one to be labelled."""
    kept: list[tuple[Row, float]] = []
    for row, e in points:
        if kept:
            wide = np.log10(row["core_seconds"] / kept[-1][0]["core_seconds"])
            if wide < WIDE and np.log10(kept[-1][1] / e) < HIGH:
                continue
        kept.append((row, e))
    return kept


def panel(ax: Axes, name: str, points: Sequence[tuple[Row, float]], reference: Reference) -> None:
    """Error against core-seconds of one scene, with the front and the reference's uncertainty."""
    points = [(row, min(e, CEILING)) for row, e in points]
    _moduli(ax, points)
    for row, e in points:
        big = row["scheme"] in OWN
        ax.plot(
            row["core_seconds"],
            e,
            linestyle="",
            markersize={"published": 15}.get(row["scheme"], 7.5 if big else 5.5),
            markeredgecolor="black" if big else "white",
            markeredgewidth=0.6,
            zorder=3 if big else 2,
            **style(row["scheme"]),
        )
    best = front(points, reference.uncertainty)
    ax.step(
        [row["core_seconds"] for row, _ in best],
        [e for _, e in best],
        where="post",
        color="black",
        linewidth=1.0,
        zorder=1.5,
    )
    for row, e in apart(best):
        ax.annotate(
            label(row),
            (row["core_seconds"], e),
            textcoords="offset points",
            xytext=(-4, -4),
            ha="right",
            va="top",
            fontsize=6.5,
        )
    if reference.uncertainty > 0:
        ax.axhspan(1e-9, reference.uncertainty, color="0.88", zorder=0)
    low = min(e for _, e in points)
    ax.set(xscale="log", yscale="log", title=TITLES[name], xlabel="core-seconds")
    ax.set_ylim(0.45 * low, 1.4 * max(e for _, e in points))
    seconds = [row["core_seconds"] for row, _ in points]
    ax.set_xlim(min(seconds) / 5, max(seconds) * 1.8)
    ax.grid(True, which="major", linewidth=0.4, color="0.85")
    ax.set_axisbelow(True)


def _legend(fig: Picture, schemes: Sequence[str]) -> None:
    handles = [
        Line2D([], [], linestyle="", markeredgecolor="black", markeredgewidth=0.4, label=s)
        for s in schemes
    ]
    for handle, scheme in zip(handles, schemes, strict=True):
        look = style(scheme)
        handle.set(marker=look["marker"], markerfacecolor=look["color"])
        handle.set_markersize(11 if scheme == "published" else 7)
    handles.append(
        Line2D([], [], color="black", linewidth=1.0, label="front: E [Pa], cell, per cell")
    )
    handles.append(Line2D([], [], color="0.85", linewidth=8, label="reference is no surer"))
    fig.legend(handles=handles, loc="outside lower center", ncols=5, fontsize=8, frameon=False)


def chart(
    rows: Sequence[Row], references: Mapping[str, Reference | None], panels: Sequence[str]
) -> Picture | None:
    """Panels of error against core-seconds, side by side; None where nothing was run."""
    shown = []
    for name in panels:
        reference = references[name]
        points = of_panel(rows, name, reference) if reference else []
        if points:
            shown.append((name, points, reference))
    if not shown:
        return None
    fig = Picture(figsize=(5.6 * len(shown), 5.4), layout="constrained")
    axes = np.atleast_1d(fig.subplots(1, len(shown)))
    for ax, (name, points, reference) in zip(axes, shown, strict=True):
        panel(ax, name, points, reference)
    axes[0].set_ylabel("relative error")
    present = {row["scheme"] for _, points, _ in shown for row, _ in points}
    _legend(fig, [s for s in (*SCHEMES, HYDRODYNAMICS, *PEERS) if s in present])
    return fig


def _trend(ax: Axes, entry: Mapping[str, Any]) -> None:
    """One series of the table of slopes."""
    found, soft = entry["measured"], entry["parameter"] == "E"
    steep = entry["angle_deg"] not in (None, 25.0)
    ax.plot(
        [
            m["p_over_K"] if soft else SCALES[entry["parameter"]] * m[entry["parameter"]]
            for m in found
        ],
        [abs(m["step" if soft else "error"]) for m in found],
        **LINES[entry["scheme"]],
        color=SHADES[entry["scene"]],
        linewidth=0.7 if steep else 1.5,
        markersize=3 if steep else 5,
    )


def trends(slopes: Sequence[Mapping[str, Any]]) -> Picture | None:
    """Change due to a softer material against p/K, and error against cell size and points."""
    entries = [entry for entry in slopes if entry["scheme"] in LINES]
    if not entries:
        return None
    fig = Picture(figsize=(13.0, 5.0), layout="constrained")
    axes = dict(zip(("E", "cell", "points"), fig.subplots(1, 3), strict=True))
    for entry in entries:
        _trend(axes[entry["parameter"]], entry)
    for ax in axes.values():
        ax.set(xscale="log", yscale="log", ylabel="relative error")
        ax.grid(True, which="major", linewidth=0.4, color="0.85")
    axes["E"].set(xlabel="p/K at the deepest point", ylabel="change by a ten times stiffer E")
    for name, ticks in (("cell", (5, 10, 20, 40)), ("points", (4, 9, 16))):
        axes[name].set_xticks(ticks, labels=[str(t) for t in ticks])
        axes[name].tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
        axes[name].set_xlabel({"cell": "cell [mm]", "points": "points per cell"}[name])
    handles = [Line2D([], [], color=c, linewidth=3, label=TITLES[s]) for s, c in SHADES.items()]
    handles += [Line2D([], [], color="0.3", label=s, **look) for s, look in LINES.items()]
    handles.append(Line2D([], [], color="0.3", linewidth=0.7, label="incline of 23, 28, 31 deg"))
    fig.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return fig
