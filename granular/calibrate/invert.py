"""The number of a material with which simulations give a measured result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from granular.measure.result import Result
from granular.tools.arrays import Array
from granular.tools.checks import array, finite, in_range, integer, non_negative


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibrated(Result):
    """A number that gives a measured result, with its confidence interval.

    Attributes
    ----------
    value : float
        The number.
    interval : (float, float)
        Its confidence interval, from the scatter of the runs about the fit and from the error of
        the measured result.
    slope : float
        Change of the result with the number, at `value`.
    scatter : float
        Standard deviation of the results about the fit.
    coefficients : ndarray, shape (degree + 1,)
        Polynomial that was fitted to the results, highest power first.
    """

    value: float
    interval: tuple[float, float]
    slope: float
    scatter: float
    coefficients: Array

    def __call__(self, numbers: ArrayLike) -> Array:
        """Result of the fit at some numbers."""
        return np.polyval(self.coefficients, np.asarray(numbers, dtype=float))


def invert(
    numbers: ArrayLike,
    results: ArrayLike,
    target: float,
    *,
    error: float = 0.0,
    degree: int = 2,
    confidence: float = 0.95,
) -> Calibrated:
    """Find the number with which simulations give a measured result.

    A polynomial is fitted to the results of some runs, several seeds of each number among them, and
    solved for the target. The interval follows by propagation of errors: the variance of the number
    is the sum of the variance of the fit there and of that of the target, over the square of the
    slope.

    Parameters
    ----------
    numbers, results : array_like, shape (k,)
        Number and result of each run, such as the friction coefficients and the angles of repose of
        a sweep; k > degree + 1.
    target : float
        Measured result.
    error : float
        Standard error of the measurement, >= 0.
    degree : int
        Degree of the polynomial, 1 to 3.
    confidence : float
        Of the interval, in (0, 1).

    Returns
    -------
    Calibrated

    Raises
    ------
    TypeError, ValueError
        If an argument is out of range, or the results do not pass the target exactly once within
        the range of the numbers.

    Examples
    --------
    >>> known = gr.calibrate.invert([0.3, 0.3, 0.4, 0.4, 0.5], [17.0, 17.4, 21.9, 22.1, 26.4], 20.0)
    >>> round(known.value, 2)
    0.36
    """
    x = array("numbers", numbers, (None,))
    y = array("results", results, (len(x),))
    degree = integer("degree", degree, 1, 3)
    target, error = finite("target", target), non_negative("error", error)
    confidence = in_range("confidence", confidence, 0.0, 1.0, open_low=True, open_high=True)
    free = len(x) - degree - 1
    if free < 1 or len(np.unique(x)) <= degree:
        raise ValueError(
            f"numbers = {x} must be more than {degree + 1}, and more than {degree} different ones, "
            f"for degree = {degree}"
        )
    powers = np.vander(x, degree + 1)
    coefficients, *_ = np.linalg.lstsq(powers, y, rcond=None)
    variance = float(np.sum((y - powers @ coefficients) ** 2) / free)
    value = _crossing(coefficients, x, target)
    slope = float(np.polyval(np.polyder(coefficients), value))
    at = np.vander([value], degree + 1)[0]
    of_fit = variance * float(at @ np.linalg.solve(powers.T @ powers, at))
    whole = of_fit + error**2
    # The degrees of freedom of a sum of two variances, one of them known (Welch & Satterthwaite).
    freedom = free * (whole / of_fit) ** 2 if of_fit > 0 else np.inf
    half = float(stdtrit(freedom, 0.5 + 0.5 * confidence)) * np.sqrt(whole) / abs(slope)
    return Calibrated(
        value=value,
        interval=(value - half, value + half),
        slope=slope,
        scatter=float(np.sqrt(variance)),
        coefficients=coefficients,
    )


def _crossing(coefficients: Array, x: Array, target: float) -> float:
    """Where a polynomial has a value within the range of x; refuse none or several."""
    shifted = coefficients.copy()
    shifted[-1] -= target
    roots = np.roots(shifted)
    real = roots.real[np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots.real))]
    inside = real[(real >= x.min()) & (real <= x.max())]
    if len(inside) != 1:
        ends = np.polyval(coefficients, [x.min(), x.max()])
        raise ValueError(
            f"target = {target:g} must be passed once by the results, which go from {ends[0]:.4g} "
            f"to {ends[1]:.4g} between {x.min():g} and {x.max():g}: they pass it "
            f"{len(inside)} times"
        )
    return float(inside[0])
