"""Base class of the scenes of both methods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from granular.model import seeding
from granular.model.fill import Fill, check_inside, check_packing, rest_density
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.model.indicators import Row
from granular.model.inflow import Inflow, standing_points
from granular.tools.checks import check_fields, integer, kinds_of, positive, set_fields, tuple_of
from granular.tools.notebook import image, pictures, table
from granular.tools.serializable import Parameters, Serializable


class BaseScene(Serializable):
    """Base class of the scenes; the frozen dataclasses below it declare the fields."""

    method: ClassVar[str]
    """Name of the numerical method."""
    _limits: ClassVar[Any]
    """Module of the method with its limits."""

    name: str
    grid: Grid
    fills: tuple[Fill, ...]
    inflows: tuple[Inflow, ...]
    material: Any
    walls: tuple[Any, ...]
    gravity: Gravity
    duration: float
    seed: int
    parameters: Mapping[str, Any]

    def _check_common(self, **kinds: type) -> None:
        """Check the fields of all scenes, and those that must be of the given classes."""
        if isinstance(self.gravity, tuple | list | np.ndarray):  # a constant vector
            set_fields(self, gravity=Gravity.constant(tuple(self.gravity)))
        kinds_of(self, name=str, grid=Grid, gravity=Gravity, parameters=Mapping, **kinds)
        check_fields(self, tuple_of, "fills", kinds=(Fill,))
        check_fields(self, tuple_of, "inflows", kinds=(Inflow,))
        check_fields(self, positive, "duration")
        check_fields(self, integer, "seed", low=0, high=2**63 - 1)
        set_fields(self, parameters=Parameters(self.parameters))
        if not self.sources:
            raise ValueError("fills = () must hold at least one Fill")
        for i, fill in enumerate(self.fills):
            check_inside(f"fills[{i}]", self.grid, fill.region)
            check_packing(f"fills[{i}]", fill.material or self.material, fill.packing)
        for i, inflow in enumerate(self.inflows):
            check_packing(f"inflows[{i}]", inflow.material or self.material, inflow.packing)
        if self.gravity.dim != self.dim:
            raise ValueError(
                f"gravity of dimension {self.gravity.dim} must have {self.dim} as the grid"
            )

    @property
    def bodies(self) -> tuple[Any, ...]:
        """Rigid bodies; none with a method that has only walls."""
        return ()

    @property
    def dim(self) -> int:
        """Dimension, 2 or 3."""
        return self.grid.dim

    @property
    def sources(self) -> tuple[Fill | Inflow, ...]:
        """Fills and inflows, the sources of the material."""
        return (*self.fills, *self.inflows)

    @property
    def materials(self) -> tuple[Any, ...]:
        """The different materials: the material of the scene, then others as in the fills."""
        return (self.material,)

    @property
    def wave_speed(self) -> float:
        """Largest speed of compression waves [m/s]."""
        return max(material.wave_speed for material in self.materials)

    @cached_property
    def n_points(self) -> int:
        """Number of points of the material at the start."""
        return sum(len(points.x) for points in self.points_in_parts())

    def points(self) -> seeding.Points:
        """Make the points of the material at the start.

        They are the points of the fills (`granular.model.seeding.SeededPoints`), then the points
        that fill the regions of driven inflows; their number of the fill is that in `sources`.
        """
        return seeding.joined(self.points_in_parts(), self.dim)

    def points_in_parts(self) -> Iterable[seeding.Points]:
        """Make the points of the material at the start, some at a time, as often as wanted."""
        sources: list[Iterable[seeding.Points]] = []
        if self.fills:
            rest = [
                rest_density(fill.material or self.material, fill.packing) for fill in self.fills
            ]
            more = self._seeding()
            sources.append(seeding.SeededPoints(self.grid, self.fills, self.seed, rest, **more))
        inlets = enumerate(self.inflows)
        sources.append([standing_points(self, i) for i, inlet in inlets if inlet.driven])
        return seeding.Joined(*sources)

    def _seeding(self) -> dict[str, Any]:
        """Further arguments of `granular.model.seeding.SeededPoints`."""
        return {}

    @property
    def courant_limit(self) -> float:
        """Largest stable (c + speed) dt/dx."""
        return self._limits.courant_limit(self)

    @property
    def remedies(self) -> Mapping[str, str]:
        """Remedies for indicators beyond their limits; one without a remedy has no limit."""
        return self._limits.remedies(self)

    @property
    def indicators(self) -> tuple[Row, ...]:
        """Indicators of failure of its runs; see `granular.run.diagnostics`."""
        return self._limits.indicators(self)

    def known_failures(self) -> list[str]:
        """List the settings that are known to fail without an error, one sentence each."""
        return self._limits.known_failures(self)

    def _repr_html_(self) -> str:
        rows: dict[str, object] = {
            "domain [m]": " x ".join(f"{n * self.grid.cell:g}" for n in self.grid.shape),
            "cells": " x ".join(map(str, self.grid.shape)) + f" of {self.grid.cell:g} m",
            "points": self.n_points,
            "duration [s]": self.duration,
            "gravity [m/s2]": self.gravity.vectors[-1],
            "walls": self._walls_in_words(),
            "material": ", ".join(type(material).__name__ for material in self.materials),
            "method": self._method_in_words(),
        }
        return table(f"Scene {self.name}", rows | dict(self.parameters)) + image(
            pictures["scene"](self)
        )

    def _walls_in_words(self) -> str:
        return str(len(self.walls))

    def _method_in_words(self) -> str:
        return self.method
