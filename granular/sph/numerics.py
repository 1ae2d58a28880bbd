"""Parameters of the SPH discretisation, in part those of chapter 5 of Hurley's thesis."""

from __future__ import annotations

import math
from dataclasses import dataclass

from granular.sph.material import Viscoplastic
from granular.tools.checks import check_fields, in_range, positive
from granular.tools.description import Description

WALL_PUSH, SOFT = 0.03, 1e5
"""Fraction by which rho0 of walls is lower than that of the material, and the kappa [Pa] up to
which it has this value (from the thesis)."""

MOST_LOADS = 10.0
"""Largest pressure of walls on a seeding lattice at rest, over the weight of the material on it.

A bed 8 particles high rests with 4 times its weight, rises by a quarter with 38, and is thrown to
four times its height with 380.
"""


@dataclass(frozen=True, kw_only=True)
class Numerics(Description):
    """Parameters of the discretisation.

    Parameters
    ----------
    smoothing : float
        Smoothing length h in spacings of the particles, 1 to 2. Below 1 a particle has too few
        neighbours to resolve shear; above 2 particles form pairs and the cost grows. The thesis
        takes 1.2.
    skin : float
        Distance by which the list of neighbours reaches farther than the kernel, in h, 0.02 to 1.
        It changes the cost and, via the order of the sums, the last bits of the results.
    cfl : float
        Time step as a fraction of its limits h/(4 c) and sqrt(h/|a|)/4 (eq. 5.28), 1e-6 to 2.
    dt : float or None
        Fixed time step [s], > 0; None for the limits.
    regularisation : float
        Largest viscosity k in rho h^2/dt, 0.01 to 1.5: |D| is bounded below by
        (mu p + c) dt/(k h^2 rho). This inverts the third limit of eq. 5.28: as |D| goes to zero the
        viscosity grows without bound, and no time step would be short enough. With larger k
        particles jitter. Material that strains more slowly is held by the spring of
        `Viscoplastic.nu`; without the spring it creeps at that rate.
    wall_density : float or None
        rho0 of the wall particles as a fraction of the material's, 0.9 to 1. Their pressure begins
        at a lower density, so that particles do not pass through walls; the density next to a wall
        is lower. Against a seeding lattice at rest, 3 % less causes a pressure of 4.7 % of kappa:
        4.7 kPa with the kappa of the thesis, 1e5 Pa, but with 1e7 Pa enough to throw a heap apart.
        None for 3 % up to 1e5 Pa, and for a difference in proportion to 1/kappa above, so that the
        wall pressure does not grow with the stiffness; less where that pressure were more than
        ten times the weight of the material on an area.
    z_max : float
        Largest factor of the artificial velocity of walls (eq. 5.24), 1 to 2. With 1 the wall
        particles have the velocity of the wall; the thesis takes 1.5. Above 1 a wall has more
        weight in the strain rates than in the forces.
    {raises}.
    """

    smoothing: float = 1.2
    skin: float = 0.3
    cfl: float = 1.0
    dt: float | None = None
    regularisation: float = 0.5
    wall_density: float | None = None
    z_max: float = 1.0

    def __post_init__(self) -> None:
        check_fields(self, in_range, "smoothing", "z_max", low=1.0, high=2.0)
        check_fields(self, in_range, "skin", low=0.02, high=1.0)
        check_fields(self, in_range, "cfl", low=1e-6, high=2.0)
        check_fields(self, in_range, "regularisation", low=0.01, high=1.5)
        check_fields(self, in_range, "wall_density", low=0.9, high=1.0, optional=True)
        check_fields(self, positive, "dt", optional=True)

    def rho0_wall(self, material: Viscoplastic, weight: float = math.inf) -> float:
        """rho0 of the wall particles [kg/m3], for a weight of the material on an area [Pa]."""
        share = self.wall_density
        if share is None:
            # The pressure against a seeding lattice at rest is 1.5 kappa times the push.
            most = MOST_LOADS * weight / (1.5 * material.kappa)
            share = 1.0 - min(WALL_PUSH, WALL_PUSH * SOFT / material.kappa, most)
        return share * material.rho0
