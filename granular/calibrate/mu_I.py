"""Fits of the mu(I) rheology and of the packing fraction to shear data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from granular.calibrate.least_squares import Interval, least_squares, points_of
from granular.materials import MuI
from granular.tools.arrays import Array
from granular.tools.checks import positive


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


def fit_packing(
    inertial_number: ArrayLike, packing_fraction: ArrayLike, *, confidence: float = 0.95
) -> PackingFit:
    """Fit eq. 4.11 by least squares.

    Parameters and errors as in `fit_coordination`, with at least 3 points.
    """
    x, y = points_of(inertial_number, packing_fraction, 3, "packing_fraction")
    guess = {"phi_max": y.max(), "m": 0.1}
    return PackingFit(
        **least_squares(lambda i, top, slope: top - slope * i, x, y, guess, confidence)
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
    x, y = points_of(inertial_number, friction, 4, "friction")
    if error is not None:
        error = points_of(x, error, 4, "error")[1]
    # mu_2 is a sum of two parameters that are correlated.
    constants = least_squares(
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
