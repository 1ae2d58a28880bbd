"""Measures of the figures of chapter 5: run-outs, slopes, shear rates, profiles, fits.

The benchmark `sph_examples` measures the same in other cases.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import curve_fit

from granular import measure
from granular.model.state import State
from granular.sph import Scene
from granular.tools.arrays import Array

QUANTILE = 0.99
JITTER = 0.2
"""Amplitude of the random displacement of particles at the start, in spacings."""
BETAS = {"no dilation": 0.0, "dilation": 0.5}
"""Largest rates of dilation, by the words that numbers are named with."""


def packed(scene: Scene, seed: int) -> Scene:
    """The scene with particles displaced at random, so that they settle to another packing."""
    fills = tuple(fill.replace(jitter=JITTER) for fill in scene.fills)
    return scene.replace(fills=fills, seed=seed)


# ---- run-outs and profiles ----


def far(state: State) -> dict[str, float]:
    """Farthest and highest particle, and the distance within which 99 % of the mass lies [m]."""
    order = np.argsort(state.x[:, 0])
    mass = np.cumsum(state.mass[order])
    quantile = state.x[order[np.searchsorted(mass, QUANTILE * mass[-1])], 0]
    return {
        "L": float(state.x[:, 0].max()),
        "L99": float(quantile),
        "H": float(state.x[:, -1].max()),
    }


def highest(state: State) -> tuple[Array, Array]:
    """Middles of the columns of particles [m], and the height of the highest in each [m]."""
    cell = state.scene.grid.cell
    column = np.floor(state.x[:, 0] / cell).astype(int)
    columns = np.unique(column)
    tops = np.array([state.x[column == k, -1].max() for k in columns])
    return cell * (columns + 0.5), tops


def power_laws(
    aspects: ArrayLike, length: float, rows: Sequence[dict[str, float]]
) -> dict[str, float]:
    """Fits H0/H = l1 a^a1 and (L - L0)/L0 = l2 a^a2, of L and of L99 (eq. 5.32).

    Parameters
    ----------
    aspects : array_like, shape (k,)
        Ratios a of the initial height to the initial length.
    length : float
        Initial length [m].
    rows : sequence of dict
        Results of `far` at rest.
    """
    a = np.asarray(aspects, dtype=float)
    series = {"1": a * length / [row["H"] for row in rows]}
    for name in ("L", "L99"):
        series[name] = np.array([row[name] for row in rows]) / length - 1
    fits: dict[str, float] = {}
    for name, values in series.items():
        power, log = np.polyfit(np.log(a), np.log(values), 1)
        fits |= {f"alpha_{name}": float(power), f"lambda_{name}": float(np.exp(log))}
    return fits


# ---- slopes ----


def surface_line(state: State) -> tuple[float, float]:
    """Slope and intercept [m] of the line through the surface over the middle 75 % of the floor."""
    parameters = state.scene.parameters
    floor = float(parameters["length"]) - float(parameters["orifice"])
    top = measure.surface(state, above=0.0, along="x")
    inside = (top.x > floor / 8) & (top.x < 7 * floor / 8) & np.isfinite(top.top)
    slope, intercept = np.polyfit(top.x[inside], top.top[inside], 1)
    return float(slope), float(intercept)


def slope_deg(state: State) -> float:
    """Angle of this line [deg], positive if the surface falls to the right."""
    return -math.degrees(math.atan(surface_line(state)[0]))


# ---- layers on inclines ----


def steady_rate(states: Sequence[State]) -> tuple[float, float, float]:
    """Shear rate at mid-depth [1/s], and the errors of a line and of Bagnold's profile."""
    rates: list[float] = []
    misfits: dict[float, list[float]] = {1.0: [], 1.5: []}
    for state in states:
        y, v = state.x[:, -1], state.v[:, 0]
        height = y.max() + 0.5 * state.scene.grid.cell
        inside = (y > 0.2 * height) & (y < 0.8 * height)
        rates.append(np.polyfit(y[inside], v[inside], 1)[0])
        for power, misfit in misfits.items():
            rest = v - fitted_profile(y, v, height, power)(y)
            misfit.append(rest.std() / v.std())
    line, bagnold = (float(np.mean(misfit)) for misfit in misfits.values())
    return float(np.mean(rates)), line, bagnold


def fitted_profile(y: Array, v: Array, height: float, power: float) -> Any:
    """Least-squares fit A (h^power - (h - y)^power) + slip, as a function of y.

    The power 3/2 is that of Bagnold's profile (eq. 5.30), 1 that of a line. Eq. 5.30 has no slip.
    """

    def basis(y: Array) -> Array:
        depth = np.maximum(height - y, 0.0)
        return np.stack([height**power - depth**power, np.ones_like(y)], axis=1)

    coefficients = np.linalg.lstsq(basis(y), v, rcond=None)[0]
    return lambda y: basis(y) @ coefficients


def rate_of_the_law(scene: Scene, angle_deg: float) -> float | None:
    """Shear rate of a steady layer without dilation [1/s]; None where there is no steady flow."""
    material, tangent = scene.material, math.tan(math.radians(angle_deg))
    if tangent < material.mu_l:
        return 0.0
    rate = material.D_star * (tangent - material.mu_l) / (material.mu_h - tangent)
    return rate if rate > 0.0 else None


def decaying(t: Array, a: float, b: float, c: float) -> Array:
    """The acceleration of eq. 5.31."""
    return a + (b - a) / (c / t + 1.0)


def fitted_decay(t: Array, acceleration: Array) -> tuple[float, float, float]:
    """a, b and c of eq. 5.31; b is the acceleration that is left in the end [m/s2]."""
    start = (acceleration[0], 0.0, 0.3)
    (a, b, c), _ = curve_fit(decaying, t, acceleration, p0=start, maxfev=20000)
    return float(a), float(b), float(c)
