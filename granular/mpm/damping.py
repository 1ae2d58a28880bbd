"""Damping of the short waves that grow in plastic flow where the law is ill posed.

In slow flow frictional laws without a length scale are ill posed: all short waves grow, the shorter
the faster. They turn the directions of stress, so that a layer flows at slopes below its angle of
repose. Waves of the wave number k grow at a rate of at most

    elastic: a c_w k,  a by `granular.theory.short_wave_growth`,
    viscous: b mu p k^2/(rho gdot),  b by `granular.theory.viscous_growth`,

whichever is smaller; their harmonic sum joins both. The velocity of the points relaxes to that of
the grid at a rate s. A transfer from the points to the grid and back leaves the share T(k) of a
wave, so that the wave decays at the rate s (1 - T). Waves up to the length n dx decay as fast as
they can grow with s = growth/(1 - T) at k = 2 pi/(n dx). As T differs from 1 by the fourth order of
k, flows that vary over many cells are hardly affected. With I the damping falls to zero where the
law becomes well posed.
"""

from __future__ import annotations

import math

from granular.materials import NGF, DruckerPrager, HardeningDruckerPrager, Material, MuI
from granular.mpm.scene import Scene
from granular.theory.well_posed import short_wave_growth, viscous_growth, well_posed_range

__all__ = ["damping", "kept_by_transfer"]

UNBOUNDED = 1e100


def kept_by_transfer(cells: float) -> float:
    """Share of a wave that TPIC with quadratic B-splines keeps in a transfer to the grid and back.

    With the Fourier transform S = (sin(k/2)/(k/2))^3 of the B-spline, lengths in cells, and the
    points spread evenly, T = S^2/(1 + k S S'). The denominator is the affine part of the transfer;
    without it T = S^2.

    Parameters
    ----------
    cells : float
        Length of the wave in cells, >= 2.

    Returns
    -------
    float
        T, 1 - O(k^4) for long waves.
    """
    half = math.pi / cells
    ratio = math.sin(half) / half
    spline = ratio**3
    slope = 1.5 * ratio**2 * (math.cos(half) - ratio) / half
    return spline**2 / (1 + 2 * half * spline * slope)


def damping(scene: Scene) -> dict[str, float]:
    """Rates [1/s] of the damping of short waves by their names in the core; all 0 without one.

    ``ill_posed_rate`` is the shear rate over sqrt(p/K) below which plastic flow is ill posed,
    ``damping_rate`` the largest rate s, and ``crossover_rate`` the shear rate over p/K at which the
    viscous and the elastic growth rates are equal.
    """
    cells, material = getattr(scene.scheme.density, "damped_waves", 0.0), scene.material
    mu, limit = _friction(material)
    if not cells or not mu:
        return dict.fromkeys(("ill_posed_rate", "damping_rate", "crossover_rate"), 0.0)
    cells, c_w = max(cells, 2.0), material.wave_speed  # 2: the shortest waves of the grid
    k = 2 * math.pi / (cells * scene.grid.cell)
    elastic = short_wave_growth(mu, material.nu) * c_w * k
    viscous = viscous_growth(mu) * mu * material.K * k**2 / material.rho_c
    return {
        "ill_posed_rate": limit * math.sqrt(material.K),
        "damping_rate": elastic / (1 - kept_by_transfer(cells)),
        "crossover_rate": viscous / elastic,
    }


def _friction(material: Material) -> tuple[float, float]:
    """Friction in slow flow, and the shear rate over sqrt(p) below which such a flow is ill posed.

    Laws that are well posed in slow flow, elastic or with the length scale of a fluidity: 0.
    """
    if isinstance(material, DruckerPrager):
        return material.mu, UNBOUNDED  # no rate enters the law
    if isinstance(material, HardeningDruckerPrager):
        return material.limiting_friction, UNBOUNDED
    if isinstance(material, NGF) and not material.has_fluidity:
        friction = material.core_friction()
        material = MuI(mu_s=material.mu_s, mu_2=friction["mu_2"], xi=friction["xi"])
    if not isinstance(material, MuI):
        return 0.0, 0.0
    ends = well_posed_range(material)
    return material.mu_s, UNBOUNDED if ends is None else ends[0] * material.xi
