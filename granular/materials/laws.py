"""Materials with the constitutive laws of the core: their parameters, immutable and checked.

Attributes have the names of the parameters of the law in the C core (`law`), so that the parameter
list of a law can be filled from a material by name.
"""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass
from typing import TYPE_CHECKING, Any, Self

from granular.materials.base import Material
from granular.tools.checks import (
    check_fields,
    finite,
    in_range,
    non_negative,
    one_of,
    positive,
    set_fields,
)

if TYPE_CHECKING:
    from granular.materials.dilatant import DilatantMuI
    from granular.materials.regularised import RegularisedMuI


SHORT_LENGTH = 0.1
"""Length A d of a nonlocal law, over the cell, up to which it acts as the local one: diffusion
leaves each point its own fluidity, and layers of 28 degrees are as fast to 0.2 %."""


def _check_grain_density(
    material: MuI | RegularisedMuI | DilatantMuI | NGF | DruckerPrager | HardeningDruckerPrager,
) -> None:
    check_fields(material, positive, "rho_s")
    if material.rho_s < material.rho_c:
        raise ValueError(f"rho_c = {material.rho_c} must not exceed rho_s = {material.rho_s}")


def _check_cohesion(material: MuI | DruckerPrager, mu: float) -> None:
    """Check the cohesion, and make the tensile strength that of the apex of the cone if not given.

    The field `_given_strength` records whether it was given.
    """
    check_fields(material, non_negative, "cohesion")
    if material.cohesion and material.elasticity == "hencky":
        raise ValueError(
            f'cohesion = {material.cohesion} must be 0 with elasticity = "hencky": only '
            '"hypoelastic" has it'
        )
    apex = material.cohesion / mu
    set_fields(material, _given_strength=material.tensile_strength is not None)
    if material.tensile_strength is None:
        set_fields(material, tensile_strength=apex)
        return
    check_fields(material, non_negative, "tensile_strength")
    if material.tensile_strength > apex:
        raise ValueError(
            f"tensile_strength = {material.tensile_strength} must not exceed that of the yield "
            f"cone, cohesion/mu = {apex:.6g}"
        )


def _without_derived_strength(
    material: MuI | DruckerPrager, arguments: dict[str, Any]
) -> dict[str, Any]:
    """Return the arguments without a tensile strength that follows from the cohesion."""
    if not material.__dict__["_given_strength"]:
        del arguments["tensile_strength"]
    return arguments


def check_friction(material: MuI | RegularisedMuI | DilatantMuI | NGF, *, allow_inf: bool) -> None:
    """Check the coefficients of a friction that rises with the rate, and the grain density."""
    check_fields(material, positive, "mu_s")
    check_fields(material, positive, "mu_2", allow_inf=allow_inf)
    if material.mu_2 <= material.mu_s:
        raise ValueError(f"mu_2 = {material.mu_2} must exceed mu_s = {material.mu_s}")
    _check_grain_density(material)


MU_2 = 0.6435
"""Limiting friction coefficient of glass beads (Jop, Forterre & Pouliquen 2005)."""


def friction_of(phi_deg: float) -> float:
    """Friction coefficient tan(phi_deg) of an angle [deg]."""
    ends = {"open_low": True, "open_high": True}
    return math.tan(math.radians(in_range("phi_deg", phi_deg, 0.0, 60.0, **ends)))


