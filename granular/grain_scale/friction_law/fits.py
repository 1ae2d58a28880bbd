"""Fits to shear data: coordination, packing fraction, power laws, and the mu(I) rheology."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from granular.calibrate.least_squares import Interval, least_squares, points_of
from granular.calibrate.mu_I import MuIFit, fit_mu_I, fit_packing
from granular.grain_scale.friction_law.steady import SteadyShear
from granular.tools.arrays import Array
from granular.tools.checks import non_negative, one_of


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


def fit_coordination(
    inertial_number: ArrayLike, coordination: ArrayLike, *, confidence: float = 0.95
) -> CoordinationFit:
    """Fit eq. 4.10 by least squares.

    Parameters
    ----------
    inertial_number, coordination : array_like, shape (k,)
        At least 4 points, all > 0.

    Raises
    ------
    ValueError
        With too few or bad points, or if they do not determine the constants.
    """
    x, y = points_of(inertial_number, coordination, 4, "coordination")
    guess = {"Z1": y.min(), "Z2": (np.ptp(y) + 1e-3) * 0.1, "b": math.log(0.1)}
    return CoordinationFit(
        **least_squares(
            lambda i, one, two, log_b: one + two / (np.exp(log_b) + i),
            x,
            y,
            guess,
            confidence,
            logarithmic="b",
        )
    )


def fit_power(
    inertial_number: ArrayLike, values: ArrayLike, *, confidence: float = 0.95
) -> PowerFit:
    """Fit a power law by least squares of logarithms.

    Parameters and errors as in `fit_coordination`, with at least 3 points.
    """
    x, y = points_of(inertial_number, values, 3, "values")
    return PowerFit(
        **least_squares(
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


def fit_rheology(points: Sequence[SteadyShear], *, confidence: float = 0.95) -> MuIFit:
    """Fit mu(I) and phi(I) of shear flows, for use in continuum materials.

    Friction and inertial number are those of `SteadyShear.invariants`, as in the continuum laws;
    the packing fraction is a function of the same inertial number.

    Parameters
    ----------
    points : sequence of SteadyShear
        At least 4, of different inertial numbers.

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
