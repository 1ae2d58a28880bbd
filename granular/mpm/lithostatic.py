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


def stress_shape(
    scene: Scene, points: Points, weight: Array, friction: Array, cohesion: Array
) -> tuple[Array, Array]:
    """Ratio k of the pressure to the weight above, and the stress over the pressure, -S/k.

    Where a slope is steeper than the material bears at rest, its deviator is returned to the yield
    surface, tau = cohesion + friction p, as the law would do. Material of inflows, and of fills
    that are not lithostatic, has equal stresses in all directions.

    Parameters
    ----------
    weight : ndarray, shape (n,)
        Weight of the material above per area [Pa].
    friction, cohesion : ndarray, shape (n,)
        Of the yield surface, the cohesion [Pa]; the friction may be infinite.

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
    materials = [source.material or scene.material for source in scene.sources]
    ratios = [
        (m.K0_at(rest_friction(m, fill.packing)) if fill.K0 is None else fill.K0)
        if fill.lithostatic
        else 1.0
        for fill, m in zip(scene.fills, materials, strict=False)
    ]
    K0 = np.array([*ratios, *[1.0] * len(scene.inflows)])[points.fill]
    steep = K0 * (slope * slope).sum(axis=1)
    k = K0 + (1.0 - K0 + steep) / 3.0
    S = K0[:, None, None] * np.eye(3)
    S += (1.0 - K0 + steep)[:, None, None] * np.outer(up, up)
    tilted = slope[:, :, None] * up
    S += K0[:, None, None] * (tilted + tilted.transpose(0, 2, 1))
    # The deviator over the pressure, within yield.
    deviator = S / k[:, None, None] - np.eye(3)
    tau = np.sqrt(0.5 * (deviator**2).sum(axis=(1, 2)))
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
