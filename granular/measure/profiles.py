"""Profiles over the height, depth averages, and inertial numbers at the points.

Heights are along the last axis, so that a scene with tilted gravity is measured across its layer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from granular.measure.averaging_grid import mean_of, point_weights, require_points, sums_of, values
from granular.measure.result import Result
from granular.measure.stress import friction_of
from granular.model.state import State
from granular.tools.arrays import Array
from granular.tools.checks import integer, positive


@dataclass(frozen=True)
class Profile(Result, y="m", centroid="m"):
    """A quantity as a function of height; nan in rows without points.

    Attributes
    ----------
    y : ndarray, shape (k,)
        Middles of the rows [m].
    value : ndarray, shape (k,) or (k, components)
        Mean of the quantity in each row.
    centroid : ndarray, shape (k,)
        Mean elevation of the points in each row, with the same weights [m].
    weight : ndarray, shape (k,)
        Mass [kg] or volume [m3] in the row.
    """

    y: Array
    value: Array
    centroid: Array
    weight: Array


def profile(
    state: State,
    field: str | ArrayLike,
    *,
    bins: int | ArrayLike | None = None,
    weight: str = "mass",
) -> Profile:
    """Weighted mean of a point field in rows of equal height.

    Parameters
    ----------
    field : str or array_like, shape (n,) or (n, k)
        Name of a field of the state, or one value or row per point.
    bins : int or array_like, optional
        The number of equal rows from the floor of the grid to the highest point, or the edges
        of the rows [m]; by default the rows of grid cells up to the highest point.
    weight : {"mass", "volume"}
        Weight of a point in the mean: its mass, or the scheme's quadrature volume
        (`State.quadrature_volume`), as in `cell_average`.

    Raises
    ------
    ValueError
        If the state is empty, the field does not have one value per point, the edges do not
        increase, or no point lies between them.
    """
    w = point_weights(state, weight)
    field = values(state, field)
    up = np.asarray(state.x, dtype=float)[:, -1]
    edges = _edges(state, up, bins)
    inside = (up >= edges[0]) & (up <= edges[-1])
    if not inside.any():
        raise ValueError(f"bins from {edges[0]} to {edges[-1]} hold no point")
    rows = len(edges) - 1
    row = np.clip(np.searchsorted(edges, up[inside], side="right") - 1, 0, rows - 1)
    w = w[inside]
    total = sums_of(row, w, rows)
    value, centroid = (
        mean_of(sums_of(row, (w * each[inside].T).T, rows), total) for each in (field, up)
    )
    return Profile((edges[:-1] + edges[1:]) / 2, value, centroid, total)


def _edges(state: State, up: Array, bins: int | ArrayLike | None) -> Array:
    grid = state.scene.grid
    floor, highest = float(grid.lower[-1]), float(up.max())
    if bins is None:
        rows = min(int(np.floor((highest - floor) / grid.cell)) + 1, grid.shape[-1])
        return floor + grid.cell * np.arange(rows + 1, dtype=float)
    if np.ndim(bins) == 0:
        return np.linspace(floor, highest, integer("bins", bins, 1) + 1)
    edges = np.asarray(bins, dtype=float)
    if edges.ndim != 1 or len(edges) < 2 or not np.all(np.diff(edges) > 0):
        raise ValueError(f"bins = {bins!r} must be increasing edges, at least 2 of them")
    return edges


def velocity_profile(
    state: State, bins: int | ArrayLike | None = None, *, component: int = 0
) -> Profile:
    """Mass-weighted mean of a velocity component [m/s] in rows of equal height.

    For an incline, ``v_x(y)`` can be compared with `granular.theory.bagnold_profile` at the
    middles of the rows (Dunatunga & Kamrin 2015, eq. 4.6 and figure 10).

    Parameters
    ----------
    bins
        As in `profile`.
    component : int
        Component of the velocity; 0 is x.

    Raises
    ------
    ValueError
        As `profile`; also if the state has no such component.
    """
    velocity = values(state, "v")
    integer("component", component, 0, velocity.shape[1] - 1)
    return profile(state, velocity[:, component], bins=bins)


def friction_profile(state: State, bins: int | ArrayLike | None = None) -> Profile:
    """Friction coefficient ``tau/p`` of the volume-averaged stress in rows of equal height.

    The stress is averaged first, because noise adds to a mean of tau but not to a mean of
    components. In steady flow down an incline the coefficient is the tangent of the slope angle at
    every height (Dunatunga & Kamrin 2015, figure 9).

    Parameters
    ----------
    bins
        As in `profile`.

    Returns
    -------
    Profile
        nan in rows whose mean pressure is not positive.

    Raises
    ------
    ValueError
        As `profile`.
    """
    mean = profile(state, "stress", bins=bins, weight="volume")
    return Profile(mean.y, friction_of(mean.value), mean.centroid, mean.weight)


def depth_average(state: State, field: str | ArrayLike) -> float | Array:
    """Mass-weighted mean of a point field over the whole layer.

    Parameters
    ----------
    field : str or array_like, shape (n,) or (n, k)

    Returns
    -------
    float or ndarray, shape (k,)

    Raises
    ------
    ValueError
        If the state is empty or the field does not have one value per point.
    """
    field = values(state, field)
    mean = np.average(field, axis=0, weights=state.mass)
    return float(mean) if field.ndim == 1 else mean


def grain_diameter(state: State, d: float | None = None) -> float:
    """Return the grain diameter [m]: `d` if given, or else that of the material.

    Raises
    ------
    ValueError
        If neither is known.
    """
    known = {getattr(material, "d", None) for material in state.scene.materials}
    if d is None and len(known) > 1:
        raise ValueError(f"d = None must be given: the materials have the diameters {known} [m]")
    given = next(iter(known)) if d is None else d
    if given is None:
        raise ValueError(
            "d = None: the material has no grain diameter (a MuI that is given by xi alone, or a "
            "user-defined law); give it I0 and d in place of xi, or pass d in metres"
        )
    return positive("d", given)


def inertial_number(state: State, *, d: float | None = None, rho_s: float | None = None) -> Array:
    """Inertial number ``I = shear_rate d sqrt(rho_s/p)`` of every point.

    The shear rate is the equivalent plastic one (Dunatunga & Kamrin 2015, eq. 2.11).

    Parameters
    ----------
    rho_s : float, optional
        Density of the grains [kg/m3]; by default the material's.

    Returns
    -------
    ndarray, shape (n,)
        nan where the point is free of stress.

    Raises
    ------
    ValueError
        If the state is empty, or the grain diameter or the density of the grains is unknown. From
        xi alone only the `scaled_inertial_number` can be computed.
    """
    require_points(state)
    given = state.of_material("rho_s") if rho_s is None else positive("rho_s", rho_s)
    if np.isnan(given).all():
        raise ValueError("rho_s = None: the material has no density of grains; pass rho_s [kg/m3]")
    return grain_diameter(state, d) * np.sqrt(given) * _rate_over_root_pressure(state)


def scaled_inertial_number(state: State) -> Array:
    """Scaled inertial number ``I/I0 = shear_rate/(xi sqrt(p))`` of every point.

    It needs no grain diameter.

    Dunatunga & Kamrin 2015, eqs. 2.11-2.13.

    Returns
    -------
    ndarray, shape (n,)
        nan where the point is free of stress.

    Raises
    ------
    ValueError
        If the state is empty, or the material has no xi because it has no mu(I) law.
    """
    require_points(state)
    xi = state.of_material("xi")
    if not any(getattr(material, "xi", None) for material in state.scene.materials):
        name = type(state.scene.material).__name__
        raise ValueError(f"material {name} has no xi: I/I0 needs a mu(I) law")
    return _rate_over_root_pressure(state) / xi


def _rate_over_root_pressure(state: State) -> Array:
    rate, p = np.asarray(state.shear_rate, dtype=float), np.asarray(state.pressure, dtype=float)
    root = np.sqrt(np.maximum(p, 0.0))
    return np.divide(rate, root, out=np.full_like(p, np.nan), where=root > 0)
