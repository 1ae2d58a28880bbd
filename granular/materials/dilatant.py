"""mu(I) rheology with a packing fraction that changes in flow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from granular.materials.base import Material
from granular.materials.laws import check_friction
from granular.tools.checks import check_fields, in_range, positive, set_fields


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

    Parameters
    ----------
    E, nu, restitution, contact_diameter
        See `Material`.
    elasticity : {"hypoelastic"}
        Only this one is available. The pressure is that of the density with all schemes.
    rho_s : float
        Density of the grains themselves [kg/m3], > 0.
    phi_c : float
        Packing fraction of slow flow that goes on, 0.3 to 0.8: the critical state. It determines
        `rho_c` = phi_c rho_s, the density of a fill that has none.
    phi_fast : float
        Packing fraction of flow with I much larger than I0, 0.3 to phi_c.
    dilatancy : float
        Tangent of the angle of dilation per packing fraction, 0 to 20: of sands 2.5 to 4.
    mu_s, mu_2 : float
        Friction coefficients of the critical state in slow and in fast flow, mu_2 > mu_s > 0.
    I0 : float
        Inertial number at which friction and packing are half way between the two, > 0.
    d : float
        Grain diameter [m], > 0.

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
    phi_fast: float = 0.53
    dilatancy: float = 4.0
    mu_s: float = 0.3819
    mu_2: float = 0.6435
    I0: float = 0.279
    d: float = 0.001

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
        check_fields(self, in_range, "phi_fast", low=0.3, high=self.phi_c)
        check_fields(self, in_range, "dilatancy", low=0.0, high=20.0)
        check_friction(self, allow_inf=False)
        check_fields(self, positive, "I0", "d")
        positive("I0/(d sqrt(rho_s))", self.xi)

    def arguments(self) -> dict[str, Any]:
        """Arguments that make an equal material, without `rho_c`, which follows from others."""
        return {name: value for name, value in super().arguments().items() if name != "rho_c"}

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

    def packing(self, I: Any) -> Any:  # noqa: E741
        """Packing fraction phi_eq of the critical state at inertial numbers >= 0."""
        return self.phi_c - (self.phi_c - self.phi_fast) * self._share(I)

    def peak_friction(self, packing: Any) -> Any:
        """Friction tau/p at which material of a packing fraction, or of an array, begins to flow.

        It is negative of material so loose that it has no friction.
        """
        fraction = np.asarray(packing, dtype=float)
        if not ((fraction >= 0) & (fraction <= 1)).all():
            raise ValueError(f"packing = {packing} must be from 0 to 1")
        return (self.mu_s + self.dilatancy * (fraction - self.phi_c))[()]

    def _share(self, I: Any) -> Any:  # noqa: E741
        inertial = np.asarray(I, dtype=float)
        if not (inertial >= 0).all():
            raise ValueError(f"I = {I} must be >= 0")
        return (inertial / (self.I0 + inertial))[()]
