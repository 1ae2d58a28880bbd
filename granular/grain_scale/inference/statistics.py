"""Statistics of contact forces: macroscopic stress, networks and chains, impulses, decay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from granular.grain_scale.inference.matrices import equilibrium_matrix, rows_of
from granular.grain_scale.inference.packing import Packing
from granular.tools.arrays import Array, BoolArray, IndexArray
from granular.tools.checks import in_range, integer, positive


@dataclass(frozen=True, eq=False)
class ForceStatistics:
    """Distribution of forces.

    Attributes
    ----------
    mean : float
        Mean magnitude over the loaded contacts [N].
    strong : ndarray of bool, shape (c,)
        Contacts that bear more than the mean.
    strong_share : float
        Share of the strong among the loaded contacts (about 40 %; the weak network has 60 %; Radjai
        et al. 1998).
    decay : float
        b of the distribution exp(-b F/mean) above the mean, by maximum likelihood; about 1 in
        dense packings. nan without strong contacts.
    decay_error : float
        Standard error of b: b divided by the root of the number of strong contacts.
    scaled : ndarray, shape (loaded,)
        Magnitudes divided by the mean, ascending.
    """

    mean: float
    strong: BoolArray
    strong_share: float
    decay: float
    decay_error: float
    scaled: Array


def _check_forces(packing: Packing, forces: ArrayLike) -> Array:
    array = np.asarray(forces, dtype=np.float64)
    if array.shape != packing.positions.shape:
        raise ValueError(f"forces has shape {array.shape}, must be {packing.positions.shape}")
    if not np.isfinite(array).all():
        raise ValueError("forces must be finite")
    return array


def macroscopic_stress(
    packing: Packing, forces: ArrayLike, volume: float, *, walls: bool = True
) -> Array:
    """Average stress of an assembly, ``sum sym(f d)/volume`` (eq. 2.1), tension positive.

    Parameters
    ----------
    forces : array_like, shape (c, d)
        Forces on the first bodies [N], in 2D [N/m].
    volume : float
        Volume of the assembly, voids included [m3], in 2D [m2]; > 0.
    walls : bool
        If true, contacts with walls count, with branches from the centroid to the contact. With
        them the sum is exact at rest; the thesis leaves them out.

    Returns
    -------
    ndarray, shape (d, d)
        Stress [Pa].
    {raises}.
    """
    forces = _check_forces(packing, forces)
    positive("volume", volume)
    # The arms of both sides add up to the branch between two centroids.
    total = np.zeros((packing.dim, packing.dim))
    inner = np.all(packing.bodies >= 0, axis=1)
    for contacts, _, sign, arms in packing.sides():
        mask = np.ones(len(contacts), bool) if walls else inner[contacts]
        total += sign * np.einsum("ka,kb->ab", forces[contacts[mask]], arms[mask])
    return (total + total.T) / (2 * volume)


def force_statistics(forces: ArrayLike, *, loaded: float = 1e-3) -> ForceStatistics:
    """Distribution of magnitudes, and the strong and the weak network.

    Parameters
    ----------
    forces : array_like, shape (c, d)
        Forces [N].
    loaded : float
        Contacts count if they bear more than this share of the largest force, 0 <= loaded < 1.

    Raises
    ------
    TypeError, ValueError
        For a wrong shape, or forces that all vanish.
    """
    in_range("loaded", loaded, 0.0, 1.0, open_high=True)
    vectors = np.asarray(forces, dtype=np.float64)
    if vectors.ndim != 2 or not np.isfinite(vectors).all() or not vectors.any():
        raise ValueError(f"forces of shape {vectors.shape} must be finite, (any, d), not all zero")
    size = np.linalg.norm(vectors, axis=1)
    bearing = size[size > loaded * size.max()]
    mean = float(bearing.mean())
    strong = size > mean
    count = int(np.count_nonzero(strong))
    decay = mean / float((size[strong] - mean).mean()) if count else np.nan
    return ForceStatistics(
        mean=mean,
        strong=strong,
        strong_share=count / len(bearing),
        decay=decay,
        decay_error=decay / np.sqrt(count) if count else np.nan,
        scaled=np.sort(bearing / mean),
    )


def force_chains(
    packing: Packing, stresses: ArrayLike | None = None, *, angle_deg: float = 45.0, least: int = 3
) -> list[IndexArray]:
    """Nearly straight chains of grains that transmit large compression (Peters et al. 2005).

    Two touching grains are linked if both have a largest compression above the mean of the grains
    with contacts, and if the branch between them lies within an angle of both directions of largest
    compression. A chain is a connected set of links, branches included.

    Parameters
    ----------
    stresses : array_like, shape (n, d, d), optional
        Average stresses of the grains [Pa]; those of the packing by default.
    angle_deg : float
        Largest angle [deg], 0 < angle_deg <= 90.
    least : int
        Number of grains of the shortest chain, >= 2.

    Returns
    -------
    list of ndarray of int
        Grains of each chain, the longest first.
    {raises}.
    """
    in_range("angle_deg", angle_deg, 0.0, 90.0, open_low=True)
    integer("least", least, 2)
    stresses = packing.stresses if stresses is None else np.asarray(stresses, dtype=np.float64)
    if stresses.shape != packing.stresses.shape:
        raise ValueError(f"stresses has shape {stresses.shape}, must be {packing.stresses.shape}")
    values, vectors = np.linalg.eigh(stresses)
    size, along = -values[:, 0], vectors[:, :, 0]
    touching = np.setdiff1d(np.arange(packing.n), packing.rattlers())
    bears = size > max(size[touching].mean(), 0.0)
    inner = np.flatnonzero((packing.bodies >= 0).all(axis=1))
    pairs = packing.bodies[inner]
    ends = [packing.centroids[pairs[:, side]] - packing.seen_from(side)[inner] for side in (0, 1)]
    branch = ends[1] - ends[0]
    branch = branch / np.linalg.norm(branch, axis=1)[:, None]
    near = np.cos(np.radians(angle_deg)) - 1e-12
    linked = np.ones(len(pairs), bool)
    for grains in pairs.T:
        linked &= bears[grains] & (abs(np.einsum("ka,ka->k", along[grains], branch)) >= near)
    pairs = pairs[linked]
    graph = coo_array((np.ones(len(pairs)), pairs.T), (packing.n, packing.n))
    label = connected_components(graph, directed=False)[1]
    sizes = np.bincount(label)
    order = np.argsort(-sizes, kind="stable")
    return [np.flatnonzero(label == k) for k in order if sizes[k] >= least]


def net_forces(packing: Packing, forces: ArrayLike) -> Array:
    """Sum of the contact forces on each grain [N], shape (n, d)."""
    d = packing.dim
    rows = equilibrium_matrix(packing) @ _check_forces(packing, forces).ravel()
    return rows.reshape(packing.n, rows_of(d))[:, :d]


def impulses(net: ArrayLike, times: ArrayLike) -> Array:
    """Impulses of the contact forces by the trapezoidal rule.

    Divided by the masses, they are the changes of velocity due to contacts.

    Parameters
    ----------
    net : array_like, shape (t, n, d)
        Net force on each grain in each frame [N] (`net_forces`; zero without contacts), without
        gravity.
    times : array_like, shape (t,)
        Times [s], ascending.

    Returns
    -------
    ndarray, shape (n, d)
        Impulses [N s].

    Raises
    ------
    ValueError
        For wrong shapes, or times that do not ascend.
    """
    net, times = np.asarray(net, dtype=np.float64), np.asarray(times, dtype=np.float64)
    if net.ndim != 3 or times.shape != net.shape[:1]:
        raise ValueError(f"net has shape {net.shape} and times {times.shape}: need (t, n, d), (t,)")
    if not (np.diff(times) > 0).all():
        raise ValueError("times must ascend")
    return np.trapezoid(net, times, axis=0)


def largest_by_distance(
    forces: Sequence[ArrayLike], distances: Sequence[ArrayLike], *, bin_width: float, bins: int
) -> Array:
    """Largest force over all frames in bins of distance (figure 3.10).

    Parameters
    ----------
    forces : sequence of array_like, shapes (c, d)
        Forces frame by frame [N].
    distances : sequence of array_like, shapes (c,)
        Distances of the contacts from the surface of the intruder [m]; contacts with negative ones
        are left out.
    bin_width : float
        Width of a bin [m], the smallest diameter in the bed; > 0.
    bins : int
        Number of bins, >= 1.

    Returns
    -------
    ndarray, shape (bins,)
        Largest force of the contacts from k to k + 1 widths away [N]; nan where there are none.
    {raises}; for different numbers of frames or contacts.
    """
    positive("bin_width", bin_width)
    integer("bins", bins, 1)
    if len(forces) != len(distances):
        raise ValueError(f"forces has {len(forces)} frames, distances {len(distances)}")
    largest = np.full(bins, -np.inf)
    for k, (frame, away) in enumerate(zip(forces, distances, strict=True)):
        size, away = np.linalg.norm(np.atleast_2d(frame), axis=-1), np.asarray(away, dtype=float)
        if size.shape != away.shape:
            raise ValueError(f"forces[{k}] has {len(size)} contacts, distances[{k}] {len(away)}")
        place = np.floor(away / bin_width).astype(int)
        inside = (place >= 0) & (place < bins)
        np.maximum.at(largest, place[inside], size[inside])
    return np.where(np.isfinite(largest), largest, np.nan)
