"""Base class of the materials: elasticity, reference density and elastic damping."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from granular.tools.checks import check_fields, in_range, one_of, positive
from granular.tools.description import Description
from granular.tools.notebook import table


@dataclass(frozen=True, kw_only=True)
class Material(Description):
    """Base class of the materials: isotropic elasticity and a reference density.

    Parameters
    ----------
    E : float
        Young's modulus [Pa], > 0.
    nu : float
        Poisson's ratio, 0 <= nu < 1/2.
    rho_c : float
        Density [kg/m3] of the densest stress-free state, > 0. Material of a lower density is
        stress-free (Dunatunga & Kamrin 2015, eq. 2.7).
    elasticity : {"hypoelastic", "hencky"}
        "hypoelastic" integrates the stress by the Jaumann rate (Dunatunga & Kamrin 2015, eq. 2.9).
        "hencky" has an energy of the logarithmic strain, which is exact in any rotation and shear,
        and its pressure is always that of its density, K c exp(c) with c = ln(rho/rho_c) (Haeri &
        Skonieczny 2021). It takes longer.
    restitution : float
        Coefficient of restitution of a contact of two grains, 0.01 to 1. It determines the elastic
        damping (`damping_time`); 1 means none.
    contact_diameter : float, optional
        Diameter of the grains of these contacts [m], > 0; the grain diameter `d` of the law if
        not given. Only used with a restitution below 1, which needs one of the two.
    {raises}; TypeError for `Material` itself, which is
        abstract.
    """

    E: float = 1e9
    nu: float = 0.3
    rho_c: float = 1500.0
    elasticity: str = "hypoelastic"
    restitution: float = 1.0
    contact_diameter: float | None = None

    flow: ClassVar[str]
    """Flow rule, by its name in the core."""
    granular: ClassVar[bool] = True
    """True if the material separates in tension, at the latest at its tensile strength."""
    dilates: ClassVar[bool] = False
    """True if flow changes the packing fraction at which the material is free of stress."""
    has_fluidity: ClassVar[bool] = False
    """True if the law is nonlocal, with a fluidity `g` at every point."""

    def is_local(self, cell: float) -> bool:
        """True if the law acts as a local one in cells of this size [m]."""
        return not self.has_fluidity

    def __post_init__(self) -> None:
        if type(self) is Material:
            raise TypeError(
                "Material is abstract: use MuI, RegularisedMuI, DilatantMuI, NGF, DruckerPrager, "
                "HardeningDruckerPrager or Elastic"
            )
        check_fields(self, positive, "E", "rho_c")
        check_fields(self, in_range, "nu", low=0.0, high=0.5, open_high=True)
        check_fields(self, in_range, "restitution", low=0.01, high=1.0)
        if self.contact_diameter is not None:
            check_fields(self, positive, "contact_diameter")
        elif self.restitution < 1.0 and getattr(self, "d", None) is None:
            raise ValueError(
                f"restitution = {self.restitution} needs contact_diameter, the diameter of the "
                "grains [m], as the material has no d"
            )
        one_of("elasticity", self.elasticity, ("hypoelastic", "hencky"))
        positive(f"wave_speed of E = {self.E} and rho_c = {self.rho_c}", self.wave_speed)

    @property
    def law(self) -> str:
        """Name of the law in the core, one of `granular._core.laws`.

        It is composed of the elasticity and the flow rule.
        """
        return self.flow if self.elasticity == "hypoelastic" else f"hencky_{self.flow}"

    @property
    def K(self) -> float:  # the usual symbol
        """Bulk modulus E/(3 (1 - 2 nu)) [Pa]."""
        return self.E / (3.0 * (1.0 - 2.0 * self.nu))

    @property
    def G(self) -> float:
        """Shear modulus E/(2 (1 + nu)) [Pa]."""
        return self.E / (2.0 * (1.0 + self.nu))

    @property
    def wave_speed(self) -> float:
        """Speed of compression waves sqrt((K + 4G/3)/rho_c) [m/s]."""
        return math.sqrt((self.K + 4.0 * self.G / 3.0) / self.rho_c)

    @property
    def damping_time(self) -> float:
        """Ratio T of the viscosities of the elastic deformation to the moduli [s]; 0 is none.

        The viscous stress is T C : D_e, with the elastic tensor C and the elastic part D_e of the
        strain rate. T is the ratio c/k of the dashpot to the spring in a linear contact of the
        given restitution e: with the damping ratio zeta = -ln e/sqrt(pi^2 + ln^2 e) and the
        frequency omega of the contact without damping it is 2 zeta/omega. Grains of the diameter d
        in a cubic array have the mass rho_c d^3 and K = k/(3 d). Two of them have the reduced mass
        rho_c d^3/2, so that omega = sqrt(6 K/rho_c)/d and

        ``T = 2 zeta d sqrt(rho_c/(6 K))``.
        """
        if self.restitution == 1.0:
            return 0.0
        d = getattr(self, "d", None) if self.contact_diameter is None else self.contact_diameter
        assert d is not None  # checked above
        log = -math.log(self.restitution)
        zeta = log / math.hypot(math.pi, log)
        return 2.0 * zeta * d * math.sqrt(self.rho_c / (6.0 * self.K))

    @property
    def static_friction(self) -> float:
        """Friction tau/p at which the material begins to flow; infinite if that is not known."""
        return math.inf

    @property
    def yield_ratios(self) -> tuple[float, float]:
        """Least and largest ratio of horizontal to vertical stress at which it does not yield.

        With two equal horizontal stresses, K times the vertical one, tau/p is
        sqrt(3) abs(1 - K)/(1 + 2 K). Cohesion, with which the range is larger, is not included.
        Material that dilates is taken at its critical packing.
        """
        return self.yield_ratios_at(self.static_friction)

    @staticmethod
    def yield_ratios_at(friction: Any) -> tuple[Any, Any]:
        """`yield_ratios` of material that begins to flow at a friction, a number or an array."""
        root, mu = math.sqrt(3.0), np.asarray(friction, dtype=float)
        less, least = np.minimum(mu, root), np.minimum(mu, root / 2)
        with np.errstate(divide="ignore"):
            high = (root + least) / (root - 2 * least)
        return ((root - less) / (root + 2 * less))[()], high[()]

    @property
    def K0(self) -> float:
        """Ratio of horizontal to vertical stress of material that has settled by its weight alone.

        It is nu/(1 - nu), without any strain to the sides, or the least of `yield_ratios` if that
        is more: the material then yields as it settles.
        """
        return float(self.K0_at(self.static_friction))

    def K0_at(self, friction: Any) -> Any:
        """`K0` of material that begins to flow at a friction, a number or an array."""
        return np.maximum(self.nu / (1.0 - self.nu), self.yield_ratios_at(friction)[0])[()]

    def _repr_html_(self) -> str:
        rows = {name: value for name, value in self.arguments().items() if value is not None}
        rows |= {"K [Pa]": self.K, "G [Pa]": self.G, "wave speed [m/s]": self.wave_speed}
        return table(f"{type(self).__name__} ({self.law})", rows)
