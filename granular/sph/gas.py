"""A gas in the pores of a granular material and above it (Hurley, thesis, section 6.2.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from granular.model import seeding
from granular.model.fill import Fill, check_inside
from granular.model.grid import Grid
from granular.model.inflow import Inflow
from granular.shapes import Box
from granular.tools.arrays import Array, IntArray
from granular.tools.checks import check_fields, in_range, kinds_of, positive, tuple_of, vector
from granular.tools.description import Description
from granular.tools.notebook import table

MAX_JETS = 16
"""Largest number of jets of a gas, by the capacity of the core."""
ERGUN = 150.0
"""Factor of the viscous part of Ergun's equation, k = e^3 d^2/(150 (1 - e)^2) (Ergun 1952)."""
POSITIVE = ("pressure", "viscosity", "permeability", "grain_density")
SOUND_SPEED = (1e-3, 1e6)
"""Range of the speed of sound of a gas [m/s], wide, but so that its square is finite."""
RANGES = {
    "sound_speed": SOUND_SPEED,
    "darcy_porosity": (0.05, 0.95),
    "blend": (1e-6, 0.5),
    "damping": (0.0, 2.0),
    "diffusion": (0.0, 0.5),
}
"""Numbers of a gas that are positive, and those in a range; the core has them by the same names."""
DENSEST, MOST_VISCOUS = 200.0, 1e-4
"""Density [kg/m3] and viscosity [Pa s] above which a fluid is a liquid and no ideal gas: air has
200 kg/m3 at 20 MPa, liquids 400 and more; gases have 1e-6 to 8e-5 Pa s, liquids 2e-4 and more."""
WIDEST_SPACING = 1.0
"""Largest spacing of gas particles, in smoothing lengths of the kernel."""


def check_fluid(name: str, value: float, limit: float, unit: str) -> None:
    """Raise if a number is that of a liquid, which p = c^2 rho does not describe."""
    if value > limit:
        raise ValueError(
            f"{name} = {value:.4g} {unit} must be at most {limit:g}: this is a liquid, and the "
            "fluid in the pores is an ideal gas, p = c^2 rho, without the pressure at rest, the "
            "buoyancy and the stiffness of a liquid"
        )


@dataclass(frozen=True)
class Jet(Description):
    """A box in which gas is driven: gas particles have this velocity while they are in it.

    The momentum that the jet adds to the gas is not balanced by a reaction on other parts.

    Parameters
    ----------
    region : Box
    velocity : tuple of float, length dim
        Velocity of the gas in it [m/s]; not 0 with a `density`.
    density : float or None
        Density of gas that enters at the upstream end of the box with this velocity [kg/m3], as by
        a driven `granular.Inflow`; None for no inflow; the jet then draws gas from its sides.
    {raises}.
    """

    region: Box
    velocity: tuple[float, ...]
    density: float | None = None

    def __post_init__(self) -> None:
        kinds_of(self, region=Box)
        check_fields(self, vector, "velocity", dim=self.region.dim)
        check_fields(self, positive, "density", optional=True)
        check_fluid("density", self.density or 0.0, DENSEST, "kg/m3")
        if self.density is not None and not any(self.velocity):
            raise ValueError(
                f"velocity = {self.velocity} must not be 0 with density = {self.density}: nothing "
                "would enter"
            )


