"""A scene: everything that determines a run, frozen and written down exactly."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from dataclasses import replace as _replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from granular import bodies as rigid
from granular import geometry, materials
from granular.bodies import Body
from granular.boundaries import Absorber, Gravity, Solid, Wall
from granular.checks import integer, one_of, positive
from granular.geometry import Fill, Grid
from granular.materials import Material
from granular.nodes import check_creases, creases
from granular.notebook import table
from granular.schemes import Fluidity, Scheme

__all__ = ["Parameters", "Scene"]

FORMAT = 1
"""Version of the JSON form; older ones are read, newer ones refused."""

Value = bool | int | float | str | None | tuple["Value", ...]


class Parameters(Mapping[str, Value]):
    """An immutable, hashable mapping of plain values: what a scene function was called with.

    Raises
    ------
    TypeError
        For keys that are not strings, and values that are not numbers, strings, booleans, None,
        or tuples of them.
    ValueError
        For NaN.
    """

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[str, Any] | Sequence[tuple[str, Any]] = ()) -> None:
        self._items = tuple(
            (self._key(key), self._plain(key, value)) for key, value in dict(items).items()
        )

    @staticmethod
    def _key(key: object) -> str:
        if not isinstance(key, str):
            raise TypeError(f"parameters: the name {key!r} must be a string")
        return key

    @classmethod
    def _plain(cls, key: str, value: Any) -> Value:
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, (tuple, list)):
            return tuple(cls._plain(key, entry) for entry in value)
        if isinstance(value, float) and math.isnan(value):
            raise ValueError(f"parameters: {key} = nan must be a number")
        if value is not None and not isinstance(value, (bool, int, float, str)):
            raise TypeError(f"parameters: {key} = {value!r} must be a plain value")
        return value

    def __getitem__(self, key: str) -> Value:
        for name, value in self._items:
            if name == key:
                return value
        raise KeyError(key)

    def __iter__(self) -> Iterator[str]:
        return (name for name, _ in self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __hash__(self) -> int:
        return hash(frozenset(self._items))

    def __repr__(self) -> str:
        return repr(dict(self._items))


def _tuple_of(name: str, value: object, kinds: tuple[type, ...]) -> tuple[Any, ...]:
    wanted = " or ".join(kind.__name__ for kind in kinds)
    if isinstance(value, str) or not isinstance(value, Sequence):
        raise TypeError(f"{name} = {value!r} must be a sequence of {wanted}")
    for i, entry in enumerate(value):
        if not isinstance(entry, kinds):
            raise TypeError(f"{name}[{i}] = {entry!r} must be a {wanted}")
    return tuple(value)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything that determines a run.

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
        A closed side of the grid without a wall merely keeps points from leaving.
    gravity : Gravity
    duration : float
        Time to simulate [s], > 0.
    absorbers : sequence of Absorber
    bodies : sequence of Body
        Rigid bodies; what fills them at the start is theirs to push out, so leave them room.
    seed : int
        Of the jitter of the points, >= 0.
    parameters : mapping
        What the scene function was called with: plain values, for measures and records.

    Raises
    ------
    TypeError, ValueError
        For parts of a wrong kind, or that do not fit the grid.
    """

    name: str
    grid: Grid
    fills: tuple[Fill, ...]
    material: Material
    scheme: Scheme
    walls: tuple[Wall | Solid, ...] = ()
    gravity: Gravity
    duration: float
    absorbers: tuple[Absorber, ...] = ()
    bodies: tuple[Body, ...] = ()
    seed: int = 0
    parameters: Parameters = field(default_factory=Parameters)

    def __post_init__(self) -> None:
        for name, kind in (
            ("name", str),
            ("grid", Grid),
            ("material", Material),
            ("scheme", Scheme),
            ("gravity", Gravity),
            ("parameters", Mapping),
        ):
            value = getattr(self, name)
            if not isinstance(value, kind):
                raise TypeError(f"{name} = {value!r} must be a {kind.__name__}")
        checked = {
            "fills": _tuple_of("fills", self.fills, (Fill,)),
            "walls": _tuple_of("walls", self.walls, (Wall, Solid)),
            "absorbers": _tuple_of("absorbers", self.absorbers, (Absorber,)),
            "bodies": _tuple_of("bodies", self.bodies, (Body,)),
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
        for name in ("walls", "absorbers", "bodies"):
            for i, part in enumerate(getattr(self, name)):
                part.check(f"{name}[{i}]", self.grid)
        if len({absorber.axis for absorber in self.absorbers}) < len(self.absorbers):
            raise ValueError(f"absorbers = {self.absorbers} must be one along an axis at most")
        if self.material.has_fluidity and self.scheme.basis == "ugimp":
            raise ValueError('basis = "ugimp" must be "linear" or "quadratic" for a nonlocal law')
        if self.gravity.dim != self.grid.dim:
            raise ValueError(
                f"gravity of dimension {self.gravity.dim} must have {self.grid.dim} as the grid"
            )
        if self.scheme.fluidity.kindling and self.material.elasticity != "hencky":
            raise ValueError('kindling = True must go with elasticity = "hencky"')
        if any(fill.lithostatic for fill in self.fills):
            *level, down = self.gravity.at(0.0)
            if any(level) or down > 0:
                raise ValueError(
                    f"gravity = {self.gravity} must point down the last axis at t = 0 for "
                    "lithostatic fills"
                )
        for axis, (n, periodic) in enumerate(zip(self.grid.shape, self.grid.periodic, strict=True)):
            lines = creases(self.grid, self.walls, axis)
            check_creases(self.scheme.basis, n, periodic, lines)

    @property
    def dim(self) -> int:
        """2 or 3."""
        return self.grid.dim

    @cached_property
    def n_points(self) -> int:
        """Material points at the start."""
        return geometry.count_points(self.grid, self.fills)

    def points(self) -> geometry.Points:
        """The material points at the start; see `granular.geometry.seed_points`."""
        return geometry.seed_points(self.grid, self.fills, self.seed, self.material.rho_c)

    def replace(self, **changes: Any) -> Self:
        """A copy with some parts changed, checked as a new one."""
        return _replace(self, **changes)

    def to_json(self) -> str:
        """The scene as ASCII JSON; `from_json` gives an equal one, floats to the last bit.

        Raises
        ------
        TypeError
            For a region or material of a class this module does not know.
        """
        return json.dumps({"format": FORMAT, "scene": _encode(self)}, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Read what `to_json` wrote.

        Raises
        ------
        ValueError
            If the text is no scene, a part of it is out of range, or its format is newer.
        """
        try:
            data = json.loads(text, parse_constant=_refuse_constant)
            if not isinstance(data, dict) or set(data) != {"format", "scene"}:
                raise ValueError("must hold format and scene")
            if integer("format", data["format"], 1) > FORMAT:
                raise ValueError(f"format = {data['format']} is newer than {FORMAT}")
            scene = _decode(data["scene"])
        except (TypeError, ValueError, KeyError, OverflowError, RecursionError) as error:
            raise ValueError(f"not the JSON of a scene: {error}") from error
        if not isinstance(scene, cls):
            raise ValueError(f"not the JSON of a scene but of {type(scene).__name__}")
        return scene

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
            "scheme": f"{self.scheme.basis}, {self.scheme.transfer}, {self.scheme.density}",
        }
        return table(f"Scene {self.name}", rows | dict(self.parameters))


_PARTS: dict[str, type] = {
    kind.__name__: kind
    for kind in (
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
        Scheme,
        Wall,
        Solid,
        Absorber,
        Gravity,
        Parameters,
        Body,
        rigid.Motion,
    )
}
"""The classes a scene is written with, by the tag that stands for them."""
_PARTS |= {
    f"bodies.{kind.__name__}": kind
    for kind in (rigid.Box, rigid.Cylinder, rigid.HalfSpace, rigid.Mesh, rigid.Union)
}
_TAGS = {kind: tag for tag, kind in _PARTS.items()}


def _encode(value: Any) -> Any:
    """Plain JSON values; floats rely on the shortest repr that reads back to the same bits."""
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {"type": "float", "value": repr(value)}
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, tuple):
        return [_encode(entry) for entry in value]
    if isinstance(value, Parameters):
        items = [[key, _encode(entry)] for key, entry in value.items()]
        return {"type": "Parameters", "items": items}
    kind = type(value)
    if kind not in _TAGS:
        raise TypeError(f"{value!r} cannot be written: the class must be one of {list(_PARTS)}")
    if isinstance(value, Material):
        arguments = value.arguments()
    else:
        arguments = {f.name: getattr(value, f.name) for f in fields(value)}
    return {"type": _TAGS[kind], **{name: _encode(entry) for name, entry in arguments.items()}}


def _decode(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_decode(entry) for entry in value)
    if not isinstance(value, dict):
        return value
    rest = dict(value)
    tag = rest.pop("type")
    if tag == "float":
        return float(one_of("float", rest["value"], ("inf", "-inf")))
    if tag not in _PARTS:
        raise ValueError(f"type {tag!r} must be one of {list(_PARTS)}")
    return _PARTS[tag](**{name: _decode(entry) for name, entry in rest.items()})


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} must not stand in the JSON of a scene")
