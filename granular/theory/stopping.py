"""Layers too thin to flow: the threshold of the nonlocal law on a rough incline.

On a slope, mu = tan t all over the depth z, and a small fluidity g follows (Dunatunga & Kamrin,
"Modeling silo clogging with nonlocal granular rheology", eq. 2.1, without its square of g)

    t0 dg/dt = A^2 d^2 d2g/dz2 + lambda g,    lambda = dmu (tan t - mu_s)/(mu_2 - tan t),

dmu = mu_2 - mu_s, with dg/dz = 0 at the free surface and g = 0 at the rough base. Its slowest mode
is cos(pi z/2H), which grows at the rate (lambda - (pi A d/2H)^2)/t0: only where H > H_stop.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granular.checks import non_negative, positive
from granular.theory.incline import relative_depth

Array = NDArray[np.float64]


def stopping_height(angle_deg: ArrayLike, A: float, d: float, mu_s: float, mu_2: float) -> Array:
    """Thickness at and below which a layer on a rough incline does not flow (eq. 3.1).

    ``H_stop = (pi A d/2) sqrt((mu_2 - tan t)/((mu_2 - mu_s)(tan t - mu_s)))``, which for an
    infinite mu_2 is ``(pi A d/2)/sqrt(tan t - mu_s)``. The law has no hysteresis: a layer at rest
    starts at the same thickness.

    Parameters
    ----------
    angle_deg : array_like
        Inclination [degrees], any shape, within [0, 90).
    A : float
        Nonlocal amplitude, >= 0; 0 for a local law.
    d : float
        Grain diameter [m].
    mu_s : float
        Static friction coefficient.
    mu_2 : float
        Limiting friction coefficient, > mu_s; may be ``math.inf``.

    Returns
    -------
    ndarray
        H_stop [m], the shape of `angle_deg`: infinite up to the angle atan(mu_s), where nothing
        flows, and 0 from atan(mu_2) on, where everything does.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.
    """
    angle_deg = np.asarray(angle_deg, dtype=float)
    if not np.all((angle_deg >= 0) & (angle_deg < 90)):
        raise ValueError(f"angle_deg = {angle_deg} must be in [0.0, 90.0)")
    reach = _reach(A, d)
    growth = fluidity_growth(np.tan(np.radians(angle_deg)), mu_s, mu_2)
    flows = growth > 0
    return np.where(flows, reach / np.sqrt(np.where(flows, growth, 1.0)), np.inf)[()]


def stopping_angle(height: ArrayLike, A: float, d: float, mu_s: float, mu_2: float) -> Array:
    """Angle at and below which a layer on a rough incline does not flow: eq. 3.1 for the angle.

    ``tan t = mu_s + k/(1 + k/(mu_2 - mu_s))`` with ``k = (pi A d/2H)^2``.

    Parameters
    ----------
    height : array_like
        Thickness of the layer, normal to the base [m], any shape; infinite gives atan(mu_s).
    A, d, mu_s, mu_2
        As in `stopping_height`.

    Returns
    -------
    ndarray
        The angle [degrees], the shape of `height`.

    Raises
    ------
    TypeError, ValueError
        For arguments out of range.
    """
    height = np.asarray(height, dtype=float)
    if not np.all(height > 0):
        raise ValueError(f"height = {height} must be > 0")
    span = _span(mu_s, mu_2)
    # k/(1 + k/span) as 1/(1/k + 1/span): a thin layer may have an infinite k.
    with np.errstate(divide="ignore", over="ignore"):
        excess = 1 / ((height / _reach(A, d)) ** 2 + 1 / span)
    return np.degrees(np.arctan(mu_s + excess))


def stopping_shape(y: ArrayLike, height: float) -> Array:
    """Steady velocity over its value at the surface, just above H_stop: ``1 - cos(pi y/2H)``.

    The slowest mode of the fluidity, integrated from the base. `bagnold_shape` is the other
    limit, that of thick layers.

    Parameters
    ----------
    y : array_like
        Distance from the base [m], any shape, within [0, height].
    height : float
        Thickness of the layer, normal to the base [m].

    Returns
    -------
    ndarray
        The shape of `y`, from 0 to 1.

    Raises
    ------
    TypeError, ValueError
        For a `height` that is not positive, and for `y` outside the layer.
    """
    return 1 - np.sin(np.pi / 2 * relative_depth(y, height))


def fluidity_growth(slope: ArrayLike, mu_s: float, mu_2: float) -> Array:
    """lambda of the module's text: t0 times the rate at which an even fluidity grows, no unit.

    Parameters
    ----------
    slope : array_like
        mu = tan t, any shape.
    mu_s, mu_2 : float
        As in `stopping_height`.

    Returns
    -------
    ndarray
        The shape of `slope`; negative below mu_s, infinite from mu_2 on.

    Raises
    ------
    TypeError, ValueError
        Unless 0 < mu_s < mu_2.
    """
    # Divided by dmu, so that an infinite mu_2 needs no formula of its own.
    excess, span = np.asarray(slope, dtype=float) - mu_s, _span(mu_s, mu_2)
    share = 1 - excess / span
    below = share > 0
    return np.where(below, excess / np.where(below, share, 1.0), np.inf)


def _span(mu_s: float, mu_2: float) -> float:
    """mu_2 - mu_s, both checked."""
    if positive("mu_2", mu_2, allow_inf=True) <= positive("mu_s", mu_s):
        raise ValueError(f"mu_2 = {mu_2} must exceed mu_s = {mu_s}")
    return mu_2 - mu_s


def _reach(A: float, d: float) -> float:
    """pi A d/2 [m]: H_stop where an even fluidity would grow by e in t0."""
    return math.pi / 2 * non_negative("A", A) * positive("d", d)