@dataclass(frozen=True, kw_only=True)
class MuI(Material):
    """Granular material with the mu(I) rheology (Dunatunga & Kamrin 2015, eqs 2.13-2.15).

    mu = mu_s + (mu_2 - mu_s)/(I0/I + 1) with I = shear_rate d sqrt(rho_s/p). Only the group
    xi = I0/(d sqrt(rho_s)) enters the law. Give either `xi`, or both `I0` and `d`.

    With a cohesion, tau = cohesion + mu(I) p in flow (Gans et al. 2023, J. Fluid Mech. 959, A41).
    In tension, where there is no inertial number, tau = cohesion + mu_s p at every rate.

    Parameters
    ----------
    E, nu, rho_c, elasticity, restitution, contact_diameter
        See `Material`.
    mu_s : float
        Static friction coefficient, > 0.
    mu_2 : float, optional
        Limiting friction coefficient, > mu_s; 0.6435 if not given, or mu_s + 0.2616 with `phi_deg`.
    phi_deg : float, optional
        Friction angle [deg], above 0 and below 60, instead of mu_s = tan(phi_deg): the angle of
        repose, and that of a slope at which a layer begins to flow.
    rho_s : float
        Density of the grains themselves [kg/m3], >= rho_c.
    xi : float, optional
        I0/(d sqrt(rho_s)) [sqrt(m/kg)], > 0; 1.1233 if neither it nor `I0` and `d` are given.
    I0 : float, optional
        Reference inertial number, > 0; stays None if `xi` is given.
    d : float, optional
        Grain diameter [m], > 0; stays None if `xi` is given. Quantities that depend on the size
        of the grains (the inertial number itself, packing fractions) are then undefined.
    cohesion : float
        Shear stress at yield without pressure [Pa], >= 0; more than 0 for hypoelasticity alone. In
        plane strain it is c cos(phi) of the cohesion c and the angle sin(phi) = mu of Mohr and
        Coulomb (`granular.theory.cliff_height`).
    tensile_strength : float, optional
        Tension -p at which the material separates [Pa], 0 to cohesion/mu_s, where the yield stress
        is 0. The latter if not given. Separated material is stress-free until its density is rho_c
        again; then it coheres as before. A `Scene` needs it to be less than `separation_strain` K.

    Raises
    ------
    ValueError
        For values out of range, `xi` together with `I0` or `d`, or only one of `I0` and `d`.
    TypeError
        For arguments of a wrong type.
    """

    mu_s: float = 0.3819
    mu_2: float = None  # type: ignore[assignment]  # a float once made
    rho_s: float = 2450.0
    xi: float = None  # type: ignore[assignment]  # a float once made
    I0: float | None = None
    d: float | None = None
    cohesion: float = 0.0
    tensile_strength: float = None  # type: ignore[assignment]  # a float once made
    phi_deg: InitVar[float | None] = None

    flow = "mu_I"

    def __post_init__(self, phi_deg: float | None) -> None:
        super().__post_init__()
        usual = MU_2
        if phi_deg is not None:
            set_fields(self, mu_s=friction_of(phi_deg))
            usual = self.mu_s + MU_2 - MuI.mu_s
        if self.mu_2 is None:
            set_fields(self, mu_2=usual)
        check_friction(self, allow_inf=False)
        _check_cohesion(self, self.mu_s)
        if self.I0 is None and self.d is None:
            set_fields(self, xi=1.1233 if self.xi is None else positive("xi", self.xi))
            return
        if self.xi is not None:
            raise ValueError(f"xi = {self.xi} must not be given together with I0 or d")
        if self.I0 is None or self.d is None:
            raise ValueError(f"I0 = {self.I0} and d = {self.d} must be given together")
        check_fields(self, positive, "I0", "d")
        xi = self.I0 / (self.d * math.sqrt(self.rho_s))
        set_fields(self, xi=positive("I0/(d sqrt(rho_s))", xi))

    @property
    def static_friction(self) -> float:
        """Friction tau/p at which the material begins to flow, `mu_s`."""
        return self.mu_s

    def arguments(self) -> dict[str, Any]:
        """Arguments that make an equal material: `xi`, or `I0` and `d`, as they were given."""
        derived = ("I0", "d") if self.I0 is None else ("xi",)
        given = {name: v for name, v in super().arguments().items() if name not in derived}
        return _without_derived_strength(self, given)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some arguments changed; `xi` replaces `I0` and `d`, and vice versa."""
        arguments = self.arguments()
        if changes.get("xi") is not None:
            arguments = {name: v for name, v in arguments.items() if name not in ("I0", "d")}
        elif changes.get("I0") is not None and changes.get("d") is not None:
            arguments.pop("xi", None)
        return type(self)(**(arguments | changes))


@dataclass(frozen=True, kw_only=True)
class NGF(Material):
    """Nonlocal granular fluidity, a rheology in which the size of the grains matters.

    The shear rate is g mu, and the fluidity g obeys (Dunatunga & Kamrin, "Modeling silo clogging
    with nonlocal granular rheology", eqs 2.1 and 2.2)

    ``t0 dg/dt = A^2 d^2 lap g - dmu (mu_s - mu)/(mu_2 - mu) g - b sqrt(rho_s d^2/p) mu g^2``

    with dmu = mu_2 - mu_s and b = dmu/I0. Without the first term this is, in steady flow, the law
    of `MuI`. `granular.mpm.schemes.Fluidity` has the options of the diffusion of g.

    Parameters
    ----------
    E, nu, rho_c, elasticity, restitution, contact_diameter
        See `Material`.
    A : float
        Nonlocal amplitude, >= 0; with 0 the law is local, as `MuI` or mu = mu_s + b I, and has
        no fluidity.
    d : float
        Grain diameter [m], > 0.
    t0 : float
        Time scale of the fluidity [s], > 0.
    mu_s : float
        Static friction coefficient, > 0.
    mu_2 : float
        Limiting friction coefficient, > mu_s; may be ``math.inf`` if `b` is given.
    rho_s : float
        Density of the grains themselves [kg/m3], >= rho_c.
    I0 : float, optional
        Reference inertial number, > 0; 0.279 if neither it nor `b` is given.
    b : float, optional
        Slope of mu(I) at I = 0, (mu_2 - mu_s)/I0, > 0; may be given instead of `I0`.
    rheology : {"mu_I", "linear_mu_I"}
        "linear_mu_I" is mu = mu_s + b I without an upper limit, with the local terms
        ``-(mu_s - mu) g - b sqrt(rho_s d^2/p) mu g^2`` in the equation of the fluidity (Haeri &
        Skonieczny 2021, eqs 5 and 6); for Hencky elasticity alone.

    Raises
    ------
    ValueError
        For values out of range, `I0` together with `b`, an infinite `mu_2` without `b`, or
        "linear_mu_I" without Hencky elasticity.
    TypeError
        For arguments of a wrong type.
    """

    A: float = 0.48
    d: float = 0.005
    t0: float = 1e-3
    mu_s: float = 0.3819
    mu_2: float = 0.6435
    rho_s: float = 2450.0
    I0: float = None  # type: ignore[assignment]  # a float once made
    b: float = None  # type: ignore[assignment]  # likewise
    rheology: str = "mu_I"

    def __post_init__(self) -> None:
        super().__post_init__()
        if one_of("rheology", self.rheology, ("mu_I", "linear_mu_I")) == "linear_mu_I" and (
            self.elasticity != "hencky"
        ):
            raise ValueError('rheology = "linear_mu_I" must go with elasticity = "hencky"')
        check_fields(self, non_negative, "A")
        check_fields(self, positive, "d", "t0")
        check_friction(self, allow_inf=True)
        if self.I0 is not None and self.b is not None:
            raise ValueError(f"I0 = {self.I0} must not be given together with b = {self.b}")
        set_fields(self, _by_b=self.b is not None)
        if self._by_b:
            check_fields(self, positive, "b")
            set_fields(self, I0=(self.mu_2 - self.mu_s) / self.b)
            return
        if math.isinf(self.mu_2):
            raise ValueError("mu_2 = inf must go with b, the slope of mu(I) at rest")
        set_fields(self, I0=0.279 if self.I0 is None else positive("I0", self.I0))
        set_fields(self, b=(self.mu_2 - self.mu_s) / self.I0)

    @property
    def has_fluidity(self) -> bool:  # type: ignore[override]  # else of the class
        """True if the nonlocal amplitude `A` is not 0."""
        return self.A > 0

    def is_local(self, cell: float) -> bool:
        """True if the law acts as a local one in cells of this size [m], 10 `A` d or more."""
        return self.A * self.d <= SHORT_LENGTH * cell

    @property
    def flow(self) -> str:  # type: ignore[override]  # else of the class
        """Flow rule, by its name in the core; with `A` = 0 that of the local law."""
        if self.rheology == "linear_mu_I":
            return "linear_ngf" if self.A else "linear_mu_I"
        return "ngf" if self.A else "mu_I"

    @property
    def limiting_friction(self) -> float:
        """Friction that the law never exceeds: `mu_2`, or infinite with "linear_mu_I"."""
        return math.inf if self.rheology == "linear_mu_I" else self.mu_2

    @property
    def static_friction(self) -> float:
        """Friction tau/p at which the material begins to flow, `mu_s`."""
        return self.mu_s

    @property
    def xi(self) -> float:
        """I0/(d sqrt(rho_s)) [sqrt(m/kg)] of the local law, see `MuI`."""
        return self.I0 / (self.d * math.sqrt(self.rho_s))

    def core_friction(self) -> dict[str, float]:
        """mu_2, I0 and xi as the core needs them: finite, with mu_2 limited to 1e6."""
        mu_2 = min(self.mu_2, LARGEST_MU_2)
        I0 = self.I0 if mu_2 == self.mu_2 else (mu_2 - self.mu_s) / self.b
        return {"mu_2": mu_2, "I0": I0, "xi": I0 / (self.d * math.sqrt(self.rho_s))}

    def arguments(self) -> dict[str, Any]:
        """Arguments that make an equal material: `b` or `I0`, as it was given."""
        derived = "I0" if self.__dict__["_by_b"] else "b"
        return {name: v for name, v in super().arguments().items() if name != derived}

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some arguments changed; `b` replaces `I0`, and vice versa."""
        arguments = self.arguments()
        for name, other in (("I0", "b"), ("b", "I0")):
            if changes.get(name) is not None:
                arguments.pop(other, None)
        return type(self)(**(arguments | changes))


LARGEST_MU_2 = 1e6
"""Value used for an infinite mu_2: where the friction is below 10, mu(I) errs by less than 1e-5."""


@dataclass(frozen=True, kw_only=True)
class DruckerPrager(Material):
    """Rate-independent friction and cohesion: tau <= cohesion + mu p (Drucker & Prager 1952).

    Disconnected material is stress-free.

    Parameters
    ----------
    E, nu, rho_c, elasticity, restitution, contact_diameter
        See `Material`.
    mu : float
        Friction coefficient, > 0.
    phi_deg : float, optional
        Friction angle [deg], above 0 and below 60, instead of mu = tan(phi_deg): that of a shear
        band, and of a slope. In uniform plane strain the angle is larger: sin(phi) = mu.
    rho_s : float
        Density of the grains themselves [kg/m3], >= rho_c.
    cohesion : float
        Shear stress at yield without pressure [Pa], >= 0; more than 0 for hypoelasticity alone. In
        plane strain it is c cos(phi) of the cohesion c and the angle sin(phi) = mu of Mohr and
        Coulomb (`granular.theory.cliff_height`).
    tensile_strength : float, optional
        Tension -p at which the material separates [Pa], 0 to cohesion/mu, where the yield stress
        is 0. The latter if not given. Separated material is stress-free until its density is rho_c
        again; then it coheres as before. A `Scene` needs it to be less than `separation_strain` K.
    {raises}.
    """

    mu: float = 0.3819
    rho_s: float = 2450.0
    cohesion: float = 0.0
    tensile_strength: float = None  # type: ignore[assignment]  # a float once made
    phi_deg: InitVar[float | None] = None

    flow = "drucker_prager"

    def __post_init__(self, phi_deg: float | None) -> None:
        super().__post_init__()
        if phi_deg is not None:
            set_fields(self, mu=friction_of(phi_deg))
        check_fields(self, positive, "mu")
        _check_cohesion(self, self.mu)
        _check_grain_density(self)

    @property
    def static_friction(self) -> float:
        """Friction tau/p at which the material begins to flow, `mu`."""
        return self.mu

    def arguments(self) -> dict[str, Any]:
        """Arguments that make an equal material; a tensile strength only if it was given."""
        return _without_derived_strength(self, super().arguments())


@dataclass(frozen=True, kw_only=True)
class HardeningDruckerPrager(Material):
    """Friction that changes with the plastic strain (Klar et al. 2016, section 7.3).

    The friction angle is ``phi = h0 + (h1 q - h3) exp(-h2 q)``, where q is the norm of the plastic
    strain accumulated along the path of a point (field `plastic_strain`). The yield condition is
    ``tau <= mu p`` with ``mu = 2 sqrt(3) sin(phi)/(3 - sin(phi))``, the cone through triaxial
    compression at the angle phi. phi goes from h0 - h3 at the start to h0, by way of a peak at
    q = 1/h2 + h3/h1. Disconnected material keeps its q. The flow is isochoric, as in all laws here.

    Parameters
    ----------
    E, nu, rho_c, restitution, contact_diameter
        See `Material`.
    elasticity : {"hencky"}
        Required, because the plastic strain is one of finite strain.
    h0_deg, h1_deg, h3_deg : float
        Angles [degrees], such that 0 < phi < 90 for every q >= 0.
    h2 : float
        Rate at which phi approaches h0, > 0.
    rho_s : float
        Density of the grains themselves [kg/m3], >= rho_c.
    {raises}.
    """

    elasticity: str = "hencky"
    h0_deg: float = 35.0
    h1_deg: float = 9.0
    h2: float = 0.2
    h3_deg: float = 10.0
    rho_s: float = 2450.0

    flow = "hardening_drucker_prager"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.elasticity != "hencky":
            raise ValueError(f'elasticity = {self.elasticity!r} must be "hencky" with hardening')
        check_fields(self, finite, "h0_deg", "h1_deg", "h3_deg")
        check_fields(self, positive, "h2")
        _check_grain_density(self)
        angles = self._extreme_angles()
        if not (min(angles) > 0.0 and max(angles) < 90.0):
            raise ValueError(
                f"h0_deg = {self.h0_deg}, h1_deg = {self.h1_deg}, h2 = {self.h2}, h3_deg = "
                f"{self.h3_deg} make friction angles of {min(angles):.6g} to {max(angles):.6g} "
                "deg, must be in (0, 90)"
            )

    def _extreme_angles(self) -> list[float]:
        """Friction angles [degrees] at the start, in the limit and at the peak or trough."""
        strains = [0.0, math.inf]
        if self.h1_deg:
            strains.append(max(0.0, 1.0 / self.h2 + self.h3_deg / self.h1_deg))
        return [self.friction_angle_deg(q) for q in strains]

    @property
    def static_friction(self) -> float:
        """Friction tau/p at which the material begins to flow, without any plastic strain."""
        return _cone_friction(self.friction_angle_deg(0.0))

    @property
    def limiting_friction(self) -> float:
        """Friction tau/p that the law never exceeds, from its largest friction angle."""
        return _cone_friction(max(self._extreme_angles()))

    def friction_angle_deg(self, plastic_strain: float) -> float:
        """Friction angle [degrees] after a plastic strain >= 0."""
        decay = math.exp(-self.h2 * plastic_strain)
        gain = self.h1_deg * plastic_strain - self.h3_deg if decay else 0.0
        return self.h0_deg + gain * decay


def _cone_friction(angle_deg: float) -> float:
    """Friction tau/p of the cone through the compressive edges of a friction angle."""
    sine = math.sin(math.radians(angle_deg))
    return 2 * math.sqrt(3) * sine / (3 - sine)


@dataclass(frozen=True, kw_only=True)
class Elastic(Material):
    """Isotropic elastic solid, which also bears tension.

    Parameters
    ----------
    E, nu, rho_c, elasticity, restitution, contact_diameter
        See `Material`; `rho_c` is the density of the unstressed solid.
    {raises}.
    """

    flow = "elastic"
    granular = False
