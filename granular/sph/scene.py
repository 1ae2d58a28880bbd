"""An SPH scene: all data that determine a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import AXES, Grid
from granular.model.inflow import Inflow
from granular.model.regions import Cloud
from granular.model.scene import BaseScene
from granular.sph import limits
from granular.sph.gas import Gas, Jet
from granular.sph.inflow import check_inflows
from granular.sph.material import Viscoplastic
from granular.sph.numerics import Numerics
from granular.sph.walls import ParticleWall, wall_points
from granular.tools.checks import check_fields, tuple_of
from granular.tools.serializable import Parameters, register


def _lattice(dim: int, smoothing: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Kernel data of a square or cubic seeding lattice.

    Returns the vectors to the particles [spacings], their q = r/h, and the norm of the kernel
    [1/spacing^dim].
    """
    n = math.ceil(2.0 * smoothing)
    ways = np.stack(np.meshgrid(*[np.arange(-n, n + 1)] * dim), axis=-1).reshape(-1, dim)
    norm = 10.0 / (7.0 * math.pi) if dim == 2 else 1.0 / math.pi
    return ways, np.sqrt((ways**2).sum(axis=1)) / smoothing, norm / smoothing**dim


def seeding_weight(dim: int, smoothing: float) -> float:
    """Sum of the kernel over a square or cubic seeding lattice, in 1/spacing^dim; nearly 1.

    The mass of a particle is rho0 divided by this sum, so that the density of the seeding lattice
    is rho0.
    """
    _, q, norm = _lattice(dim, smoothing)
    w = np.maximum(2.0 - q, 0.0) ** 3 / 4.0 - np.maximum(1.0 - q, 0.0) ** 3
    return float(norm * w.sum())


def seeding_gradient(dim: int, smoothing: float) -> float:
    """Ratio of the kernel gradient of a linear field on a seeding lattice to the exact gradient.

    It is 0.991 in 2D and 0.981 in 3D with h = 1.2 spacings. Gradients and forces are divided by
    this number, so that they are exact for a linear field on the seeding lattice.
    """
    ways, q, norm = _lattice(dim, smoothing)
    inner = 3.0 - 2.25 * q
    outer = 0.75 * np.maximum(2.0 - q, 0.0) ** 2 / np.maximum(q, 1.0)
    slopes = np.where(q < 1.0, inner, outer) / smoothing**2
    return float(norm * (ways[:, 0] ** 2 * slopes).sum() / seeding_weight(dim, smoothing))


