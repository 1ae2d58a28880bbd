"""Extrapolation of a number to infinitely fine cells."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from granular.measure.result import Result
from granular.tools.arrays import Array
from granular.tools.checks import array, in_range

ORDERS = (0.5, 4.0)
"""Orders among which a fit is sought."""

AT_END = 1e-3
"""Distance from the ends of this range within which a search ends there."""


@dataclass(frozen=True)
class Extrapolation(Result):
    """Limit of a number in fine cells, from values in cells of several sizes.

    Attributes
    ----------
    limit : float
        y_0, in the unit of the values.
    uncertainty : float
        Half of the interval in which the limit lies with a probability of 95 %, in this unit.
    order : float
        p, assumed or fitted.
    slope : float
        a of y = y_0 + a dx^p.
    residual : float
        Root mean square of the differences between the values and the fit.
    """

    limit: float
    uncertainty: float
    order: float
    slope: float
    residual: float


def _fit(cells: Array, values: Array, order: float) -> tuple[Array, float]:
    """Limit and slope that fit best at an order, and the sum of the squared differences."""
    terms = np.column_stack([np.ones_like(cells), cells**order])
    parameters = np.asarray(np.linalg.lstsq(terms, values, rcond=None)[0], float)
    return parameters, float(np.sum((terms @ parameters - values) ** 2))


def _best_order(cells: Array, values: Array) -> float:
    """Order at which the fit is best: the squared difference may have several minima."""
    tried = np.linspace(*ORDERS, 36)
    best = int(np.argmin([_fit(cells, values, p)[1] for p in tried]))
    around = (tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)])
    minimum = scipy.optimize.minimize_scalar(
        lambda p: _fit(cells, values, p)[1], bounds=around, method="bounded"
    )
    return float(minimum.x)


def richardson(cells: ArrayLike, values: ArrayLike, *, order: float | None = None) -> Extrapolation:
    """Richardson extrapolation: the limit y_0 of y = y_0 + a dx^p as dx tends to 0.

    All values have the same weight. Where the result of a run scatters, for instance with the
    position of an opening in the grid, give several values for each size of the cells.

    The uncertainty is the standard error of the limit in a least-squares fit, linear about it,
    times the quantile of Student's t for 95 %. With as many values as parameters the scatter is
    unknown; the uncertainty is then the grid convergence index of Roache (1994, J. Fluids Eng. 116,
    405): the distance between limit and finest value, times 1.25 with an order that is fitted and
    times 3 with one that is assumed.

    Parameters
    ----------
    cells : array_like, shape (n,)
        Sizes of the cells dx, > 0, in any unit.
    values : array_like, shape (n,)
        Result in these cells, in any unit.
    order : float, optional
        p, 0.5 to 4; fitted, if it is not given, to at least three sizes.

    Raises
    ------
    ValueError
        If an argument is not a finite number in its range, the shapes differ, or there are fewer
        sizes than parameters.

    Warns
    -----
    UserWarning
        If no order within the range fits best, because the values scatter or the cells are coarse.
    """
    dx = array("cells", cells, (None,))
    y = array("values", values, (len(dx),))
    if not (dx > 0.0).all():
        raise ValueError(f"cells = {dx.min()} must be > 0")
    needed, sizes = (3 if order is None else 2), len(np.unique(dx))
    if sizes < needed:
        raise ValueError(f"cells: {sizes} different sizes must be at least {needed}")
    unit = dx.min()
    scaled = dx / unit
    p = _best_order(scaled, y) if order is None else in_range("order", order, *ORDERS)
    if order is None and min(abs(p - end) for end in ORDERS) < AT_END:
        warnings.warn(
            f"the order that fits best is {p:.3g}, the end of its range from {ORDERS[0]} to "
            f"{ORDERS[1]}: the values do not follow a power of dx, and the limit is not known; "
            "take finer cells, or an order",
            stacklevel=2,
        )
    (limit, slope), square = _fit(scaled, y, p)
    columns = [np.ones_like(scaled), scaled**p]
    if order is None:
        columns.append(slope * scaled**p * np.log(scaled))
    free = len(y) - len(columns)
    if free > 0:
        spread = np.linalg.pinv(np.stack(columns) @ np.stack(columns, axis=1))[0, 0]
        error = float(scipy.stats.t.ppf(0.975, free) * np.sqrt(square / free * spread))
    else:
        finest = float(np.mean(y[dx == unit]))
        error = (1.25 if order is None else 3.0) * abs(finest - limit)
    return Extrapolation(
        limit=float(limit),
        uncertainty=error,
        order=float(p),
        slope=float(slope / unit**p),
        residual=float(np.sqrt(square / len(y))),
    )
