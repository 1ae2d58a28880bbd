"""mu(I) rheology with a packing fraction that changes in flow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular.materials.base import Material
from granular.materials.laws import check_friction
from granular.tools.checks import check_fields, in_range, non_negative, positive, set_fields

LOOSER_BY = 0.055
"""Fall of the packing fraction from slow flow to fast flow if that of fast flow is not given."""

ATMOSPHERE = 101325.0
"""Pressure p_a of the atmosphere [Pa], as in csrc/law/dilatant.h."""

DENSEST_CRITICAL = 0.8
"""Largest critical packing under pressure, likewise."""


@dataclass(frozen=True, kw_only=True)
class DilatantMuI(Material):
    """Granular material that dilates or compacts in flow, towards a packing fraction of the rate.

    Every point has a packing fraction phi at which it would be free of stress; a `Fill` begins with
    its `packing`, or with phi_c (a `density` above packing rho_s presses it). With s = I/(I0 + I)
    and the inertial number I = shear_rate d sqrt(rho_s/p), flow at the rate gdot changes it by

    ``d ln(phi)/dt = -psi gdot``,  ``psi = dilatancy (phi - phi_eq(I))``,
    ``phi_eq(I) = phi_c - (phi_c - phi_fast) s``,

    and meets the friction

    ``tau/p = mu(I) + psi``,  ``mu(I) = mu_s + (mu_2 - mu_s) s``.

    psi is the tangent of the angle of dilation. Dense material, phi > phi_c, has a peak of the
    friction and dilates; loose material compacts, with less friction; after a shear of a few times
    1/dilatancy both are at phi_eq(I) and mu(I), the critical state. Material whose pressure has
    fallen to zero is free of stress, and keeps its phi, but for dense material that has opened by
    more than 0.02 of its volume: its grains have moved apart, and meet again at a packing that is
    lower by what is beyond that, or at phi_c.

    The dilatancy is that of Roux & Radjai 1998, the packing that of Pouliquen, Cassar, Jop,
    Forterre & Nicolas 2006 (J. Stat. Mech. P07020) where I is small, phi_c - (phi_c - phi_fast)
    I/I0, and the friction that of Pailha & Pouliquen 2009 (J. Fluid Mech. 633, 115), whose
    dissipation is mu(I) p gdot at any packing.

    Under pressure the critical packing may rise along a critical-state line in the void ratio
    e = 1/phi - 1 (Li & Wang 1998, J. Geotech. Geoenviron. Eng. 124, 1215),

    ``e_c(p) = 1/phi_c - 1 - csl_slope (p/p_a)^csl_exponent``,  ``p_a = 101325 Pa``,

    up to a packing of 0.8; it then stands for phi_c above, as `critical_packing`. `phi_fast` does
    not depend on the pressure.

    Parameters
    ----------
    E, nu, restitution, contact_diameter
        See `Material`.
    elasticity : {"hypoelastic"}
        Only this one is available. The pressure is that of the density with all schemes.
    rho_s : float
        Density of the grains themselves [kg/m3], > 0.
    phi_c : float
        Packing fraction of slow flow that goes on, 0.3 to 0.8: the critical state, with a line that
        of no pressure. It determines `rho_c` = phi_c rho_s, the density of a fill that has none.
    phi_fast : float, optional
        Packing fraction of flow with I much larger than I0, 0.2 to phi_c; phi_c - 0.055 if not
        given.
    dilatancy : float
        Tangent of the angle of dilation per packing fraction, 0 to 20: of sands 2.5 to 4.
    mu_s, mu_2 : float
        Friction coefficients of the critical state in slow and in fast flow, mu_2 > mu_s > 0.
    I0 : float
        Inertial number at which friction and packing are half way between the two, > 0.
    d : float
        Grain diameter [m], > 0.
    csl_slope : float
        Fall of the critical void ratio from no pressure to that of the atmosphere, >= 0; with 0 the
        critical packing does not depend on the pressure. 0.01 to 0.05 of sands.
    csl_exponent : float
        Power of the pressure with which it falls, 0.1 to 1: 0.6 to 0.8 of sands.

    Raises
    ------
    ValueError
        For values out of range.
    TypeError
        For arguments of a wrong type.
    """

    rho_c: float = None  # type: ignore[assignment]  # a float once made
    rho_s: float = 2650.0
    phi_c: float = 0.585
    phi_fast: float = None  # type: ignore[assignment]  # likewise
    dilatancy: float = 4.0
    mu_s: float = 0.3819
    mu_2: float = 0.6435
    I0: float = 0.279
    d: float = 0.001
    csl_slope: float = 0.0
    csl_exponent: float = 0.7

    flow = "dilatant_mu_I"
    dilates = True

    def __post_init__(self) -> None:
        check_fields(self, positive, "rho_s")
        check_fields(self, in_range, "phi_c", low=0.3, high=0.8)
        rho_c = self.phi_c * self.rho_s
        if self.rho_c is not None and self.rho_c != rho_c:
            raise ValueError(f"rho_c = {self.rho_c} must be phi_c rho_s = {rho_c}, or not be given")
        set_fields(self, rho_c=rho_c)
        super().__post_init__()
        if self.elasticity != "hypoelastic":
            raise ValueError(
                f'elasticity = {self.elasticity!r} must be "hypoelastic" with DilatantMuI'
            )
        set_fields(self, _given_fast=self.phi_fast is not None)
        if self.phi_fast is None:
            set_fields(self, phi_fast=round(self.phi_c - LOOSER_BY, 12))  # 0.53 for 0.585
        check_fields(self, in_range, "phi_fast", low=0.2, high=self.phi_c)
        check_fields(self, in_range, "dilatancy", low=0.0, high=20.0)
        check_friction(self, allow_inf=False)
        check_fields(self, positive, "I0", "d")
        check_fields(self, non_negative, "csl_slope")
        check_fields(self, in_range, "csl_exponent", low=0.1, high=1.0)
        positive("I0/(d sqrt(rho_s))", self.xi)

    def arguments(self) -> dict[str, Any]:
        """Arguments that make an equal material, without `rho_c` and a `phi_fast` not given, which
        follow from others."""
        derived = {"rho_c"} if self.__dict__["_given_fast"] else {"rho_c", "phi_fast"}
        return {name: value for name, value in super().arguments().items() if name not in derived}

    @property
    def static_friction(self) -> float:
        """Friction tau/p at which material at `phi_c` begins to flow, `mu_s`."""
        return self.mu_s

    @property
    def xi(self) -> float:
        """I0/(d sqrt(rho_s)) [sqrt(m/kg)], see `MuI`."""
        return self.I0 / (self.d * math.sqrt(self.rho_s))

    def friction(self, I: Any) -> Any:  # noqa: E741 (the usual symbol)
        """Friction mu of the critical state at inertial numbers >= 0, a number or an array."""
        return self.mu_s + (self.mu_2 - self.mu_s) * self._share(I)

    def critical_packing(self, pressure: Any = None) -> Any:
        """Packing fraction of the critical state at pressures >= 0 [Pa], a number or an array.

        It may be left out without a critical-state line, for `phi_c`.
        """
        if pressure is None:
            if self.csl_slope:
                raise ValueError(
                    f"pressure = None must be given with csl_slope = {self.csl_slope}, a critical "
                    "packing that depends on it"
                )
            return self.phi_c
        p = np.asarray(pressure, dtype=float)
        if not (p >= 0).all():
            raise ValueError(f"pressure = {pressure} must be >= 0")
        if not self.csl_slope:
            return np.full(p.shape, self.phi_c)[()]
        fall = self.csl_slope * (p / ATMOSPHERE) ** self.csl_exponent
        return (1.0 / np.maximum(1.0 / self.phi_c - fall, 1.0 / DENSEST_CRITICAL))[()]

    def packing(self, I: Any, pressure: Any = None) -> Any:  # noqa: E741
        """Packing fraction phi_eq of steady flow at inertial numbers >= 0 and pressures [Pa].

        `pressure` is needed with a critical-state line alone, see `critical_packing`.
        """
        critical = self.critical_packing(pressure)
        return critical - (critical - self.phi_fast) * self._share(I)

    def peak_friction(self, packing: Any, pressure: Any = None) -> Any:
        """Friction tau/p at which material of a packing fraction, or of an array, begins to flow.

        It is negative of material so loose that it has no friction. `pressure` [Pa] is needed with
        a critical-state line alone, see `critical_packing`.
        """
        fraction = np.asarray(packing, dtype=float)
        if not ((fraction >= 0) & (fraction <= 1)).all():
            raise ValueError(f"packing = {packing} must be from 0 to 1")
        return (self.mu_s + self.dilatancy * (fraction - self.critical_packing(pressure)))[()]

    def _share(self, I: Any) -> Any:  # noqa: E741
        inertial = np.asarray(I, dtype=float)
        if not (inertial >= 0).all():
            raise ValueError(f"I = {I} must be >= 0")
        return (inertial / (self.I0 + inertial))[()]
