"""The dilative viscoplastic material (Hurley, thesis, section 5.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from granular.materials import MuI
from granular.tools.arrays import Array
from granular.tools.checks import check_fields, in_range, non_negative, positive
from granular.tools.description import Description
from granular.tools.notebook import table


@dataclass(frozen=True, kw_only=True)
class Viscoplastic(Description):
    """Material with the stress -p I + (mu p + c) D/|D|, D = L + L^T, |D| = sqrt(D:D/2) (eq. 5.3).

    The friction is mu = mu_l + (mu_h - mu_l)/(D_star/|D| + 1) + beta (eq. 5.7) with the rate of
    dilation beta = div v/|D|, from 0 to `dilation` (eq. 5.8), and the pressure is
    p = kappa ((rho/rho0)^1.5 - 1), zero below rho0 (eq. 5.5). The defaults are those of the
    inclined flows (table 5.2), without dilation.

    Parameters
    ----------
    rho0 : float
        Lowest density at which the material is under pressure [kg/m3], > 0.
    mu_l, mu_h : float
        Friction at rest and at high rates, >= 0; if mu_h < mu_l the friction decreases with the
        rate.
    D_star : float
        Shear rate halfway between them [1/s], > 0.
    cohesion : float
        Shear strength without pressure [Pa], >= 0.
    kappa : float
        Stiffness [Pa], > 0; the bulk modulus at rho0 is 1.5 kappa. It must be large compared to the
        pressure. The thesis takes a low value, so that the time steps are long.
    nu : float
        Poisson's ratio of material at rest, 0 to 0.5. The thesis defines no stress at
        |D| = 0. Here the shear stress below the strength is that of a spring with the shear modulus
        `shear_modulus`, in addition to the largest viscosity of `Numerics.regularisation`, so that
        slopes below the friction angle stand. With 0.5 there is no spring, and they creep.
    dilation : float
        Largest beta, 0 to 1; 0 is without dilation, the thesis takes 0.5.
    mu_wall : float or None
        Friction between material and walls, >= 0; None for that of the bulk, which it cannot
        exceed. If it is constant and lower than the tangent of the slope, the slip grows without
        bound.
    {raises}.
    """

    rho0: float = 1550.0
    mu_l: float = 0.268
    mu_h: float = 0.577
    D_star: float = 20.0
    cohesion: float = 0.0
    kappa: float = 1e5
    nu: float = 0.45
    dilation: float = 0.0
    mu_wall: float | None = None

    def __post_init__(self) -> None:
        check_fields(self, positive, "rho0", "D_star", "kappa")
        check_fields(self, non_negative, "mu_l", "mu_h", "cohesion")
        check_fields(self, in_range, "nu", low=0.0, high=0.5)
        check_fields(self, in_range, "dilation", low=0.0, high=1.0)
        check_fields(self, non_negative, "mu_wall", optional=True)
        positive(f"wave_speed of kappa = {self.kappa} and rho0 = {self.rho0}", self.wave_speed)

    @property
    def rho_c(self) -> float:
        """Critical density [kg/m3], the name that states and measures use for `rho0`."""
        return self.rho0

    @property
    def granular(self) -> bool:
        """True: the material always has a yield strength."""
        return True

    @property
    def shear_modulus(self) -> float:
        """Shear modulus [Pa], G = 3 K (1 - 2 nu)/(2 (1 + nu)) with K = 1.5 kappa."""
        return 2.25 * self.kappa * (1.0 - 2.0 * self.nu) / (1.0 + self.nu)

    @classmethod
    def matching(cls, material: MuI, pressure: float, **changes: Any) -> Self:
        """Make the material that matches a mu(I) law at one pressure.

        The friction of the mu(I) law depends on the rate and the pressure, that of this material on
        the rate only. Density, frictions, cohesion, bulk modulus (K = 1.5 kappa at rho0) and
        Poisson's ratio are the same. D_star is the rate at which I = I0 under the given pressure,
        xi sqrt(p), so that the laws agree at this pressure only.

        Parameters
        ----------
        pressure : float
            Typical pressure of the flow [Pa], > 0.
        **changes
            Other parameters of `Viscoplastic`, such as the dilation.
        {raises}.
        """
        if not isinstance(material, MuI):
            raise TypeError(f"material = {material!r} must be a MuI")
        if material.tensile_strength:
            raise ValueError(
                f"tensile_strength = {material.tensile_strength:.6g} must be 0: material of SPH "
                "bears no tension"
            )
        given = {
            "rho0": material.rho_c,
            "mu_l": material.mu_s,
            "mu_h": material.mu_2,
            "D_star": material.xi * math.sqrt(positive("pressure", pressure)),
            "cohesion": material.cohesion,
            "kappa": material.K / 1.5,
            "nu": material.nu,
        }
        return cls(**(given | changes))

    def stored_energy(self, rho: Array) -> Array:
        """Elastic energy at a density [J/kg]: the integral of p/rho^2 from rho0 on.

        The energy of the shear spring is not included.
        """
        ratio = np.maximum(rho / self.rho0, 1.0)
        return self.kappa / self.rho0 * (2.0 * np.sqrt(ratio) + 1.0 / ratio - 3.0)

    @property
    def wave_speed(self) -> float:
        """Speed of sound at rho0 [m/s], sqrt((1.5 kappa + 4 G/3)/rho0) (eq. 5.6 with G = 0)."""
        return math.sqrt((1.5 * self.kappa + 4.0 / 3.0 * self.shear_modulus) / self.rho0)

    def _repr_html_(self) -> str:
        return table("Viscoplastic", vars(self))


grit = Viscoplastic(rho0=1404.0, mu_l=0.74, mu_h=0.74, mu_wall=0.335)
"""Fine sand (Hurley, thesis, table 5.3, of Balmforth & Kerswell 2005), without dilation."""

glass = Viscoplastic(rho0=1450.0, mu_l=0.456, mu_h=0.456, mu_wall=0.263)
"""Fine glass beads (the same table), without dilation."""