@dataclass(frozen=True, kw_only=True)
class Scene(BaseScene):
    """All data that determine a run.

    Parameters
    ----------
    name : str
        Short name of the scene.
    grid : Grid
        Domain and seeding lattice; its `cell` is the spacing of the particles. Particles that leave
        the domain are dropped; walls may lie outside. The last axis is up.
    fills : sequence of Fill
        Material at the start, with one particle per cell and the density and material of the scene;
        at least one fill unless there are inflows. A region must not be a `Cloud`.
    material : Viscoplastic
    numerics : Numerics
    walls : sequence of ParticleWall
    gas : Gas or None
        Gas in the pores of the material and above it; None for no gas.
    inflows : sequence of Inflow
        Material that enters during the run. They must be driven, with one particle per cell and a
        region at least as long as the reach of the kernel: a reservoir of particles that move with
        the velocity, behind those that have left it.
    gravity : Gravity or tuple of float
        A vector [m/s2] is constant.
    duration : float
        Time to simulate [s], > 0.
    seed : int
        Seed of the jitter of the particles, >= 0.
    parameters : mapping
        Arguments with which the scene function was called.

    Raises
    ------
    TypeError, ValueError
        For parts of a wrong type, or that do not fit together: walls thinner than the reach of the
        kernel, periods shorter than the reach of the neighbour list, a time step beyond its limit.
    """

    method = "sph"
    _limits: ClassVar[Any] = limits

    name: str
    grid: Grid
    fills: tuple[Fill, ...]
    material: Viscoplastic = field(default_factory=Viscoplastic)
    numerics: Numerics = field(default_factory=Numerics)
    walls: tuple[ParticleWall, ...] = ()
    gas: Gas | None = None
    inflows: tuple[Inflow, ...] = ()
    gravity: Gravity
    duration: float
    seed: int = 0
    parameters: Mapping[str, Any] = field(default_factory=Parameters)

    def __post_init__(self) -> None:
        check_fields(self, tuple_of, "walls", kinds=(ParticleWall,))
        if not isinstance(self.gas, Gas | None):
            raise TypeError(f"gas = {self.gas!r} must be a Gas or None")
        self._check_common(material=Viscoplastic, numerics=Numerics)
        self._check_fit()

    def _check_fit(self) -> None:
        grid, numerics = self.grid, self.numerics
        if grid.axisymmetric:
            raise ValueError(
                "grid must not be axisymmetric: SPH has no rings, take a scene of the material "
                "point method"
            )
        for i, fill in enumerate(self.fills):
            if fill.points_per_cell != 1:
                raise ValueError(f"fills[{i}].points_per_cell = {fill.points_per_cell} must be 1")
            if isinstance(fill.region, Cloud):
                raise ValueError(f"fills[{i}].region must not be a Cloud: particles have one mass")
            if fill.material is not None:
                raise ValueError(f"fills[{i}].material must be None: SPH has one material")
            if fill.density is not None or fill.lithostatic:
                raise ValueError(
                    f"fills[{i}] must have the density of the material and no weight on it"
                )
        if self.gas is not None:
            self.gas.check(grid, self.material.rho0, self.h)
        for i, wall in enumerate(self.walls):
            wall.check(f"walls[{i}]", grid, 2.0 * self.h)
        check_inflows(self)
        reach = self.h * (2.0 + numerics.skin)
        for axis, periodic in enumerate(grid.periodic):
            length = grid.shape[axis] * grid.cell
            if periodic and length <= reach:
                raise ValueError(
                    f"the period {length} of {AXES[axis]} must exceed {reach:.4g}, the list's reach"
                )
        if numerics.dt is not None and numerics.dt > self.longest_dt:
            raise ValueError(
                f"dt = {numerics.dt} must be at most {self.longest_dt:.4g}, h/(4 c) at rho0"
            )

    @property
    def h(self) -> float:
        """Smoothing length [m]."""
        return self.numerics.smoothing * self.grid.cell

    @property
    def longest_dt(self) -> float:
        """Limit of the time step at rho0 and for gas at rest [s], h/(4 c).

        The limit is smaller for denser material and for gas in motion.
        """
        limit = 0.25 * self.h / self.material.wave_speed
        return limit if self.gas is None else min(limit, self.gas.longest_dt(self.h))

    @property
    def point_mass(self) -> float:
        """Mass of a particle [kg, in 2D kg/m], with which the seeding lattice has density rho0."""
        weight = seeding_weight(self.dim, self.numerics.smoothing)
        return self.material.rho0 * self.grid.cell**self.dim / weight

    def gas_inflows(self) -> list[tuple[Inflow, float]]:
        """Inflows of the gas, and the masses of the particles that enter by them [kg]."""
        inflows = []
        for inflow in {} if self.gas is None else self.gas.inflows().values():
            spacing = self.grid.cell / inflow.points_per_axis
            weight = seeding_weight(self.dim, self.h / spacing)
            density = inflow.density_in(self.grid, math.inf)
            inflows.append((inflow, density * spacing**self.dim / weight))
        return inflows

    def _seeding(self) -> dict[str, Any]:
        return {"even": True}

    def wall_points(self) -> dict[str, np.ndarray]:
        """Wall particles at the start; see `granular.sph.walls.wall_points`."""
        return wall_points(self.grid, self.walls)

    def _method_in_words(self) -> str:
        return "smoothed particle hydrodynamics"


register(Scene, ParticleWall, Numerics, Viscoplastic, Gas, Jet, prefix="sph.")
