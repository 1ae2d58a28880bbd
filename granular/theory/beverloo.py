"""Discharge of a silo through an orifice."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granular.checks import non_negative, positive


def beverloo_rate(
    orifice: ArrayLike,
    rho: float,
    C: float = 1.42,
    k: float = 0.0,
    d: float = 0.0,
    gravity: float = 9.8,
    exponent: float = 1.5,
) -> NDArray[np.float64]:
    """Mass flow rate ``C rho sqrt(g) (D - k d)^exponent`` (Dunatunga & Kamrin 2015, eq. 4.4).

    Parameters
    ----------
    orifice : array_like
        Full width D of the orifice [m], any shape.
    rho : float
        Bulk density [kg/m3].
    C : float
        Discharge coefficient; 1.42 is the fit of eq. 4.5. With exponent 3/2 it has no unit.
    k : float
        Width of the empty annulus in grain diameters; 0 for a local law.
    d : float
        Grain diameter [m].
    gravity : float
        Magnitude of gravity [m/s2].
    exponent : float
        3/2 in 2D (rate in kg/s per metre of depth), 5/2 for a round orifice in 3D. Other values
        belong to free fits (1.47 with C = 1.31 in section 4.2), in which C has the unit that the
        exponent requires.

    Returns
    -------
    ndarray
        Rate of discharge, of the shape of `orifice`; zero where D <= k d.

    Raises
    ------
    TypeError, ValueError
        If an argument is negative or not finite, or `gravity` or `exponent` is 0.
    """
    orifice = np.asarray(orifice, dtype=float)
    if not (np.all(orifice >= 0) and np.all(np.isfinite(orifice))):
        raise ValueError(f"orifice = {orifice} must be finite and >= 0")
    positive("exponent", exponent)
    positive("gravity", gravity)
    for name, value in (("rho", rho), ("C", C), ("k", k), ("d", d)):
        non_negative(name, value)
    return C * rho * np.sqrt(gravity) * np.maximum(orifice - k * d, 0.0) ** exponent
