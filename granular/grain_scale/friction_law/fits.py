"""Fits to shear data: coordination, packing fraction, power laws, and the mu(I) rheology."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import OptimizeWarning, curve_fit
from scipy.special import stdtrit

from granular.grain_scale.friction_law.steady import SteadyShear
from granular.materials import MuI
from granular.tools.arrays import Array
from granular.tools.checks import in_range, non_negative, one_of, positive

Interval = tuple[float, float]


@dataclass(frozen=True)
class CoordinationFit:
    """``Z = Z1 + Z2/(b + I)`` (thesis, eq. 4.10).

    Attributes
    ----------
    Z1, Z2, b : float
    intervals : mapping of str to (float, float)
        Confidence interval of each.
    """

    Z1: float
    Z2: float
    b: float
    intervals: Mapping[str, Interval]

    def __call__(self, inertial_number: ArrayLike) -> Array:
        """Z, with the shape of `inertial_number`."""
        return self.Z1 + self.Z2 / (self.b + np.asarray(inertial_number, dtype=float))

    @property
    def quasi_static(self) -> float:
        """Z at I = 0."""
        return self.Z1 + self.Z2 / self.b


@dataclass(frozen=True)
class PackingFit:
    """``phi = phi_max - m I`` (thesis, eq. 4.11).

    Attributes
    ----------
    phi_max, m : float
    intervals : mapping of str to (float, float)
        Confidence interval of each.
    """

    phi_max: float
    m: float
    intervals: Mapping[str, Interval]

    def __call__(self, inertial_number: ArrayLike) -> Array:
        """phi, with the shape of `inertial_number`."""
        return self.phi_max - self.m * np.asarray(inertial_number, dtype=float)


@dataclass(frozen=True)
class PowerFit:
    """``coefficient I^exponent``.

    Attributes
    ----------
    coefficient, exponent : float
    intervals : mapping of str to (float, float)
        Confidence interval of each.
    """

    coefficient: float
    exponent: float
    intervals: Mapping[str, Interval]

    def __call__(self, inertial_number: ArrayLike) -> Array:
        """Value of the law, with the shape of `inertial_number`."""
        return self.coefficient * np.asarray(inertial_number, dtype=float) ** self.exponent


@dataclass(frozen=True)
class MuIFit:
    """``mu = mu_s + (mu_2 - mu_s)/(I0/I + 1)`` fitted to shear data.

    Attributes
    ----------
    mu_s, mu_2, I0 : float
    intervals : mapping of str to (float, float)
        Confidence interval of each; that of I0 is symmetric in its logarithm.
    residuals : ndarray, shape (k,)
        Measured friction minus the fit.
    packing : PackingFit or None
        phi(I) of the same data, if they have it.
    """

    mu_s: float
    mu_2: float
    I0: float
    intervals: Mapping[str, Interval]
    residuals: Array
    packing: PackingFit | None = None

    def __call__(self, inertial_number: ArrayLike) -> Array:
        """Friction, with the shape of `inertial_number`."""
        inertial = np.asarray(inertial_number, dtype=float)
        return self.mu_s + (self.mu_2 - self.mu_s) * inertial / (self.I0 + inertial)

    def material(
        self, *, d: float, rho_s: float, E: float = 1e9, nu: float = 0.3, rho_c: float | None = None
    ) -> MuI:
        """Make the material of a continuum scene with these constants.

        Parameters
        ----------
        d : float
            Diameter of the grains [m]: ``Grains.d_volume`` of the sheared grains.
        rho_s : float
            Density of the grains [kg/m3].
        E, nu : float
            Elasticity of the continuum: see `granular.materials.Material`.
        rho_c : float, optional
            Density of the densest stress-free state [kg/m3]; ``phi_max rho_s`` unless given.

        Raises
        ------
        ValueError
            Without `rho_c`, if the fit has no packing fraction; see also `MuI`.
        """
        if rho_c is None:
            if self.packing is None:
                raise ValueError("rho_c = None: the fit has no packing fractions to take it from")
            rho_c = self.packing.phi_max * positive("rho_s", rho_s)
        return MuI(
            E=E, nu=nu, rho_c=rho_c, rho_s=rho_s, mu_s=self.mu_s, mu_2=self.mu_2, I0=self.I0, d=d
        )


def fit_coordination(
    inertial_number: ArrayLike, coordination: ArrayLike, *, confidence: float = 0.95
) -> CoordinationFit:
    """Fit eq. 4.10 by least squares.

    Parameters
    ----------
    inertial_number, coordination : array_like, shape (k,)
        At least 4 points, all > 0.
    confidence : float
        Of the intervals, in (0, 1).

    Raises
    ------
    ValueError
        With too few or bad points, or if they do not determine the constants.
    """
    x, y = _points(inertial_number, coordination, 4, "coordination")
    guess = {"Z1": y.min(), "Z2": (np.ptp(y) + 1e-3) * 0.1, "b": math.log(0.1)}
    return CoordinationFit(
        **_least_squares(
            lambda i, one, two, log_b: one + two / (np.exp(log_b) + i),
            x,
            y,
            guess,
            confidence,
            logarithmic="b",
        )
    )


def fit_packing(
    inertial_number: ArrayLike, packing_fraction: ArrayLike, *, confidence: float = 0.95
) -> PackingFit:
    """Fit eq. 4.11 by least squares.

    Parameters and errors as in `fit_coordination`, with at least 3 points.
    """
    x, y = _points(inertial_number, packing_fraction, 3, "packing_fraction")
    guess = {"phi_max": y.max(), "m": 0.1}
    return PackingFit(
        **_least_squares(lambda i, top, slope: top - slope * i, x, y, guess, confidence)
    )


def fit_power(
    inertial_number: ArrayLike, values: ArrayLike, *, confidence: float = 0.95
) -> PowerFit:
    """Fit a power law by least squares of logarithms.

    Parameters and errors as in `fit_coordination`, with at least 3 points.
    """
    x, y = _points(inertial_number, values, 3, "values")
    return PowerFit(
        **_least_squares(
            lambda i, level, power: level + power * i,
            np.log(x),
            np.log(y),
            {"coefficient": 0.0, "exponent": 1.0},
            confidence,
            logarithmic="coefficient",
        )
    )


def fit_dissipation(
    points: Sequence[SteadyShear], kind: str, *, slowest: float = 0.05, confidence: float = 0.95
) -> PowerFit:
    """Fit a power of I to the mean dissipation of a contact over its unit Gamma~.

    Parameters
    ----------
    points : sequence of SteadyShear
        At least 3 that count, of different inertial numbers.
    kind : {"viscoelastic", "sliding"}
        Gamma_n or Gamma_s of eq. 4.8.
    slowest : float
        Flows count from this inertial number on, >= 0. Slower ones are left out, because the
        exponents of both kinds decrease to 1 towards rest (figure 4.8 of the thesis).
    confidence : float
        Of the intervals, in (0, 1).

    Raises
    ------
    ValueError
        For another kind, or too few flows.
    """
    kind = one_of("kind", kind, ("viscoelastic", "sliding"))
    slowest = non_negative("slowest", slowest)
    fast = [point for point in points if point.inertial_number >= slowest]
    return fit_power(
        [point.inertial_number for point in fast],
        [getattr(point, kind) / point.dissipation_unit for point in fast],
        confidence=confidence,
    )


def fit_mu_I(
    inertial_number: ArrayLike,
    friction: ArrayLike,
    error: ArrayLike | None = None,
    *,
    confidence: float = 0.95,
) -> MuIFit:
    """Fit mu_s, mu_2 and I0 by least squares.

    Parameters
    ----------
    inertial_number, friction : array_like, shape (k,)
        At least 4 points, all > 0.
    error : array_like, shape (k,), optional
        Standard errors of the friction, used as weights only; the intervals follow from the
        scatter.
    confidence : float
        Of the intervals, in (0, 1).

    Raises
    ------
    ValueError
        With too few or bad points, or if they do not determine the constants, because the friction
        does not grow with I or does not approach a limit in the range of I.
    """
    x, y = _points(inertial_number, friction, 4, "friction")
    if error is not None:
        error = _points(x, error, 4, "error")[1]
    # mu_2 is a sum of two parameters that are correlated.
    constants = _least_squares(
        lambda i, low, rise, log: low + rise / (1.0 + np.exp(log) / i),
        x,
        y,
        {"mu_s": y.min(), "mu_2": np.ptp(y) + 1e-3, "I0": math.log(0.3)},
        confidence,
        logarithmic="I0",
        error=error,
        combined=np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
    )
    fit = MuIFit(**constants, residuals=np.zeros(len(x)))
    if not 0 < fit.mu_s < fit.mu_2:
        raise ValueError(
            f"friction = {y}: the fit has mu_s = {fit.mu_s:.4g} and mu_2 = {fit.mu_2:.4g}, "
            "0 < mu_s < mu_2 is needed"
        )
    return replace(fit, residuals=y - fit(x))


def fit_rheology(points: Sequence[SteadyShear], *, confidence: float = 0.95) -> MuIFit:
    """Fit mu(I) and phi(I) of shear flows, for use in continuum materials.

    Friction and inertial number are those of `SteadyShear.invariants`, as in the continuum laws;
    the packing fraction is a function of the same inertial number.

    Parameters
    ----------
    points : sequence of SteadyShear
        At least 4, of different inertial numbers.
    confidence : float
        Of the intervals, in (0, 1).

    Raises
    ------
    ValueError
        See `fit_mu_I`.
    """
    if len(points) < 4:
        raise ValueError(f"points holds {len(points)} flows, at least 4 are needed")
    friction, inertial = np.array([point.invariants for point in points]).T
    packing = fit_packing(inertial, [p.packing_fraction for p in points], confidence=confidence)
    return replace(fit_mu_I(inertial, friction, confidence=confidence), packing=packing)


def _points(x: ArrayLike, y: ArrayLike, least: int, name: str) -> tuple[Array, Array]:
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


def _least_squares(
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
