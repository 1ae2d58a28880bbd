"""Forces at contacts: force networks, Pareto fronts, histories, statistics.

The functions take results and infer nothing; the runs are in `granular.papers.hurley_thesis`.
Numbers of figures are as in chapters 2 and 3 of Hurley's thesis.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from numpy.typing import ArrayLike

from granular.grain_scale.inference import ForceStatistics, Packing, ParetoFront
from granular.plot.canvas import Picture
from granular.tools.arrays import Array
from granular.tools.checks import integer, positive

WIDEST = 7.0
"""Width of the line of the largest force [points, 1/72 inch]."""
SHADES = ("#1b4f8a", "#c8502d", "#3c8d53", "#7a4b94", "#8a6d1b", "#555555")
FACE, EDGE = "#ece7dc", "#a49d8f"


def force_networks(
    panels: Mapping[str, tuple[Packing, ArrayLike]],
    *,
    columns: int = 3,
    axes: tuple[int, int] | None = None,
    largest: float | None = None,
) -> Picture:
    """Packings with a line for each force, its width proportional to the force.

    Figures 2.9 to 2.11, 3.5 and 3.7.

    Parameters
    ----------
    panels : mapping of str to (Packing, array_like of shape (c, d))
        Packing and forces [N] of each panel, by its title. Grains are drawn as discs of the same
        area, or in 3D as spheres of the same volume.
    columns : int
        Number of panels in a row, >= 1.
    axes : (int, int), optional
        Axes to the right and up; by default the first and the last.
    largest : float, optional
        Force with the widest line [N], > 0; by default the largest of all panels, which share the
        scale.

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, there are no panels, or forces have a wrong shape.
    """
    integer("columns", columns, 1)
    if not panels:
        raise ValueError("panels is empty, must hold at least one packing")
    for title, (packing, forces) in panels.items():
        if np.shape(forces) != packing.positions.shape:
            wanted = packing.positions.shape
            raise ValueError(f"panels[{title!r}]: forces {np.shape(forces)} must be {wanted}")
    if largest is None:
        sizes = [np.linalg.norm(forces, axis=1).max() for _, forces in panels.values()]
        largest = float(max(sizes)) or 1.0
    positive("largest", largest)
    rows = -(-len(panels) // columns)
    columns = min(columns, len(panels))
    extents = [_extent(packing, axes) for packing, _ in panels.values()]
    shape = np.median([high - low for low, high in extents], axis=0)
    tall = float(np.clip(2.8 * shape[1] / shape[0] + 0.4, 2.0, 6.0))  # axes are 2.8 inches wide
    fig = Picture(figsize=(3.4 * columns, rows * (tall + 0.35)), layout="tight")
    grid = fig.subplots(rows, columns, squeeze=False).ravel()
    for ax, (title, (packing, forces)) in zip(grid, panels.items(), strict=False):
        _network(ax, packing, np.asarray(forces, dtype=float), largest, axes)
        ax.set_title(title, fontsize="small")
    for ax in grid[len(panels) :]:
        ax.set_axis_off()
    return fig


def _seen(packing: Packing, axes: tuple[int, int] | None) -> list[int]:
    if axes is None:
        return [0, packing.dim - 1]
    for k, axis in enumerate(axes):
        integer(f"axes[{k}]", axis, 0, packing.dim - 1)
    return list(axes)


def _extent(packing: Packing, axes: tuple[int, int] | None) -> tuple[Array, Array]:
    x, R = packing.centroids[:, _seen(packing, axes)], packing.radii[:, None]
    return (x - R).min(axis=0), (x + R).max(axis=0)


def _network(
    ax: Axes, packing: Packing, forces: Array, largest: float, axes: tuple[int, int] | None
) -> None:
    positions, size = _seen(packing, axes), 2 * packing.radii
    x = packing.centroids[:, positions]
    _discs(ax, size, x, facecolors=FACE, edgecolors=EDGE, linewidths=0.6)
    # Lines join centroids; to a wall or a missing grain they end at the contact. Across a periodic
    # boundary a line has a gap, the nan.
    at = [packing.seen_from(side)[:, positions] for side in (0, 1)]
    near = np.linalg.norm(at[1] - at[0], axis=1) < packing.radius
    gap = np.where(near[:, None], at[0], np.nan)
    ends = [
        np.where((b >= 0)[:, None], x[np.maximum(b, 0)], here)
        for b, here in zip(packing.bodies.T, at, strict=True)
    ]
    share = np.linalg.norm(forces, axis=1) / largest
    order = np.argsort(share)
    paths = np.stack([ends[0], at[0], gap, at[1], ends[1]], axis=1)[order]
    lines = LineCollection(
        list(paths), linewidths=WIDEST * share[order], colors=SHADES[0], capstyle="round", zorder=2
    )
    ax.add_collection(lines)
    low, high = _extent(packing, axes)
    margin = 0.03 * (high - low).max()
    ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    ax.set_aspect("equal")
    ax.tick_params(labelsize="x-small")
    ax.spines[:].set_color("0.8")
    names = "xyz"
    ax.set_xlabel(f"{names[positions[0]]} [m]", fontsize="x-small")
    ax.set_ylabel(f"{names[positions[1]]} [m]", fontsize="x-small")


def pareto_front(front: ParetoFront, *, errors: ArrayLike | None = None) -> Picture:
    """Residual of the force balance against that of the stresses, scaled to 0 to 1 (figure 3.2).

    Parameters
    ----------
    errors : array_like, shape (k,), optional
        Error of the forces for each weight, if the true forces are known; drawn against the
        weights.

    Raises
    ------
    ValueError
        If there is not one error for each weight.
    """
    if errors is not None and np.shape(errors) != front.weights.shape:
        raise ValueError(f"errors has shape {np.shape(errors)}, must be {front.weights.shape}")
    fig = Picture(figsize=(9.0 if errors is not None else 4.8, 4.2), layout="tight")
    ax, *others = fig.subplots(1, 1 if errors is None else 2, squeeze=False)[0]
    scaled = []
    for values in (front.stress_residuals, front.balance_residuals):
        span = np.ptp(values)
        scaled.append((values - values.min()) / span if span else 0 * values)
    ax.plot(*scaled, "o-", color=SHADES[0], markersize=4)
    ax.plot(*[[s[0], s[-1]] for s in scaled], ":", color="0.5", label="chord")
    ax.plot(*[[s[front.knee]] for s in scaled], "o", color=SHADES[1], markersize=9, label="knee")
    ax.set(xlabel="stress residual, scaled", ylabel="balance residual, scaled")
    ax.legend(fontsize="small")
    for right in others:
        right.semilogx(front.weights, errors, "o-", color=SHADES[0], markersize=4)
        knee = front.knee
        right.plot(front.weights[knee], np.asarray(errors)[knee], "o", color=SHADES[1], ms=9)
        right.set(xlabel="weight of the balance", ylabel="error of the forces", ylim=(0, None))
    return fig


def force_histories(
    series: Mapping[str, tuple[ArrayLike, Mapping[str, ArrayLike]]],
    *,
    columns: int = 2,
    ylabel: str = "force [N]",
) -> Picture:
    """Forces over time, one panel each, with a line for each method (figures 3.5d and 3.9).

    Parameters
    ----------
    series : mapping of str to (times, mapping of str to forces)
        Times [s] and lines by their names, of each panel by its title.
    columns : int
        Number of panels in a row, >= 1.
    ylabel : str
        Label of the vertical axis of all panels.

    Raises
    ------
    TypeError, ValueError
        If there are no panels, or the number of columns is out of range.
    """
    integer("columns", columns, 1)
    if not series:
        raise ValueError("series is empty, must hold at least one panel")
    columns = min(columns, len(series))
    rows = -(-len(series) // columns)
    fig = Picture(figsize=(4.2 * columns, 2.5 * rows), layout="tight")
    grid = fig.subplots(rows, columns, squeeze=False)
    for ax, (title, (times, lines)) in zip(grid.ravel(), series.items(), strict=False):
        for (name, values), shade in zip(lines.items(), SHADES, strict=False):
            ax.plot(1e3 * np.asarray(times), values, color=shade, linewidth=1.3, label=name)
        ax.set_title(title, fontsize="small")
        ax.tick_params(labelsize="x-small")
        ax.set_xlabel("time [ms]", fontsize="small")
    for ax in grid.ravel()[len(series) :]:
        ax.set_axis_off()
    for ax in grid[:, 0]:
        ax.set_ylabel(ylabel, fontsize="small")
    grid[0, 0].legend(fontsize="x-small")
    return fig


def force_distances(curves: Mapping[str, ArrayLike], bin_width: float) -> Picture:
    """Largest force against distance from an intruder, in bins (figure 3.10).

    Parameters
    ----------
    curves : mapping of str to array_like
        Results of `granular.grain_scale.inference.largest_by_distance`, by the name of the
        experiment.
    bin_width : float
        Width of a bin [m], > 0.
    """
    positive("bin_width", bin_width)
    fig = Picture(figsize=(5.2, 3.8), layout="tight")
    ax = fig.subplots()
    for (name, values), shade in zip(curves.items(), SHADES, strict=False):
        middle = bin_width * (np.arange(len(np.asarray(values))) + 0.5)
        ax.plot(middle, values, "o-", color=shade, markersize=4, label=name)
    ax.set(xlabel="distance from the intruder [m]", ylabel="largest force [N]", ylim=(0, None))
    ax.legend(fontsize="small")
    return fig


def force_distribution(statistics: Mapping[str, ForceStatistics]) -> Picture:
    """Share of contacts whose force exceeds a multiple of the mean, and an exponential decay.

    Parameters
    ----------
    statistics : mapping of str to ForceStatistics
        Results of `granular.grain_scale.inference.force_statistics` by name.
    """
    fig = Picture(figsize=(5.2, 3.8), layout="tight")
    ax = fig.subplots()
    end = 1.0
    for (name, distribution), shade in zip(statistics.items(), SHADES, strict=False):
        count = len(distribution.scaled)
        ax.semilogy(
            distribution.scaled,
            1 - np.arange(count) / count,
            drawstyle="steps-pre",
            color=shade,
            label=f"{name}: b = {distribution.decay:.2f} ± {distribution.decay_error:.2f}",
        )
        end = max(end, distribution.scaled[-1])
    along = np.array([1.0, end])
    ax.semilogy(along, 0.4 * np.exp(1 - along), "--", color="0.5", label="0.4 exp(1 - F/mean)")
    ax.set(xlabel="force / mean", ylabel="share of contacts beyond")
    ax.legend(fontsize="small")
    return fig


def _discs(ax: Axes, diameters: ArrayLike, places: ArrayLike, **style: Any) -> None:
    """Draw discs of true size: diameters [m], positions of the middles [m], shape (n, 2)."""
    artist = EllipseCollection(
        diameters,
        diameters,
        np.zeros_like(diameters),
        units="x",
        offsets=places,
        offset_transform=ax.transData,
        **style,
    )
    ax.add_collection(artist, autolim=False)