@dataclass(frozen=True, kw_only=True)
class Gas(Description):
    """An ideal isothermal gas, p = c^2 rho, with drag by the grains; the numbers of a liquid are
    refused.

    With e the porosity, 1 - (bulk density of the grains)/`grain_density`, the balances of both
    phases are as in Anderson and Jackson (1967) with a common pressure,

        (1 - e) rho_s D v_s = div sigma - (1 - e) grad p + (1 - e) rho_s g + B (v_g - v_s)
              e rho_g D v_g =           -      e grad p +       e rho_g g - B (v_g - v_s),

    with sigma the effective stress of the grains as without gas, and rho_s = `grain_density`; the
    gas particles carry e rho_g. Up to the porosity `darcy_porosity` the drag follows Darcy, B = e^2
    eta/k, and beyond a range `blend` above it Wen and Yu (1966), B = (3/4) C_D e (1 - e) rho_g |v_g
    - v_s|/d e^-2.65 with C_D = 24/Re (1 + 0.15 Re^0.687), 0.44 from Re = 1000 on, and Re = e rho_g
    |v_g - v_s| d/eta; in between there is a cubic blend. The thesis names both regimes and the
    switch, but gives no equation. Viscous stresses in the free gas are left out: at the spacings of
    a scene they are far below the artificial ones.

    Parameters
    ----------
    fills : sequence of Fill
        Gas at the start, at least one fill, not lithostatic. Their `density` is that of the gas
        itself, not per volume with grains [kg/m3]; by default pressure/sound_speed^2. The smoothing
        length of the scene must be 1 to 2 spacings of their particles.
    pressure : float
        Ambient pressure [Pa], > 0; it acts on free surfaces of the gas.
    sound_speed : float
        Isothermal speed of sound c = sqrt(R T) [m/s], 1e-3 to 1e6. The density that follows,
        pressure/sound_speed^2, is at most 200 kg/m3, as are those of fills and jets.
    viscosity : float
        eta [Pa s], > 0, at most 1e-4.
    permeability : float
        k [m2], > 0.
    grain_density : float
        Density of the solid of the grains [kg/m3], above rho0 of the material.
    darcy_porosity : float
        Porosity up to which the drag follows Darcy's law, 0.05 to 0.95; the thesis takes 0.38.
    blend : float
        Range of porosity in which the drag changes to Wen and Yu's, 1e-6 to 0.5.
    diameter : float or None
        Diameter of a grain [m], > 0; None for the diameter that gives this permeability at rho0 by
        Ergun's equation.
    damping : float
        Factor alpha of the artificial viscosity of Monaghan (1992) between gas particles that
        approach each other, 0 to 2.
    diffusion : float
        Factor psi of an exchange of mass between gas particles, 0 to 0.5. It smooths pressures that
        differ from particle to particle, and vanishes for a constant pressure gradient.
    jets : sequence of Jet
        Boxes in which the gas is driven, at most 16.
    {raises}.
    """

    fills: tuple[Fill, ...]
    pressure: float = 1e5
    sound_speed: float = 300.0
    viscosity: float = 1e-5
    permeability: float = 2e-10
    grain_density: float = 2500.0
    darcy_porosity: float = 0.38
    blend: float = 0.04
    diameter: float | None = None
    damping: float = 0.5
    diffusion: float = 0.02
    jets: tuple[Jet, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self, tuple_of, "fills", kinds=(Fill,))
        check_fields(self, tuple_of, "jets", kinds=(Jet,))
        check_fields(self, positive, *POSITIVE)
        for name, (low, high) in RANGES.items():
            check_fields(self, in_range, name, low=low, high=high)
        check_fields(self, positive, "diameter", optional=True)
        if not self.fills:
            raise ValueError("fills = () must hold at least one Fill")
        check_fluid("pressure/sound_speed^2", self.density, DENSEST, "kg/m3")
        check_fluid("viscosity", self.viscosity, MOST_VISCOUS, "Pa s")
        for i, fill in enumerate(self.fills):
            check_fluid(f"fills[{i}].density", fill.density or 0.0, DENSEST, "kg/m3")
        if len(self.jets) > MAX_JETS:
            raise ValueError(f"jets holds {len(self.jets)}, must hold at most {MAX_JETS}")

    @property
    def density(self) -> float:
        """Ambient density [kg/m3], pressure/sound_speed^2."""
        return self.pressure / self.sound_speed**2

    def porosity(self, rho: float) -> float:
        """Volume fraction of the gas where the grains have the bulk density `rho` [kg/m3]."""
        return 1.0 - rho / self.grain_density

    def grain_diameter(self, rho0: float) -> float:
        """Diameter of a grain [m]: `diameter`, or d = sqrt(150 k (1 - e)^2/e^3) at rho0."""
        if self.diameter is not None:
            return self.diameter
        e = self.porosity(rho0)
        return math.sqrt(ERGUN * self.permeability * (1.0 - e) ** 2 / e**3)

    def diffusivity(self, rho: float) -> float:
        """Diffusivity of the pressure in the pores of grains at rest [m2/s], k p/(e eta).

        It follows from e d rho_g/dt + div(rho_g q) = 0 with Darcy's q = -(k/eta) grad p and
        p = c^2 rho_g, linearised for small changes of p.
        """
        return self.permeability * self.pressure / (self.porosity(rho) * self.viscosity)

    def check(self, grid: Grid, rho0: float, h: float) -> None:
        """Raise if the gas does not fit a grid, a density [kg/m3], or the smoothing length [m]."""
        if self.grain_density <= rho0:
            raise ValueError(
                f"grain_density = {self.grain_density} must exceed rho0 = {rho0} of the material"
            )
        for i, fill in enumerate(self.fills):
            check_inside(f"gas.fills[{i}]", grid, fill.region)
            spacing = grid.cell / fill.points_per_axis
            if fill.lithostatic:
                raise ValueError(f"gas.fills[{i}] must have no weight on it")
            if h < spacing * WIDEST_SPACING or h > 2.0 * spacing * (1.0 + 1e-9):
                raise ValueError(
                    f"gas.fills[{i}]: the smoothing length {h:.4g} must be 1 to 2 spacings"
                    f" {spacing:.4g} of its points"
                )
        for i, jet in enumerate(self.jets):
            check_inside(f"gas.jets[{i}]", grid, jet.region)
        for i, inflow in self.inflows().items():
            inflow.check(f"gas.jets[{i}]", grid, math.inf)

    def longest_dt(self, h: float) -> float:
        """Limit of the time step for gas at rest [s], h/(4 c)."""
        return 0.25 * h / self.sound_speed

    def points(self, grid: Grid, seed: int) -> seeding.Points:
        """Gas particles at the start; see `granular.model.seeding.SeededPoints`."""
        parts = seeding.SeededPoints(
            grid, self.fills, seed, [self.density] * len(self.fills), even=True
        )
        return seeding.joined(parts, grid.dim)

    def inflows(self) -> dict[int, Inflow]:
        """Inflows of the gas, by the numbers of their jets."""
        return {
            i: Inflow(
                jet.region,
                jet.velocity,
                self.fills[0].points_per_cell,
                density=jet.density,
                driven=True,
            )
            for i, jet in enumerate(self.jets)
            if jet.density is not None
        }

    def for_core(self, dim: int, rho0: float, wall_volume: float) -> tuple[dict, NDArray]:
        """Data for the core: parameters, and jets as rows (lower, upper, velocity)."""
        parameters = {name: getattr(self, name) for name in (*POSITIVE, *RANGES)}
        parameters["diameter"] = self.grain_diameter(rho0)
        parameters["wall_volume"] = wall_volume
        rows = [(*jet.region.bounds[0], *jet.region.bounds[1], *jet.velocity) for jet in self.jets]
        return parameters, np.array(rows, dtype=float).reshape(-1, 3 * dim)

    def _repr_html_(self) -> str:
        return table("Gas", vars(self))


@dataclass(frozen=True, kw_only=True)
class GasState:
    """A snapshot of the particles of a gas, ordered by id; its arrays are read-only.

    Parameters
    ----------
    time : float
        Time [s].
    id : ndarray, shape (n,)
        Numbers of the particles.
    x, v, a : ndarray, shape (n, dim)
        Position [m], within the period, velocity [m/s], acceleration [m/s2].
    mass, density, pressure, porosity : ndarray, shape (n,)
        Mass [kg; in 2D per metre of depth], density of the gas itself [kg/m3], pressure [Pa], local
        porosity of the grains.
    """

    time: float
    id: IntArray
    x: Array
    v: Array
    a: Array
    mass: Array
    density: Array
    pressure: Array
    porosity: Array

    def __post_init__(self) -> None:
        for array in self.fields.values():
            array.flags.writeable = False

    @property
    def n(self) -> int:
        """Number of particles."""
        return len(self.id)

    @property
    def fields(self) -> dict[str, NDArray]:
        """All fields except the time, by name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "time"}
