"""The partially regularised mu(I) rheology of Barker & Gray 2017."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular.materials.base import Material
from granular.materials.laws import MuI, check_friction
from granular.tools.checks import check_fields, in_range, non_negative, positive, set_fields


@dataclass(frozen=True, kw_only=True)
class RegularisedMuI(Material):
    """Granular material with the partially regularised mu(I) rheology.

    Barker & Gray 2017 (J. Fluid Mech. 828, 5-32) changed mu(I) so that it is well posed from rest
    to a large inertial number:

    ``mu = (mu_s I0 + mu_2 I + mu_inf I^2)/(I0 + I)`` for I > I1,
    ``mu = sqrt(alpha/ln(A/I))`` for I <= I1,

    where I1 is the lower end of the range in which mu(I) itself is well posed
    (`granular.theory.well_posed_range`), and A makes mu continuous. There is no yield stress: the
    material creeps at any shear stress, and heaps and slopes never come to rest.

    Parameters
    ----------
    E, nu, rho_c, restitution, contact_diameter
        See `Material`.
    elasticity : {"hypoelastic"}
        Only this one is available.
    mu_s : float
        Static friction coefficient of mu(I), > 0. Here it is not that of a yield stress.
    mu_2 : float
        Limiting friction coefficient of mu(I), > mu_s.
    rho_s : float
        Density of the grains themselves [kg/m3], >= rho_c.
    I0 : float
        Reference inertial number, > 0.
    d : float
        Grain diameter [m], > 0.
    alpha : float
        Constant of the creep, > 0 and at most 2, beyond which slow flow is ill posed.
    mu_inf : float
        Slope of mu(I) in the limit of fast flow, >= 0; with 0 the friction is bounded by mu_2.

    Raises
    ------
    ValueError
        For values out of range, friction coefficients with which mu(I) is nowhere well posed, and
        an `alpha` with which the creep at I1 is ill posed or mu(I1)^2 exceeds 2 alpha/3.
    TypeError
        For arguments of a wrong type.
    """

    mu_s: float = 0.3819
    mu_2: float = 0.6435
    rho_s: float = 2450.0
    I0: float = 0.279
    d: float = 0.005
    alpha: float = 1.9
    mu_inf: float = 0.05

    flow = "regularised_mu_I"

    def __post_init__(self) -> None:
        from granular.theory.well_posed import well_posed_range  # which needs the laws

        super().__post_init__()
        if self.elasticity != "hypoelastic":
            raise ValueError(
                f'elasticity = {self.elasticity!r} must be "hypoelastic" with the regularised mu(I)'
            )
        check_friction(self, allow_inf=False)
        check_fields(self, positive, "I0", "d")
        check_fields(self, in_range, "alpha", low=0.0, high=2.0, open_low=True)
        check_fields(self, non_negative, "mu_inf")
        positive("I0/(d sqrt(rho_s))", self.xi)
        ends = well_posed_range(MuI(mu_s=self.mu_s, mu_2=self.mu_2))
        if ends is None:
            raise ValueError(
                f"mu_2 = {self.mu_2} must be larger with mu_s = {self.mu_s}: mu(I) is nowhere well "
                "posed, so that I1 does not exist"
            )
        set_fields(self, _I1=ends[0] * self.I0)
        # C/mu^2 of Barker et al. 2015 is convex in mu^2, and negative at 0: the end decides
        square = float(self.friction(self.I1)) ** 2
        ill = square / self.alpha**2 - 2 / self.alpha + (1 - square / (4 * self.alpha)) ** 2
        if ill > 0 or square > 2 * self.alpha / 3:
            raise ValueError(
                f"alpha = {self.alpha} must be such that the creep up to mu(I1) = "
                f"{math.sqrt(square):.6g} is well posed and mu(I1)^2 <= 2 alpha/3"
            )

    @property
    def static_friction(self) -> float:
        """Friction tau/p of slow flow, `mu_s`; below it the material creeps."""
        return self.mu_s

    @property
    def xi(self) -> float:
        """I0/(d sqrt(rho_s)) [sqrt(m/kg)], see `MuI`."""
        return self.I0 / (self.d * math.sqrt(self.rho_s))

    @property
    def I1(self) -> float:
        """Inertial number at and below which the material creeps."""
        return float(self.__dict__["_I1"])

    def _fast(self, I: Any) -> Any:  # noqa: E741 (the usual symbol)
        return (self.mu_s * self.I0 + (self.mu_2 + self.mu_inf * I) * I) / (self.I0 + I)

    def friction(self, I: Any) -> Any:  # noqa: E741
        """Friction tau/p at inertial numbers >= 0, a number or an array; 0 at rest."""
        inertial = np.asarray(I, dtype=float)
        slow = np.clip(inertial, 1e-300, self.I1)
        power = self.alpha / float(self._fast(self.I1)) ** 2  # ln(A/I1)
        creep = np.sqrt(self.alpha / (power - np.log(slow / self.I1)))
        return np.where(inertial > self.I1, self._fast(inertial), creep * (inertial > 0))[()]
