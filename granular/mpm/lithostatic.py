"""Material that bears its weight at the start: its compression, and its stress in every direction.

With the vertical stress rho g d at the depth d, and a horizontal stress of K0 times that, the
stress is rho g d S. Below a top of the slope s (the horizontal gradient of d), the balance of
momentum is exact for a constant s with

    S = u u + K0 (P + s u + u s + s.s u u),

where u is the unit vector against gravity and P = 1 - u u the projection on the horizontal. Hence
the pressure is rho g d k with k = tr S/3 = K0 + (1 - K0 + K0 s.s)/3.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from granular.model.fill import rest_friction
from granular.tools.arrays import Array, BoolArray

if TYPE_CHECKING:
    from granular.model.seeding import Points
    from granular.mpm.scene import Scene


_TINY = float(np.finfo(float).tiny)

_COMPONENTS = ((0, 1, 2, 0, 1, 0), (0, 1, 2, 1, 2, 2))
"""Rows and columns of the components xx, yy, zz, xy, yz, xz of a stress."""


def _frictions(scene: Scene, points: Points, pressure: Array) -> Array:
    """Friction tau/p at which the points begin to flow at a pressure [Pa]; may be infinite."""
    each = [(source.material or scene.material, source.packing) for source in scene.sources]
    friction: Array = np.array([rest_friction(*source, 0.0) for source in each])[points.fill]
    for i, (material, packing) in enumerate(each):
        if getattr(material, "csl_slope", 0.0):
            here = points.fill == i
            friction[here] = rest_friction(material, packing, pressure[here])
    return friction


def _ratios(scene: Scene, points: Points, weight: Array) -> Array:
    """K0 at the points, 1 outside of lithostatic fills.

    A K0 that is not given is that of the friction at the vertical stress. Where friction falls with
    pressure this is on the safe side, as the pressure is less than that.
    """
    K0 = np.ones(len(weight))
    friction = _frictions(scene, points, weight)
    for i, fill in enumerate(scene.fills):
        if fill.lithostatic:
            here = points.fill == i
            material = fill.material or scene.material
            K0[here] = material.K0_at(friction[here]) if fill.K0 is None else fill.K0
    return K0


def _check_line(scene: Scene, points: Points, p: Array) -> None:
    """Refuse fills that bear no deviator at their pressure, and a K0 that yields at it.

    Those of material whose friction falls along a critical-state line alone: others are refused by
    the scene.
    """
    friction = _frictions(scene, points, p)
    for i, fill in enumerate(scene.fills):
        material = fill.material or scene.material
        slope, here = getattr(material, "csl_slope", 0.0), points.fill == i
        if not (fill.lithostatic and slope and here.any()):
            continue
        worst = int(np.argmin(np.where(here, friction, math.inf)))
        at = f"at {p[worst]:.6g} Pa on the critical-state line"
        if friction[worst] <= 0:
            raise ValueError(
                f"fills[{i}].packing = {fill.packing} must be larger, or csl_slope = {slope} "
                f"smaller: {at} the material has no friction"
            )
        low, high = material.yield_ratios_at(friction[worst])
        if fill.K0 is not None and not low <= fill.K0 <= high:
            raise ValueError(
                f"fills[{i}].K0 = {fill.K0} must be from {low:.6g} to {high:.6g}, the ratios at "
                f"which a material of friction {friction[worst]:.6g} yields {at}"
            )


def stress_shape(
    scene: Scene, points: Points, weight: Array, cohesion: Array
) -> tuple[Array, Array]:
    """Ratio k of the pressure to the weight above, and the stress over the pressure, -S/k.

    Where a slope is steeper than the material bears at rest, its deviator is returned to the yield
    surface, tau = cohesion + friction p, as the law would do. Material of inflows, and of fills
    that are not lithostatic, has equal stresses in all directions.

    Parameters
    ----------
    weight : ndarray, shape (n,)
        Weight of the material above per area [Pa].
    cohesion : ndarray, shape (n,)
        Of the yield surface [Pa].

    Returns
    -------
    k : ndarray, shape (n,)
    shape : ndarray, shape (n, 4) in 2D, (n, 6) in 3D
        1 in the normal components and 0 in the others where all stresses are equal.
    """
    gravity = scene.gravity.at(0.0)
    size = math.hypot(*gravity)
    up, slope = np.zeros(3), np.zeros((len(points.x), 3))
    up[: scene.dim] = -gravity / size if size else 0.0
    slope[:, : scene.dim] = points.slope
    K0 = _ratios(scene, points, weight)
    steep = K0 * (slope * slope).sum(axis=1)
    k = K0 + (1.0 - K0 + steep) / 3.0
    _check_line(scene, points, k * weight)
    S = K0[:, None, None] * np.eye(3)
    S += (1.0 - K0 + steep)[:, None, None] * np.outer(up, up)
    tilted = slope[:, :, None] * up
    S += K0[:, None, None] * (tilted + tilted.transpose(0, 2, 1))
    # The deviator over the pressure, within yield.
    deviator = S / k[:, None, None] - np.eye(3)
    tau = np.sqrt(0.5 * (deviator**2).sum(axis=(1, 2)))
    friction = _frictions(scene, points, k * weight)
    with np.errstate(over="ignore"):  # material that bears any deviator
        borne = friction + cohesion / np.maximum(k * weight, _TINY)
        deviator *= np.minimum(1.0, borne / np.maximum(tau, _TINY))[:, None, None]
    shape = (np.eye(3) + deviator)[:, *_COMPONENTS]
    return k, shape[:, :4] if scene.dim == 2 else shape


def rest_compression(weight: Array, K: Array, hencky: BoolArray) -> Array:
    """ln(rho/rho_c) of material that bears a weight of rho_c g depth, or k times that [Pa].

    With p = K c, c = ln(rho/rho_c), dp/dz = k rho g has the solution exp(-c) = 1 - k weight/K. With
    the Cauchy pressure of Hencky's law, K c exp(c), it is c + c^2/2 = k weight/K.
    """
    if (~hencky & (weight >= K)).any():
        worst = int(np.argmax(np.where(hencky, 0, weight / K)))
        raise ValueError(
            f"E is too small: K = {K[worst]:.6g} must exceed rho_c g depth "
            f"(1 + 2 K0)/3 = {weight[worst]:.6g}"
        )
    ratio = weight / K
    finite = 2 * ratio / (1 + np.sqrt(1 + 2 * ratio))
    return np.where(hencky, finite, -np.log1p(-np.where(hencky, 0, ratio)))
