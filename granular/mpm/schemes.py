"""Numerical schemes: shape functions, velocity transfer, density of the points, time step.

The numerical parameters of a scheme, with their defaults, ranges and descriptions, are declared in
the C core (`csrc/mpm/scheme.h`). The classes here are made from these declarations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, ClassVar

from granular import _core
from granular.mpm.scheme_numbers import (
    CellAveragedNumbers,
    FluidityNumbers,
    ParticleNumbers,
    SchemeNumbers,
    SmoothedNumbers,
)
from granular.tools.checks import kinds_of, non_negative, one_of, set_fields, truth
from granular.tools.notebook import table

if TYPE_CHECKING:
    from granular.materials import Material

__all__ = [
    "BASES",
    "DENSITIES",
    "PRECISIONS",
    "TRANSFERS",
    "CellAveragedDensity",
    "Fluidity",
    "ParticleDensity",
    "Scheme",
    "SmoothedDensity",
    "cell_averaged",
    "default",
    "dunatunga_kamrin_2015",
    "suited_to",
]

_ENUMERATIONS = _core.enumerations()

BASES = tuple(_ENUMERATIONS["basis"])
"""Names of the shape functions that a `Scheme` may have."""
TRANSFERS = tuple(_ENUMERATIONS["transfer"])
"""Names of the transfers of velocity that a `Scheme` may have."""
PRECISIONS = ("double", "single")
"""Names of the precisions that the kernels of a `Scheme` may have."""
IN_SINGLE = (("quadratic", "tpic", "smoothed"), ("quadratic", "apic", "particle"))
"""Basis, transfer and density of which there are kernels in single precision. With cell averages it
would save a tenth of the time in 2D, and change a flow as much as the size of the cells does."""
DIFFUSIONS = ("auto", *_ENUMERATIONS["diffusion"])
STENCILS = tuple(_ENUMERATIONS["stencil"])


@dataclass(frozen=True, kw_only=True)
class ParticleDensity(ParticleNumbers):
    """Density that each point integrates by itself, from its velocity gradient.

    This is the published scheme (Dunatunga & Kamrin 2015, eq. 3.9). In flows that vary in two or
    three dimensions points lose contact and layers compact.

    Parameters
    ----------
    {numbers}
    """

    name: ClassVar[str] = "particle"


@dataclass(frozen=True, kw_only=True)
class SmoothedDensity(SmoothedNumbers):
    """Density that is averaged over neighbours and relaxes to the nodal density.

    For quadratic B-splines with TPIC. Points are shifted away from over-compressed regions, and
    their quadrature weights are corrected so that a uniform pressure exerts no force.

    Parameters
    ----------
    {numbers}

    Notes
    -----
    Symbols: c = ln(rho/rho_c) of a point; c_w, the speed of compression waves; dx, the edge of a
    cell; L, the velocity gradient; phi_i = m_i/(V_i rho_c), the filling fraction of a node, which
    is its mass over that of its volume at rho_c; gdot, the plastic shear rate, for stress-free
    points the shear rate of L plus abs(tr L).
    """

    name: ClassVar[str] = "smoothed"


@dataclass(frozen=True, kw_only=True)
class CellAveragedDensity(CellAveragedNumbers):
    """Density that the points of a cell have in common, with their gradient and mean stress.

    For linear shape functions with TPIC. It relaxes to the filling fraction of the cell.

    Parameters
    ----------
    {numbers}

    Notes
    -----
    Symbols as in `SmoothedDensity`, but gdot is the shear rate of L plus abs(tr L) at all points.
    """

    name: ClassVar[str] = "cell_averaged"


DENSITIES = {kind.name: kind for kind in (ParticleDensity, SmoothedDensity, CellAveragedDensity)}
"""The densities by name."""

Density = ParticleDensity | SmoothedDensity | CellAveragedDensity


@dataclass(frozen=True, kw_only=True)
class Fluidity(FluidityNumbers):
    """Diffusion of the fluidity of a nonlocal law (`granular.NGF`); without one it has no effect.

    Parameters
    ----------
    stencil : {"faces", "isotropic"}
        Stencil of the Laplacian. "faces" takes a cell and its neighbours across faces; "isotropic"
        takes all 26 cells around it (8 in 2D), with an error that is the same in all directions, at
        several times the cost.
    method : {"auto", "explicit", "implicit", "rkl2"}
        "explicit" needs substeps shorter than dx^2 t0/(2 dim A^2 d^2) with "faces", and than 1.1 to
        2 times this with "isotropic" (`Simulation.fluidity` has the limit). "implicit" is backward
        Euler, solved by conjugate gradients; it makes no fluidity negative. "rkl2" is a
        Runge-Kutta-Legendre scheme of second order; it may undershoot, and steady flows depend on
        the number of substeps. "auto" is "explicit" if one substep is within that limit, otherwise
        "implicit".
    reconnect_fluidity : bool
        With Hencky elasticity: if True, points that reconnect begin with the fluidity
        sqrt(2) abs(D)/mu_2 (Haeri & Skonieczny 2021, eq. 23); if False, with 0.
    {numbers}
    {raises}.
    """

    method: str = "auto"
    stencil: str = "faces"
    reconnect_fluidity: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        one_of("method", self.method, DIFFUSIONS)
        one_of("stencil", self.stencil, STENCILS)
        truth("reconnect_fluidity", self.reconnect_fluidity)


@dataclass(frozen=True, kw_only=True)
class Scheme(SchemeNumbers):
    """A numerical scheme of the material point method; without arguments it is `default`.

    Parameters
    ----------
    basis : {"quadratic", "linear", "ugimp"}, optional
        Shape functions: quadratic B-splines, linear ones, or linear ones averaged over the domain
        of a point, whose half-width is half the initial point spacing ("ugimp"). By default the
        basis that `density` is made for, else "quadratic".
    transfer : {"tpic", "flip", "apic", "xpic"}, optional
        Transfer of velocity from the grid to the points (G2P): "flip" adds the change of the grid
        velocity, "xpic" removes the null space of "flip", "tpic" carries the velocity gradient of
        the point, "apic" its affine moment. By default "tpic" with quadratic B-splines or a
        cell-averaged density, else "flip".
    density : SmoothedDensity, CellAveragedDensity or ParticleDensity, optional
        Density of the points. By default `SmoothedDensity` with quadratic "tpic", the only
        combination it is made for, else `ParticleDensity`. `CellAveragedDensity` is made for linear
        "tpic".
    fluidity : Fluidity
        Options for the fluidity of a nonlocal law.
    precision : {"double", "single"}, optional
        Floating-point numbers that the kernels compute with and the points are stored in; positions
        are double in either case. "single" takes 0.5 to 0.75 of the time and 0.6 of the memory, and
        has rounding errors of 6e-8 in each step. For the default combination of basis, transfer and
        density, and for quadratic "apic"; not for elasticity = "hencky" and user-defined laws.
    {numbers}
    {raises}.
    """

    basis: str = None  # type: ignore[assignment]  # a name once made
    transfer: str = None  # type: ignore[assignment]  # likewise
    density: Density = None  # type: ignore[assignment]  # a density once made
    fluidity: Fluidity = Fluidity()
    precision: str = "double"

    def __post_init__(self) -> None:
        averaged = isinstance(self.density, CellAveragedDensity)
        basis = one_of("basis", self.basis or ("linear" if averaged else "quadratic"), BASES)
        transfer = one_of(
            "transfer",
            self.transfer or ("tpic" if averaged or basis == "quadratic" else "flip"),
            TRANSFERS,
        )
        smooth = (basis, transfer) == ("quadratic", "tpic")
        density = self.density or (SmoothedDensity() if smooth else ParticleDensity())
        if not isinstance(density, Density):
            raise TypeError(
                f"density = {density!r} must be a SmoothedDensity, a CellAveragedDensity or a "
                "ParticleDensity"
            )
        kinds_of(self, fluidity=Fluidity)
        one_of("precision", self.precision, PRECISIONS)
        set_fields(self, basis=basis, transfer=transfer, density=density)
        if self.tpic_decay is None:
            set_fields(self, tpic_decay=0.2 if averaged else 0.03)
        super().__post_init__()
        self._check_fit()

    def _check_fit(self) -> None:
        """Refuse a density that the basis and transfer are not made for."""
        made_for = {"smoothed": "quadratic", "cell_averaged": "linear"}
        basis = made_for.get(self.density.name)
        if basis is not None and (self.basis, self.transfer) != (basis, "tpic"):
            raise ValueError(
                f'density = {type(self.density).__name__}() needs basis = "{basis}" and '
                f'transfer = "tpic", not {self.basis!r} and {self.transfer!r}; choose '
                "ParticleDensity()"
            )
        kind = self.basis, self.transfer, self.density.name
        if self.precision == "single" and kind not in IN_SINGLE:
            raise ValueError(
                f'precision = "single" must be "double" with basis = {kind[0]!r}, transfer = '
                f"{kind[1]!r} and {type(self.density).__name__}()"
            )
        if self.transfer == "xpic" and self.sleep_speed:
            raise ValueError(f'sleep_speed = {self.sleep_speed} must be 0 with transfer = "xpic"')
        if self.transfer != "flip" and self.flip_decay:
            raise ValueError(
                f"flip_decay = {self.flip_decay} must be 0 with transfer = {self.transfer!r}"
            )

    def _repr_html_(self) -> str:
        rows = {f.name: getattr(self, f.name) for f in fields(self)}
        first = {name: rows.pop(name) for name in ("basis", "transfer", "density")}
        return table("Scheme", first | rows)


dunatunga_kamrin_2015 = Scheme(basis="linear", transfer="flip", dt=3e-6)
"""Scheme of Dunatunga & Kamrin 2015 (section 3, table 2): linear shape functions, FLIP, the density
of each particle by itself, fixed dt = 3e-6 s."""

default = Scheme()
"""Quadratic B-splines, TPIC, smoothed density; it remains accurate in two-dimensional shear."""

cell_averaged = Scheme(density=CellAveragedDensity())
"""Linear shape functions, TPIC, cell-averaged density; as accurate in such shear at a lower
cost."""


def suited_to(*materials: Material, cell: float = 0.0) -> Scheme:
    """Return the scheme of a scene that names none.

    That is `cell_averaged` for a nonlocal law whose friction has a limit, if it is the only
    material, else `default`. With quadratic shape functions the friction of such a law scatters
    within a cell, and flows near the limit are too fast (docs/reports/external.md).

    Parameters
    ----------
    *materials : Material
        All materials of the scene.
    cell : float
        Size of the cells [m]. Where the length `A` d of the law is at most a tenth of it, the law
        is practically local, and suited to `default`.
    """
    cell = non_negative("cell", cell)
    alone = materials[0] if len(materials) == 1 else None
    if alone is None or not getattr(alone, "has_fluidity", False) or alone.is_local(cell):
        return default
    limit = getattr(alone, "limiting_friction", math.inf)
    return cell_averaged if math.isfinite(limit) else default
