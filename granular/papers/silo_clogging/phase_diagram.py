"""Phase diagrams of static and flowing cases."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from granular.papers.silo_clogging.threshold import FlowThreshold, phase_points
from granular.plot.canvas import Picture, figure_of
from granular.tools.arrays import Array

STYLES: dict[str, dict[str, Any]] = {
    "flowing": {"marker": "o", "color": "#2d5d8f"},
    "static": {"marker": "s", "color": "#8a8a8a"},
    "unsure": {"marker": "^", "color": "#e08214"},
}
"""Marker and colour of each verdict on a flow, as keywords of Matplotlib."""


def phase_diagram(
    x: ArrayLike,
    y: ArrayLike,
    verdicts: Sequence[str],
    *,
    labels: tuple[str, str] = ("nonlocal amplitude A", "W/d"),
    threshold: FlowThreshold | None = None,
    boundary: Callable[[Array], ArrayLike] | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Cases in the plane of two numbers: flowing (circles), static (squares), unsure (triangles).

    For silos the numbers are A and W/d (Dunatunga & Kamrin, Modelling silo clogging, figure 4a),
    for layers the angle and H/d (figure 2b).

    Parameters
    ----------
    x, y : array_like, shape (k,)
        The two numbers of each case.
    verdicts : sequence of k str
        "static", "flowing" or "unsure".
    labels : (str, str)
        Labels of the two axes.
    threshold : FlowThreshold, optional
        Draw its lines through the origin: dashed the line below which all cases are static, solid
        the line above which all flow. A slope that is nan gives no line.
    boundary : callable, optional
        A curve y(x) from theory, such as ``theory.stopping_height`` divided by d. It is called with
        an array of x and may return nan or infinity where it has no value.
    ax : Axes, optional
        Axes to draw into; by default the axes of a new figure.

    Raises
    ------
    TypeError, ValueError
        If x, y and verdicts are not of one length of at least one, a number is not finite, a
        verdict is none of the three, or the boundary does not return one number for each x.
    """
    x, y = phase_points(x, y, verdicts, names=("x", "y"))
    ax = Picture(figsize=(5.5, 4.4), layout="tight").add_subplot() if ax is None else ax
    kinds = np.array(verdicts)
    for verdict, style in STYLES.items():
        here = kinds == verdict
        if here.any():
            ax.plot(x[here], y[here], linestyle="", markersize=7, label=verdict, **style)
    low_x, right = _ends(x, origin=threshold is not None)
    low_y, top = _ends(y, origin=threshold is not None)
    along = np.linspace(low_x, right, 400)
    if threshold is not None:
        lines = (
            ("static below", "--", threshold.static_below),
            ("flowing above", "-", threshold.flowing_above),
        )
        for what, dashes, slope in lines:
            if not math.isnan(slope):
                label = f"{what} {slope:.3g}"
                ax.plot((0.0, right), (0.0, slope * right), dashes, color="black", label=label)
    if boundary is not None:
        curve = np.asarray(boundary(along), dtype=float)
        if curve.shape != along.shape:
            raise ValueError(f"boundary gives shape {curve.shape}, must give {along.shape}")
        finite = np.where(np.isfinite(curve), curve, np.nan)
        ax.plot(along, finite, color="black", linewidth=1.2, label="theory")
    ax.set(xlim=(low_x, right), ylim=(low_y, top), xlabel=labels[0], ylabel=labels[1])
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure_of(ax)


def _ends(values: Array, *, origin: bool) -> tuple[float, float]:
    """Ends of an axis with a margin; with `origin` the axis begins at zero."""
    low, high = float(values.min()), float(values.max())
    margin = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    return (min(0.0, low) if origin else low - margin), high + margin
