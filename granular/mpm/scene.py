"""MPM scenes: all data that determine a run, immutable and serializable without rounding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

from granular import geometry, materials
from granular.checks import integer, kinds_of, positive, tuple_of
from granular.geometry import Fill, Grid
from granular.gravity import Gravity
from granular.materials import Material
from granular.mpm import bodies as rigid
from granular.mpm import limits
from granular.mpm.bodies import Body
from granular.mpm.node_codes import c0_lines, check_c0_lines
from granular.mpm.schemes import (
    CellAveragedDensity,
    Fluidity,
    ParticleDensity,
    Scheme,
    SmoothedDensity,
    default,
)
from granular.mpm.walls import Solid, SpongeLayer, Wall
from granular.notebook import table
from granular.serializable import Parameters, Serializable, register

__all__ = ["Parameters", "Scene"]


@dataclass(frozen=True, kw_only=True)
class Scene(Serializable):
    """All data that determine a run of the material point method.

    Parameters
    ----------
    name : str
        Short name of the scene.
    grid : Grid
        Domain and cells; the last axis is up.
    fills : sequence of Fill
        Material at the start, at least one.
    material : Material
    scheme : Scheme
    walls : sequence of Wall and Solid
        Walls and blocks. A side of the grid that is neither open nor has a wall only keeps points
        from leaving.
    gravity : Gravity
    duration : float
        Time to simulate [s], > 0.
    sponge_layers : sequence of SpongeLayer
    bodies : sequence of Body
        Rigid bodies. Fills should leave out their volume; otherwise points begin inside them.
    seed : int
        Seed of the jitter of the points, >= 0.
    parameters : mapping
        Arguments of the scene function as plain values, for measures and records.

    Raises
    ------
    TypeError, ValueError
        For parts of a wrong kind, or that do not fit the grid.
    """

    method: ClassVar[str] = "mpm"
    """Name of the numerical method."""
    indicators: ClassVar[tuple[tuple[str, str, float | None, str], ...]] = ()
    """Indicators in addition to those of all methods; see `granular.diagnostics`."""

    name: str
    grid: Grid
    fills: tuple[Fill, ...]
    material: Material
    scheme: Scheme = default
    walls: tuple[Wall | Solid, ...] = ()
    gravity: Gravity
    duration: float
    sponge_layers: tuple[SpongeLayer, ...] = ()
    bodies: tuple[Body, ...] = ()
    seed: int = 0
    parameters: Mapping[str, Any] = field(default_factory=Parameters)

    def __post_init__(self) -> None:
        kinds_of(
            self,
            name=str,
            grid=Grid,
            material=Material,
            scheme=Scheme,
            gravity=Gravity,
            parameters=Mapping,
        )
        checked = {
            "fills": tuple_of("fills", self.fills, (Fill,)),
            "walls": tuple_of("walls", self.walls, (Wall, Solid)),
            "sponge_layers": tuple_of("sponge_layers", self.sponge_layers, (SpongeLayer,)),
            "bodies": tuple_of("bodies", self.bodies, (Body,)),
            "duration": positive("duration", self.duration),
            "seed": integer("seed", self.seed, 0, 2**63 - 1),
            "parameters": Parameters(self.parameters),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        self._check_fit()

    def _check_fit(self) -> None:
        if not self.name:
            raise ValueError("name = '' must not be empty")
        if not self.fills:
            raise ValueError("fills = () must hold at least one Fill")
        for i, fill in enumerate(self.fills):
            geometry.check_inside(f"fills[{i}]", self.grid, fill.region)
        rigid.check_count(self.bodies)
        for name in ("walls", "sponge_layers", "bodies"):
            for i, part in enumerate(getattr(self, name)):
                part.check(f"{name}[{i}]", self.grid)
        if len({sponge.axis for sponge in self.sponge_layers}) < len(self.sponge_layers):
            raise ValueError(
                f"sponge_layers = {self.sponge_layers} must be one along an axis at most"
            )
        if self.material.has_fluidity and self.scheme.basis == "ugimp":
            raise ValueError('basis = "ugimp" must be "linear" or "quadratic" for a nonlocal law')
        if self.gravity.dim != self.grid.dim:
            raise ValueError(
                f"gravity of dimension {self.gravity.dim} must have {self.grid.dim} as the grid"
            )
        if self.scheme.fluidity.reconnect_fluidity and self.material.elasticity != "hencky":
            raise ValueError('reconnect_fluidity = True must go with elasticity = "hencky"')
        if any(fill.lithostatic for fill in self.fills):
            *level, down = self.gravity.at(0.0)
            if any(level) or down > 0:
                raise ValueError(
                    f"gravity = {self.gravity} must point down the last axis at t = 0 for "
                    "lithostatic fills"
                )
        for axis, (n, periodic) in enumerate(zip(self.grid.shape, self.grid.periodic, strict=True)):
            lines = c0_lines(self.grid, self.walls, axis)
            check_c0_lines(self.scheme.basis, n, periodic, lines)

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return self.grid.dim

    @property
    def courant_limit(self) -> float:
        """Largest stable (c + speed) dt/dx."""
        return limits.courant_limit(self)

    def known_failures(self) -> list[str]:
        """List the settings that are known to fail without an error, one sentence each."""
        return limits.known_failures(self)

    @property
    def knows_all_work(self) -> bool:
        """True if the energy budget includes all work; the work of bodies is not included."""
        return not self.bodies

    @cached_property
    def n_points(self) -> int:
        """Number of material points at the start."""
        return geometry.count_points(self.grid, self.fills)

    def points(self) -> geometry.Points:
        """Make the material points of the start; see `granular.geometry.seed_points`."""
        return geometry.seed_points(self.grid, self.fills, self.seed, self.material.rho_c)

    def _repr_html_(self) -> str:
        grid = self.grid
        size = " x ".join(
            f"{high - low:g}" for low, high in zip(grid.lower, grid.upper, strict=True)
        )
        rows: dict[str, object] = {
            "domain [m]": size,
            "cells": " x ".join(map(str, grid.shape)) + f" of {grid.cell:g} m",
            "material points": self.n_points,
            "duration [s]": self.duration,
            "gravity [m/s2]": self.gravity.vectors[-1],
            "walls": len(self.walls),
            "material": type(self.material).__name__,
            "scheme": f"{self.scheme.basis}, {self.scheme.transfer}, "
            f"{self.scheme.density.name} density",
        }
        return table(f"Scene {self.name}", rows | dict(self.parameters))


register(
    Scene,
    Grid,
    Fill,
    geometry.Box,
    geometry.Disc,
    geometry.Cylinder,
    geometry.Union,
    geometry.Intersection,
    geometry.Difference,
    materials.MuI,
    materials.NGF,
    materials.DruckerPrager,
    materials.HardeningDruckerPrager,
    materials.Elastic,
    Fluidity,
    ParticleDensity,
    SmoothedDensity,
    CellAveragedDensity,
    Scheme,
    Wall,
    Solid,
    SpongeLayer,
    Gravity,
    Body,
    rigid.Motion,
)
register(rigid.Box, rigid.Cylinder, rigid.HalfSpace, rigid.Mesh, rigid.Union, prefix="bodies.")
