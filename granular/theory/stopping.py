"""Layers too thin to flow: the threshold of the nonlocal law on a rough incline.

On a slope of angle t, mu = tan t at every depth z, and a small fluidity g obeys (Dunatunga &
Kamrin, "Modeling silo clogging with nonlocal granular rheology", eq. 2.1, without the term in g^2)

    t0 dg/dt = A^2 d^2 d2g/dz2 + lambda g,    lambda = dmu (tan t - mu_s)/(mu_2 - tan t),

with dmu = mu_2 - mu_s, dg/dz = 0 at the free surface and g = 0 at the rough base. The slowest mode
is cos(pi z/2H). It grows at the rate (lambda - (pi A d/2H)^2)/t0, which is positive only if
H > H_stop.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular.theory.incline import check_not_regularised, relative_depth
from granular.tools.arrays import Array
from granular.tools.checks import non_negative, positive


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
        Limiting friction coefficient, > mu_s; may be ``math.inf``, and is for a material with
        ``rheology="linear_mu_I"``: see `granular.materials.NGF.limiting_friction`.

    Returns
    -------
    ndarray
        H_stop [m], of the shape of `angle_deg`. It is infinite up to the angle atan(mu_s), where no
        layer flows, and 0 from atan(mu_2) on, where every layer flows.
    {raises}.
    """
    angle_deg = np.asarray(angle_deg, dtype=float)
    if not np.all((angle_deg >= 0) & (angle_deg < 90)):
        raise ValueError(f"angle_deg = {angle_deg} must be in [0.0, 90.0)")
    reach = _reach(A, d)
    growth = fluidity_growth(np.tan(np.radians(angle_deg)), mu_s, mu_2)
    flows = growth > 0
    return np.where(flows, reach / np.sqrt(np.where(flows, growth, 1.0)), np.inf)[()]


def stopping_angle(height: ArrayLike, A: float, d: float, mu_s: float, mu_2: float) -> Array:
    """Angle at and below which a layer on a rough incline does not flow (eq. 3.1 inverted).

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
        Angle [degrees], of the shape of `height`.
    {raises}.
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
    """Steady velocity just above H_stop, divided by its value at the surface.

    It is ``1 - cos(pi y/2H)``, the slowest mode of the fluidity integrated from the base.
    `bagnold_shape` is the other limit, that of thick layers.

    Parameters
    ----------
    y : array_like
        Distance from the base [m], any shape, within [0, height].
    height : float
        Thickness of the layer, normal to the base [m].

    Returns
    -------
    ndarray
        Values from 0 to 1, of the shape of `y`.

    Raises
    ------
    TypeError, ValueError
        If `height` is not positive, or `y` is outside the layer.
    """
    return 1 - np.sin(np.pi / 2 * relative_depth(y, height))


def limiting_friction(material: Any) -> float:
    """Friction that a law never exceeds: `NGF.limiting_friction` if it says so, else `mu_2`."""
    check_not_regularised(material)
    return getattr(material, "limiting_friction", material.mu_2)


def fluidity_growth(slope: ArrayLike, mu_s: float, mu_2: float) -> Array:
    """Growth coefficient lambda of the fluidity, as defined in the docstring of this module.

    It is t0 times the rate at which a uniform fluidity grows, and has no unit.

    Parameters
    ----------
    slope : array_like
        Friction coefficient mu = tan t, any shape.
    mu_s, mu_2 : float
        As in `stopping_height`.

    Returns
    -------
    ndarray
        lambda, of the shape of `slope`; negative below mu_s, infinite from mu_2 on.

    Raises
    ------
    TypeError, ValueError
        Unless 0 < mu_s < mu_2.
    """
    # Divided by dmu, so that an infinite mu_2 needs no separate formula.
    excess, span = np.asarray(slope, dtype=float) - mu_s, _span(mu_s, mu_2)
    share = 1 - excess / span
    below = share > 0
    return np.where(below, excess / np.where(below, share, 1.0), np.inf)


def _span(mu_s: float, mu_2: float) -> float:
    """Difference mu_2 - mu_s, after a check of both."""
    if positive("mu_2", mu_2, allow_inf=True) <= positive("mu_s", mu_s):
        raise ValueError(f"mu_2 = {mu_2} must exceed mu_s = {mu_s}")
    return mu_2 - mu_s


def _reach(A: float, d: float) -> float:
    """Length ``pi A d/2`` [m], which is H_stop for lambda = 1."""
    return math.pi / 2 * non_negative("A", A) * positive("d", d)
