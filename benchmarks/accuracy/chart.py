"""Pictures of the error against core-seconds, and of the dependence of the error on settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

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
SCENES = {
    "incline": "incline, one column",
    "incline_2d": "incline, 8 columns",
    "collapse": "collapse (top: run-out, else profile)",
    "silo": "silo",
}
LOST = {("incline_2d", "linear flip")}
"""Scenes and schemes of which nothing can be said, as the flow is lost at every setting."""
COARSE = {"collapse": 0.025, "silo": 0.02}
"""Coarser one of the cells with which E was varied [m]."""
INCLINES, OTHER_SCENES = ("incline", "incline_2d"), ("collapse", "silo")
TREND_PANELS = (
    ("E", INCLINES),
    ("E", ("collapse",)),
    ("E", ("silo",)),
    ("cell", INCLINES),
    ("cell", OTHER_SCENES),
    ("points", (*INCLINES, *OTHER_SCENES)),
)
"""Varied parameter and scenes of each panel of the trends."""
SCALES = {"cell": 1e3, "points": 1}
"""Factor for cells, which are drawn in millimetres."""
CEILING = 3.0
"""Larger errors are drawn at this value, as the results are useless anyway."""


def style(scheme: str) -> dict[str, Any]:
    """Marker by basis and colour by transfer; some schemes have special ones."""
    if scheme in OWN:
        return OWN[scheme]
    basis, transfer = scheme.split()
    return {"marker": BASES[basis], "color": TRANSFERS[transfer]}


def _moduli(ax: Axes, points: Sequence[tuple[Row, float]]) -> None:
    """Draw lines through runs that differ in E only."""
    series: dict[tuple[Any, ...], list[tuple[float, float, float]]] = {}
    for row, e in points:
        key = tuple(row[n] for n in ("solver", "scheme", "cell", "points", "seed"))
        series.setdefault(key, []).append((row["E"], row["core_seconds"], e))
    for key, runs in series.items():
        _, cost, e = zip(*sorted(runs), strict=True)
        ax.plot(cost, e, color=style(key[1])["color"], linewidth=0.7, alpha=0.6, zorder=1)


def _numbers(ax: Axes, best: Sequence[tuple[Row, float]]) -> None:
    """Number the points of the front, next to the corner of its steps where there is space."""
    for i, (row, e) in enumerate(best, 1):
        ax.annotate(
            str(i),
            (row["core_seconds"], e),
            textcoords="offset points",
            xytext=(-5, -5),
            ha="right",
            va="top",
            fontweight="bold",
            zorder=4,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        )


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
            markersize={"published": 10}.get(row["scheme"], 5 if big else 3.7),
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
    _numbers(ax, best)
    if reference.uncertainty > 0:
        ax.axhspan(1e-9, reference.uncertainty, color="0.88", zorder=0)
    low = min(e for _, e in points)
    ax.set(xscale="log", yscale="log", title=TITLES[name], xlabel="core-seconds")
    ax.set_ylim(0.45 * low, 1.4 * max(e for _, e in points))
    seconds = [row["core_seconds"] for row, _ in points]
    ax.set_xlim(min(seconds) / 5, max(seconds) * 1.8)
    ax.grid(True, which="major", linewidth=0.4, color="0.85")
    ax.set_axisbelow(True)


def _handles(schemes: Sequence[str]) -> list[Line2D]:
    """Entries of the legend."""
    handles = [
        Line2D([], [], linestyle="", markeredgecolor="black", markeredgewidth=0.4, label=s)
        for s in schemes
    ]
    for handle, scheme in zip(handles, schemes, strict=True):
        look = style(scheme)
        handle.set(marker=look["marker"], markerfacecolor=look["color"])
        handle.set_markersize(8 if scheme == "published" else 5)
    handles.append(
        Line2D([], [], color="black", linewidth=1.0, label="front, numbers of the table")
    )
    handles.append(Line2D([], [], color="0.85", linewidth=8, label="uncertainty of the reference"))
    return handles


def chart(
    rows: Sequence[Row], references: Mapping[str, Reference | None], panels: Sequence[str]
) -> Picture | None:
    """Panels of error against core-seconds, two in a row; None where nothing was run."""
    drawn = []
    for name in panels:
        reference = references[name]
        points = of_panel(rows, name, reference) if reference else []
        if points:
            drawn.append((name, points, reference))
    if not drawn:
        return None
    down, across = -(-len(drawn) // 2), min(len(drawn), 2)
    fig = Picture(figsize=(3.5 * across, 2.7 * down), layout="constrained")
    axes = fig.subplots(down, across, squeeze=False)
    for ax, (name, points, reference) in zip(axes.ravel(), drawn, strict=False):
        panel(ax, name, points, reference)
    for ax in axes.ravel()[len(drawn) :]:
        ax.set_axis_off()
    for ax in axes[:, 0]:
        ax.set_ylabel("relative error")
    present = {row["scheme"] for _, points, _ in drawn for row, _ in points}
    handles = _handles([s for s in (*SCHEMES, HYDRODYNAMICS, *PEERS) if s in present])
    if len(drawn) < axes.size:  # an empty panel has place for it
        axes[-1, -1].legend(handles=handles, loc="center", ncols=2, frameon=False)
    else:
        fig.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return fig


def _trend(ax: Axes, entry: Mapping[str, Any]) -> None:
    """One series of the table of slopes."""
    measured, soft = entry["measured"], entry["parameter"] == "E"
    other = entry["angle_deg"] not in (None, 25.0)
    coarse = soft and entry["cell"] == COARSE.get(entry["scene"])
    look = LINES[entry["scheme"]] | ({"markerfacecolor": "white"} if coarse else {})
    ax.plot(
        [
            m["p_over_K"] if soft else SCALES[entry["parameter"]] * m[entry["parameter"]]
            for m in measured
        ],
        [abs(m["step" if soft else "error"]) for m in measured],
        **look,
        color=SHADES[entry["scene"]],
        linewidth=0.7 if other else 1.5,
        markersize=3 if other else 5,
    )


def _theory(ax: Axes, entries: Sequence[Mapping[str, Any]]) -> None:
    """Bias of the depth average of a steady flow at 25 degrees, which is linear in p/K."""
    series = [e for e in entries if e["scene"] == "incline" and e["angle_deg"] == 25.0]
    if series:
        longest = max((e["measured"] for e in series), key=len)
        values = [m["predicted_step"] for m in longest]
        ax.plot([m["p_over_K"] for m in longest], values, color="black", linewidth=1.0)


def _draw_trends(axes: Sequence[Axes], entries: Sequence[Mapping[str, Any]]) -> None:
    """Fill the panels: E for three groups of scenes, cells for two, points per cell for all."""
    for ax, (parameter, scenes) in zip(axes, TREND_PANELS, strict=True):
        chosen = [e for e in entries if e["parameter"] == parameter and e["scene"] in scenes]
        for entry in chosen:
            _trend(ax, entry)
        if parameter == "E":
            _theory(ax, chosen)
            ax.set(xscale="log", xlabel="p/K at the deepest point")
            ax.set_ylabel("change by a ten times stiffer E")
        else:
            ticks = {"cell": (5, 10, 20, 40), "points": (4, 9, 16)}[parameter]
            ax.set(xscale="log", ylabel="relative error")
            ax.set_xticks(ticks, labels=[str(t) for t in ticks])
            ax.tick_params(axis="x", which="minor", bottom=False, labelbottom=False)
            ax.set_xlabel({"cell": "cell [mm]", "points": "points per cell"}[parameter])
        names = {"incline": "inclines", "collapse": "collapse", "silo": "silo"}
        title = ", ".join(names[s] for s in scenes if s in names)
        ax.set(yscale="log", title=title)
        ax.grid(True, which="major", linewidth=0.4, color="0.85")


def trends(slopes: Sequence[Mapping[str, Any]]) -> Picture | None:
    """Change due to a softer material against p/K, and error against cell size and points.

    Schemes that lose the flow of the layer of eight columns are left out of that scene.
    """
    entries = [
        entry
        for entry in slopes
        if entry["scheme"] in LINES and (entry["scene"], entry["scheme"]) not in LOST
    ]
    if not entries:
        return None
    fig = Picture(figsize=(7.0, 5.2), layout="constrained")
    _draw_trends(fig.subplots(2, 3).ravel(), entries)
    handles = [Line2D([], [], color=c, linewidth=3, label=SCENES[s]) for s, c in SHADES.items()]
    handles += [Line2D([], [], color="0.3", label=s, **look) for s, look in LINES.items()]
    handles += [
        Line2D([], [], color="0.3", linewidth=0.7, label="inclines of 23, 28, 31 deg"),
        Line2D([], [], color="black", linewidth=1.0, label="theory, 25 deg"),
        Line2D([], [], color="0.3", marker="o", mfc="white", ls="", label="coarser cells, top row"),
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return fig
