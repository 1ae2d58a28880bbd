"""Sums of points over cells, from which the indicators of failure of a run are computed.

All points of a cell are of one process, so that sums which several processes make of their own
points, once joined, are those of all points to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from granular.measure.averaging_grid import cells_of, sums_of
from granular.measure.profiles import scaled_inertial_number
from granular.theory.well_posed import ill_posedness

if TYPE_CHECKING:
    from granular.model.state import State
    from granular.model.typing import AnyScene
    from granular.tools.arrays import Array, BoolArray, IntArray

FLOWING = 1e-3
"""I/I0 from which a point flows; below it mu equals mu_s to 3e-4 and motion is noise."""

MOST_VOLUME = 2.0
"""Volume with which an ejected point counts at most [cells]; it may have any."""


@dataclass(frozen=True, eq=False)
class CellSums:
    """Sums of the points of a state over cells.

    Attributes
    ----------
    scene, time, step, dt, n
        Of the state; `n` is the number of points.
    cells : ndarray of int, shape (k,)
        Flat indices of the cells with points in the grid, sorted.
    of : dict
        Sums over these cells, shape (k,) or (k, m) for m materials: "mass"; "count" of points;
        "rest_section" and "section", the area in a 2D grid, in 3D the volume; "load", pressure
        times rest section; "free", mass of the stress-free points of grains by material;
        "held", number of points of bodies under stress; "flowing" and "ill_posed", masses;
        and masses of further points by the method.
    largest : dict
        Largest "speed" [m/s], and logarithms of density over rho_c, "compression" and "dilution".
    """

    scene: AnyScene
    time: float
    step: int
    dt: float
    n: int
    cells: IntArray
    of: Mapping[str, Array]
    largest: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def from_state(cls, state: State, marked: Mapping[str, BoolArray] | None = None) -> CellSums:
        """Sum the points of a state; `marked` are further points whose mass is summed.

        Raises
        ------
        ValueError
            If a point lies outside the grid.
        """
        given = state.scene, state.time, state.step, state.dt, state.n
        if not state.n:
            return cls(*given, np.empty(0, np.int64), {})
        flat = np.ravel_multi_index(tuple(cells_of(state).T), state.scene.grid.shape)
        cells, place = np.unique(flat, return_inverse=True)
        masses = ((name, state.mass * points) for name, points in (marked or {}).items())
        values = chain(_values(state), masses)
        sums = {name: sums_of(place, array, len(cells)) for name, array in values}
        largest = {
            "speed": float(np.sqrt(np.max(np.sum(np.asarray(state.v) ** 2, axis=1)))),
            "compression": max(float(np.max(state.log_density)), 0.0),
            "dilution": max(float(-np.min(state.log_density)), 0.0),
        }
        return cls(*given, cells, sums, largest)

    @classmethod
    def joined(cls, parts: Sequence[CellSums]) -> CellSums:
        """Join sums over different cells."""
        known = [part for part in parts if part.n]
        if not known:
            return parts[0]
        first, cells = known[0], np.concatenate([part.cells for part in known])
        order = np.argsort(cells, kind="stable")
        sums = {name: np.concatenate([p.of[name] for p in known])[order] for name in first.of}
        largest = {name: max(p.largest[name] for p in known) for name in first.largest}
        n = sum(part.n for part in known)
        return cls(first.scene, first.time, first.step, first.dt, n, cells[order], sums, largest)

    def share(self, name: str, of: str = "mass") -> float:
        """Share of one sum over all cells in another one; nan if that is 0."""
        total = float(self.of[of].sum())
        return float(self.of[name].sum()) / total if total > 0 else float("nan")


def _values(state: State) -> Iterator[tuple[str, ArrayLike]]:
    """Values of every point that are summed, one after the other."""
    pressure, mass = np.asarray(state.pressure, dtype=float), np.asarray(state.mass)
    yield "mass", mass
    yield "count", np.ones(state.n)
    yield "rest_section", state.rest_section
    most = MOST_VOLUME * state.scene.grid.cell**state.scene.grid.dim
    yield "section", np.minimum(state.section, most)
    yield "load", pressure * state.rest_section
    grains = state.of_material("granular") > 0
    yield "free", _by_material(state, mass * ((pressure == 0) & grains))
    held = np.asarray(state.stress).any(axis=1)
    yield "held", held if grains.all() else held & ~grains
    if any(_may_be_ill_posed(material) for material in state.scene.materials):
        flowing, ill = ill_posed_points(state)
        yield "flowing", mass * flowing
        yield "ill_posed", mass * ill


def _by_material(state: State, values: Array) -> Array:
    """Values by point and material, shape (n, m)."""
    count = len(state.scene.materials)
    number = np.asarray(getattr(state, "material", np.zeros(state.n)))
    return np.where(number[:, None] == np.arange(count), values[:, None], 0.0)


def _may_be_ill_posed(material: Any) -> bool:
    """True for mu(I) without dilation, of which `granular.theory.ill_posedness` decides."""
    return hasattr(material, "xi") and not getattr(material, "dilates", False)


def ill_posed_points(state: State) -> tuple[BoolArray, BoolArray]:
    """Points that flow, and those of them at which the mu(I) law is ill posed, shape (n,).

    Points of material that dilates, of which the criterion says nothing, are in neither.
    """
    scaled = scaled_inertial_number(state)
    flowing = scaled > FLOWING  # False for nan, which marks stress-free points
    number = np.asarray(getattr(state, "material", np.zeros(state.n)))
    ill = np.zeros(state.n, dtype=bool)
    for k, material in enumerate(state.scene.materials):
        mask = flowing & (number == k)
        if getattr(material, "dilates", False):
            flowing &= ~mask
        elif _may_be_ill_posed(material):
            ill[mask] = ill_posedness(scaled[mask], material, state.pressure[mask]) > 0
    return flowing, ill
