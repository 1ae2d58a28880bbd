"""Discharge of a silo through an orifice."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from granular.model.gravity import EARTH
from granular.tools.arrays import Array
from granular.tools.checks import integer, non_negative, positive

COEFFICIENT = {2: 1.42, 3: 0.58}
"""Discharge coefficients at the exponents 3/2 and 5/2: the fit of Dunatunga & Kamrin 2015, eq. 4.5,
per metre of depth, and that of Beverloo, Leniger & van de Velde 1961 (Chem. Eng. Sci. 15, 260)."""


def beverloo_rate(
    orifice: ArrayLike,
    rho: float,
    C: float | None = None,
    k: float = 0.0,
    d: float = 0.0,
    gravity: float = EARTH,
    exponent: float | None = None,
    *,
    dim: int = 2,
) -> Array:
    """Mass flow rate ``C rho sqrt(g) (D - k d)^exponent`` (Dunatunga & Kamrin 2015, eq. 4.4).

    Parameters
    ----------
    orifice : array_like
        Full width D of the slot, or diameter of the round orifice [m], any shape.
    rho : float
        Bulk density [kg/m3].
    C : float, optional
        Discharge coefficient; by default 1.42 in 2D (Dunatunga & Kamrin 2015, eq. 4.5) and 0.58 in
        3D (Beverloo et al. 1961, with k of 1.4). It has no unit at the exponent of `dim`.
    k : float
        Width of the empty annulus in grain diameters; 0 for a local law.
    d : float
        Grain diameter [m].
    exponent : float, optional
        By default dim - 1/2, which the units require. Other values belong to free fits (1.47 with
        C = 1.31 in section 4.2), in which C has the unit that the exponent requires, so that it
        must be given.
    dim : {2, 3}
        2 for a slot (rate per metre of depth), 3 for a round orifice.

    Returns
    -------
    ndarray
        Rate of discharge [kg/s; in 2D per metre of depth], of the shape of `orifice`; zero where
        D <= k d.

    Raises
    ------
    TypeError, ValueError
        If an argument is negative or not finite, `gravity` or `exponent` is 0, `dim` is neither 2
        nor 3, or an exponent other than dim - 1/2 is given without C.
    """
    orifice = np.asarray(orifice, dtype=float)
    if not (np.all(orifice >= 0) and np.all(np.isfinite(orifice))):
        raise ValueError(f"orifice = {orifice} must be finite and >= 0")
    natural = integer("dim", dim, 2, 3) - 0.5
    power = natural if exponent is None else positive("exponent", exponent)
    if C is None:
        if power != natural:
            raise ValueError(
                f"exponent = {power:g} needs its own C: the default one belongs to the exponent "
                f"{natural:g} of dim = {dim}"
            )
        C = COEFFICIENT[dim]
    positive("gravity", gravity)
    for name, value in (("rho", rho), ("C", C), ("k", k), ("d", d)):
        non_negative(name, value)
    return C * rho * np.sqrt(gravity) * np.maximum(orifice - k * d, 0.0) ** power
