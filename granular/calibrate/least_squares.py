"""Least squares with confidence intervals of the constants."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import OptimizeWarning, curve_fit
from scipy.special import stdtrit

from granular.tools.arrays import Array
from granular.tools.checks import in_range

Interval = tuple[float, float]


def points_of(x: ArrayLike, y: ArrayLike, least: int, name: str) -> tuple[Array, Array]:
    """Check inertial numbers and values: positive, and at least so many different ones."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if x.ndim != 1 or x.shape != y.shape:
        raise ValueError(
            f"inertial_number has shape {x.shape}, {name} {y.shape}: "
            "both must be one-dimensional and of equal length"
        )
    for label, array in (("inertial_number", x), (name, y)):
        if not np.all((array > 0) & np.isfinite(array)):
            raise ValueError(f"{label} = {array} must all be finite and > 0")
    if len(np.unique(x)) < least:
        raise ValueError(f"inertial_number = {x}: at least {least} different ones are needed")
    return x, y


def least_squares(
    model: Callable[..., Array],
    x: Array,
    y: Array,
    guess: Mapping[str, float],
    confidence: float,
    *,
    logarithmic: str = "",
    error: ArrayLike | None = None,
    combined: Array | None = None,
) -> dict[str, Any]:
    """Constants of a fit by name, and their confidence intervals.

    The constant named `logarithmic` is fitted by its logarithm. `combined` is the matrix from the
    parameters of the model to the constants.
    """
    confidence = in_range("confidence", confidence, 0.0, 1.0, open_low=True, open_high=True)
    factor = float(stdtrit(max(len(x) - len(guess), 1), 0.5 + 0.5 * confidence))
    start = list(guess.values())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", OptimizeWarning)
            warnings.simplefilter("ignore", RuntimeWarning)  # raised by steps that are rejected
            values, covariance = curve_fit(model, x, y, start, sigma=error, maxfev=20000)
        if not np.isfinite(covariance).all():
            raise RuntimeError("the covariance is not finite")
    except (RuntimeError, OptimizeWarning) as problem:
        raise ValueError(
            f"inertial_number = {x}: these points do not determine the constants of the fit"
        ) from problem
    if combined is not None:
        values, covariance = combined @ values, combined @ covariance @ combined.T
    half = factor * np.sqrt(np.diag(covariance))
    fitted = {name: (v, v - h, v + h) for name, v, h in zip(guess, values, half, strict=True)}
    if logarithmic:
        with np.errstate(over="ignore"):  # an interval without an upper end
            fitted[logarithmic] = tuple(np.exp(fitted[logarithmic]))
    constants = {name: float(value) for name, (value, _, _) in fitted.items()}
    intervals = {name: (float(low), float(high)) for name, (_, low, high) in fitted.items()}
    return constants | {"intervals": intervals}
