"""MPM scenes: all data that determine a run, immutable and serializable without rounding."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from granular import _core
from granular.materials import Material
from granular.model import regions, surfaces
from granular.model.fill import Fill, rest_friction
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.model.inflow import Inflow
from granular.model.scene import BaseScene
from granular.mpm import bodies as rigid
from granular.mpm import limits
from granular.mpm.axis_nodes import c0_lines, check_c0_lines
from granular.mpm.axisymmetry import axis_wall, check_axisymmetry, check_laws
from granular.mpm.bodies import Body
from granular.mpm.body_distances import distance_from_bodies
from granular.mpm.inflow import check_inflows
from granular.mpm.motion import Motion
from granular.mpm.schemes import DENSITIES, Fluidity, Scheme, suited_to
from granular.mpm.walls import BOUNDARIES, SpongeLayer, WallOrBlock
from granular.shapes.shape import shape_kinds
from granular.tools.checks import check_fields, kinds_of, set_fields, tuple_of
from granular.tools.serializable import Parameters as Parameters
from granular.tools.serializable import register

MOST_MATERIALS = 8
"""Largest number of materials of a scene, as in csrc/mpm/materials.h."""


class Servo(NamedTuple):
    """A wall that keeps a pressure: its index, axis and coordinate [m], and the pressure [Pa]."""

    wall: int
    axis: int
    at: float
    pressure: float


@dataclass(frozen=True, kw_only=True)
class Scene(BaseScene):
    """All data that determine a run of the material point method.

    Parameters
    ----------
    name : str
        Short name of the scene.
    grid : Grid
        Domain and cells; the last axis is up.
    fills : sequence of Fill
        Material at the start, at least one unless there are inflows.
    material : Material
        Material of the fills and inflows without a material. A scene has at most 8
        different materials, one of them nonlocal; several are not for a `CellAveragedDensity`.
    scheme : Scheme, optional
        By default `granular.schemes.cell_averaged` for a nonlocal law that is the only material and
        whose friction has a limit, else `granular.schemes.default`.
    walls : sequence of Wall and Solid
        Walls and blocks. A side of the grid that is neither open nor has a wall only prevents
        points from leaving.
    gravity : Gravity or tuple of float
        Gravity, of the dimension of the grid; a vector [m/s2] is constant.
    duration : float
        Time to simulate [s], > 0.
    sponge_layers : sequence of SpongeLayer
        Layers with sponge damping of elastic waves, at most one along an axis.
    bodies : sequence of Body
        Rigid bodies, at most 64. Fills leave out their volume: points begin outside of them and
        follow their surfaces, see `granular.Fill`.
    inflows : sequence of Inflow
        Material that enters during the run.
    seed : int
        Seed of the jitter of the points, >= 0.
    parameters : mapping
        Arguments of the scene function as plain values, for measures and records.

    Raises
    ------
    TypeError, ValueError
        For parts of a wrong kind, or that do not fit the grid.
    """

    method = "mpm"
    _limits: ClassVar[Any] = limits

    name: str
    grid: Grid
    fills: tuple[Fill, ...]
    material: Material
    scheme: Scheme = None  # type: ignore[assignment]  # a Scheme once made
    walls: tuple[WallOrBlock, ...] = ()
    gravity: Gravity
    duration: float
    sponge_layers: tuple[SpongeLayer, ...] = ()
    bodies: tuple[Body, ...] = ()
    inflows: tuple[Inflow, ...] = ()
    seed: int = 0
    parameters: Mapping[str, Any] = field(default_factory=Parameters)

    def __post_init__(self) -> None:
        check_fields(self, tuple_of, "walls", kinds=BOUNDARIES)
        check_fields(self, tuple_of, "sponge_layers", kinds=(SpongeLayer,))
        check_fields(self, tuple_of, "bodies", kinds=(Body,))
        self._check_common(material=Material)
        if self.scheme is None:
            set_fields(self, scheme=suited_to(*self.materials, cell=self.grid.cell))
        kinds_of(self, scheme=Scheme)
        self._check_fit()

    def _check_fit(self) -> None:
        if not self.name:
            raise ValueError("name = '' must not be empty")
        rigid.check_count(self.bodies)
        for name in ("walls", "sponge_layers", "bodies"):
            for i, part in enumerate(getattr(self, name)):
                part.check(f"{name}[{i}]", self.grid)
        if self.grid.axisymmetric:
            check_axisymmetry(self.grid, self.gravity, self.walls, self.scheme, self.bodies)
            check_laws(self.materials)
        if len({sponge.axis for sponge in self.sponge_layers}) < len(self.sponge_layers):
            raise ValueError(
                f"sponge_layers = {self.sponge_layers} must be one along an axis at most"
            )
        fluid = self.nonlocal_material
        if fluid is not None and self.scheme.basis == "ugimp":
            raise ValueError('basis = "ugimp" must be "linear" or "quadratic" for a nonlocal law')
        counts = {source.points_per_cell for source in self.sources}
        if self.scheme.basis == "ugimp" and len(counts) > 1:
            raise ValueError(
                f"points_per_cell = {sorted(counts)} must be one number for all fills with basis = "
                '"ugimp", whose points are boxes of one size'
            )
        reconnects = fluid or self.material
        if self.scheme.fluidity.reconnect_fluidity and reconnects.elasticity != "hencky":
            raise ValueError('reconnect_fluidity = True must go with elasticity = "hencky"')
        if any(fill.lithostatic for fill in self.fills):
            along = self.gravity.at(0.0)[np.array(self.grid.periodic)]
            if along.any():
                raise ValueError(
                    f"gravity = {self.gravity} must have no component along a periodic axis at "
                    "t = 0 for lithostatic fills"
                )
        self._check_ratios()
        self._check_servos()
        self._check_materials()
        check_inflows(self)
        if self.scheme.transfer == "xpic" and any(getattr(w, "velocity", None) for w in self.walls):
            raise ValueError('transfer = "xpic" must be another one where walls have a velocity')
        if self.scheme.sleep_speed and (fluid is not None or self.servos):
            raise ValueError(
                f"sleep_speed = {self.scheme.sleep_speed} must be 0 for a nonlocal law, and where "
                "a wall keeps a pressure"
            )
        for axis, (n, periodic) in enumerate(zip(self.grid.shape, self.grid.periodic, strict=True)):
            lines = c0_lines(self.grid, self.walls, axis)
            check_c0_lines(self.scheme.basis, n, periodic, lines)

    def _check_ratios(self) -> None:
        """Refuse a K0 of a fill at which its material yields."""
        for i, fill in enumerate(self.fills):
            material = fill.material or self.material
            if fill.K0 is None or getattr(material, "cohesion", 0.0) > 0.0:
                continue
            friction = rest_friction(material, fill.packing, 0.0)  # largest; see lithostatic.py
            low, high = material.yield_ratios_at(friction)
            if not low <= fill.K0 <= high:
                raise ValueError(
                    f"fills[{i}].K0 = {fill.K0} must be from {low:.6g} to {high:.6g}, the ratios "
                    f"at which a material of friction {friction:.6g} yields; None for "
                    f"{material.K0_at(friction):.6g}"
                )

    @property
    def materials(self) -> tuple[Material, ...]:
        """The different materials: the material of the scene, then others as in the sources.

        The field `material` of a state numbers them, if there are several.
        """
        of_sources = [source.material for source in self.sources if source.material is not None]
        return tuple(dict.fromkeys([self.material, *of_sources]))

    @property
    def nonlocal_material(self) -> Material | None:
        """The material with a fluidity, one at most; None without one."""
        return next((material for material in self.materials if material.has_fluidity), None)

    def _check_materials(self) -> None:
        """Refuse combinations of materials that the method does not have."""
        least = self.scheme.density.numbers()["separation_strain"]
        for material in self.materials:
            strength = getattr(material, "tensile_strength", 0.0)
            if strength and not strength < least * material.K:
                raise ValueError(
                    f"tensile_strength = {strength:.6g} must be below separation_strain K = "
                    f"{least * material.K:.6g}: take a smaller tensile_strength, or a larger "
                    f"E = {material.E}"
                )
            if self.scheme.precision == "single" and not _core.laws()[material.law][2]:
                raise ValueError(
                    f'precision = "single" must be "double" for the law {material.law!r} of '
                    f"{type(material).__name__}"
                )
        count = len(self.materials)
        if count == 1:
            return
        names = [type(material).__name__ for material in self.materials]
        if count > MOST_MATERIALS:
            raise ValueError(f"{count} materials, {names}, must be {MOST_MATERIALS} at most")
        if sum(material.has_fluidity for material in self.materials) > 1:
            raise ValueError(f"materials {names} must have at most one with a nonlocal law")
        if self.scheme.density.name == "cell_averaged":
            raise ValueError(
                "density = CellAveragedDensity() must be SmoothedDensity() or ParticleDensity() "
                f"with several materials, {names}: the points of a cell would share one density"
            )
        if self.nonlocal_material is not None and self.scheme.fluidity.substeps > 1:
            raise ValueError(
                f"substeps = {self.scheme.fluidity.substeps} of the fluidity must be 1 with "
                f"several materials, {names}"
            )
        for servo in self.servos:
            raise ValueError(
                f"walls[{servo.wall}].pressure = {servo.pressure} must be None with several "
                f"materials, {names}"
            )

    def _seeding(self) -> dict[str, Any]:
        gravity = self.gravity.at(0.0)
        size = math.hypot(*gravity)
        up = tuple((-gravity / size).tolist()) if size else None
        return {"distance": distance_from_bodies(self.grid, self.bodies), "up": up}

    @property
    def boundaries(self) -> tuple[WallOrBlock, ...]:
        """The walls and blocks, and the axis of symmetry as a free-slip wall if there is one."""
        return self.walls + ((axis_wall(self.grid),) if self.grid.has_axis else ())

    @property
    def servos(self) -> list[Servo]:
        """The walls that keep a pressure, one at most."""
        return [
            Servo(i, wall.axis, wall.extent(self.grid, wall.axis)[0], wall.pressure)
            for i, wall in enumerate(self.walls)
            if wall.pressure is not None and wall.axis is not None
        ]

    @property
    def moves_walls(self) -> bool:
        """True if a wall moves or keeps a pressure, or an inflow is driven: those do work."""
        moving = any(wall.velocity for wall in self.walls)
        return bool(self.servos) or moving or any(inflow.driven for inflow in self.inflows)

    def _check_servos(self) -> None:
        """Refuse a second wall with a pressure, and one that the material cannot follow."""
        for n, servo in enumerate(self.servos):
            name = f"walls[{servo.wall}].pressure = {servo.pressure}"
            if n:
                first = self.servos[0].wall
                raise ValueError(f"{name} must be None: walls[{first}] keeps a pressure already")
            if not self.material.granular:
                raise ValueError(f"{name} must be None for an elastic body")
            if self.material.dilates:
                raise ValueError(
                    f"{name} must be None for {type(self.material).__name__}: the wall stays on "
                    "its line of the grid, and cannot follow the volume of the material. Take a "
                    "plate: a Body that is free along this axis, and sim.apply_load"
                )
            if self.scheme.density.name == "particle":
                raise ValueError(
                    f"{name} must be None with ParticleDensity(): take SmoothedDensity() (the "
                    "default) or CellAveragedDensity()"
                )

    def _walls_in_words(self) -> str:
        servos = (f", walls[{s.wall}] keeps {s.pressure:g} Pa" for s in self.servos)
        entering = f", {len(self.inflows)} inflows" if self.inflows else ""
        return f"{len(self.walls)}" + "".join(servos) + entering

    def _method_in_words(self) -> str:
        scheme = self.scheme
        return f"mpm: {scheme.basis}, {scheme.transfer}, {scheme.density.name} density"


register(
    Scene,
    Grid,
    Fill,
    *shape_kinds(),
    regions.Cloud,
    regions.Mask,
    surfaces.Heights,
    surfaces.Layer,
    *Material.__subclasses__(),
    Fluidity,
    *DENSITIES.values(),
    Scheme,
    *BOUNDARIES,
    SpongeLayer,
    Gravity,
    Body,
    Inflow,
    Motion,
)
