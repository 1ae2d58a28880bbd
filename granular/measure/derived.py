"""Quantities of the points that follow from a state, by name: for pictures, records and tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular.measure.fields import nodal_density, phase
from granular.measure.profiles import inertial_number, scaled_inertial_number
from granular.model.state import State

DERIVED: dict[str, tuple[Callable[[State], Any], str]] = {
    "pressure": (attrgetter("pressure"), "Pa"),
    "shear_stress": (attrgetter("shear_stress"), "Pa"),
    "mu": (attrgetter("mu"), "1"),
    "density": (attrgetter("density"), "kg/m3"),
    "packing": (attrgetter("packing"), "1"),
    "volume": (attrgetter("volume"), "m3"),
    "speed": (attrgetter("speed"), "m/s"),
    "dense": (attrgetter("dense"), "1"),
    "nodal_density": (nodal_density, "kg/m3"),
    "phase": (phase, "1"),
    "inertial_number": (inertial_number, "1"),
    "scaled_inertial_number": (scaled_inertial_number, "1"),
}
"""Function of a state and unit of each quantity; units in 2D are per metre of depth."""

STANDARD = ("pressure", "shear_stress", "density", "speed")
"""Quantities that are exported by default."""


def check_derived(name: str, value: object) -> tuple[str, ...]:
    """Check names of derived quantities.

    Raises
    ------
    TypeError
        If they are no collection of names.
    ValueError
        If there is no such quantity.
    """
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise TypeError(f"{name} = {value!r} must be a sequence of names")
    names = tuple(value)
    if not all(isinstance(one, str) for one in names):
        raise TypeError(f"{name} = {value!r} must be a sequence of names")
    names = tuple(dict.fromkeys(names))
    for one in names:
        if one not in DERIVED:
            raise ValueError(f"{name}: {one!r} must be one of {', '.join(DERIVED)}")
    return names


def derived(state: State, name: str) -> NDArray[Any]:
    """Values of the points, shape (n,), of float64, or of int64 for quantities that are true or
    false.

    Raises
    ------
    ValueError
        If the scene lacks a number that it needs, such as a grain diameter.
    """
    if state.n == 0:
        return np.zeros(0, dtype=np.int64 if name in ("dense", "phase") else float)
    values = np.asarray(DERIVED[name][0](state))
    return values.astype(np.int64) if values.dtype == bool else values.astype(float)


def with_derived(state: State, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Fields of a state and derived quantities."""
    return state.fields | {name: derived(state, name) for name in names}
