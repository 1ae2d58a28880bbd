"""Damping of slow plastic flow: of short waves that grow, and of noise within averaged cells.

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

With a cell-averaged density the points of a cell share their stress, and differences of their
velocities are noise of the sampling. Where they decay throughout at a rate that goes with c_w/dx,
run-outs become shorter the stiffer the grains are. So they do only in slow flow, at a rate and up
to an inertial number that were measured (`granular.CellAveragedDensity`;
docs/reports/accuracy_of_schemes.md).
"""

from __future__ import annotations

import math

from granular.materials import (
    NGF,
    DruckerPrager,
    HardeningDruckerPrager,
    Material,
    MuI,
    RegularisedMuI,
)
from granular.mpm.scene import Scene
from granular.mpm.schemes import CellAveragedDensity, SmoothedDensity
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


def damping(scene: Scene, material: Material) -> dict[str, float]:
    """Rates [1/s] of the damping of the points of a material by their names in the core.

    All are 0 without one. ``damping_rate`` is the largest rate s, ``ill_posed_rate`` the shear rate
    over sqrt(p/K) from which nothing is damped, and ``crossover_rate`` the shear rate over p/K at
    which the viscous and the elastic growth rates are equal.
    """
    density = scene.scheme.density
    if isinstance(density, CellAveragedDensity):
        found = _of_cells(density, scene, material)
    elif isinstance(density, SmoothedDensity) and density.damped_waves:
        found = _of_waves(density, scene, material)
    else:
        found = (0.0, 0.0, 0.0)
    rate, limit, crossover = found
    return {
        "damping_rate": rate,
        "ill_posed_rate": min(limit * math.sqrt(material.K), UNBOUNDED),
        "crossover_rate": crossover,
    }


def _of_waves(
    density: SmoothedDensity, scene: Scene, material: Material
) -> tuple[float, float, float]:
    """Rate s, limit of the shear rate over sqrt(p), and crossover rate of damped waves."""
    c_w = material.wave_speed
    friction, xi = _flow(material)
    well_posed = material.has_fluidity or isinstance(material, RegularisedMuI)
    if not friction or well_posed:  # a fluidity has a length scale
        return 0.0, 0.0, 0.0
    ends = None if xi == math.inf else well_posed_range(_local(material))
    limit = math.inf if ends is None else ends[0] * xi
    cells = max(density.damped_waves, 2.0)  # 2: the shortest waves of the grid
    k = 2 * math.pi / (cells * scene.grid.cell)
    elastic = short_wave_growth(friction, material.nu) * c_w * k
    viscous = viscous_growth(friction) * friction * material.K * k**2 / material.rho_c
    return elastic / (1 - kept_by_transfer(cells)), limit, viscous / elastic


def _of_cells(
    density: CellAveragedDensity, scene: Scene, material: Material
) -> tuple[float, float, float]:
    """Rate, limit of the shear rate over sqrt(p), and no crossover, of slow flow in cells."""
    friction, xi = _flow(material)
    if not friction:
        return 0.0, 0.0, 0.0
    rate = density.slow_decay * material.wave_speed / scene.grid.cell
    return rate, density.slow_inertial_number * xi, UNBOUNDED


def _flow(material: Material) -> tuple[float, float]:
    """Friction in slow flow, and the shear rate over sqrt(p) where I = I0; infinite without one.

    Both 0 for elastic materials.
    """
    if isinstance(material, DruckerPrager):
        return material.mu, math.inf
    if isinstance(material, HardeningDruckerPrager):
        return material.limiting_friction, math.inf
    if isinstance(material, RegularisedMuI):
        return material.mu_s, material.xi
    if isinstance(material, MuI | NGF):
        return material.mu_s, _local(material).xi
    return 0.0, 0.0


def _local(material: Material) -> MuI:
    """Local law of a material with mu(I), without its cohesion."""
    if isinstance(material, MuI):
        return (
            material.replace(cohesion=0.0, tensile_strength=None) if material.cohesion else material
        )
    assert isinstance(material, NGF)
    friction = material.core_friction()
    return MuI(mu_s=material.mu_s, mu_2=friction["mu_2"], xi=friction["xi"])
