"""Inflows of SPH: the checks against their scene, and their inlets in the core."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from granular import _core
from granular.model.grid import AXES
from granular.model.inflow import Inflow, InflowState, inlet_points, standing_points
from granular.tools.arrays import Array
from granular.tools.buffers import rows_of

if TYPE_CHECKING:
    from granular.sph.scene import Scene


Place = tuple[float, float, float]

FREE: tuple[Place, Place] = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
"""Ends of the box of an inlet of gas, which has none."""


def check_inflows(scene: Scene) -> None:
    """Refuse inflows that SPH does not have, or that do not fit their scene."""
    for i, inflow in enumerate(scene.inflows):
        name = f"inflows[{i}]"
        _check_kind(name, inflow, scene)
        inflow.check(name, scene.grid, scene.material.rho0)
        lower, upper = inflow.region.bounds
        length = upper[inflow.axis] - lower[inflow.axis]
        if length < 2.0 * scene.h * (1.0 - 1e-9):
            raise ValueError(
                f"{name}.region has the length {length:.4g} along {AXES[inflow.axis]}, must have "
                f"at least {2.0 * scene.h:.4g}, the reach of the kernel"
            )
        _check_free(scene, i, name)


def _check_kind(name: str, inflow: Inflow, scene: Scene) -> None:
    if not inflow.driven:
        raise ValueError(
            f"{name}.driven = False must be True: in SPH particles that enter need others behind "
            "them, which move with them"
        )
    if inflow.points_per_cell != 1:
        raise ValueError(f"{name}.points_per_cell = {inflow.points_per_cell} must be 1")
    if inflow.material is not None:
        raise ValueError(f"{name}.material must be None: SPH has one material")
    if inflow.density is not None or inflow.lithostatic:
        raise ValueError(f"{name} must have the density of the material and no weight on it")
    if inflow.rate is not None:
        area = inflow.area(scene.grid)
        speed = inflow.rate / (scene.material.rho0 * area) if area else math.nan
        raise ValueError(
            f"{name}.rate = {inflow.rate} must be None: particles have one mass, and this rate "
            f"follows from a velocity of {speed:.6g} m/s"
        )


def _check_free(scene: Scene, i: int, name: str) -> None:
    """Refuse a region that reaches into a wall, a fill or the region of another inflow."""
    x = standing_points(scene, i).x
    for j, wall in enumerate(scene.walls):
        low, high = wall.box(f"walls[{j}]", scene.grid)
        if ((x > low) & (x < high)).all(axis=1).any():
            raise ValueError(f"{name}.region must lie outside of walls[{j}]")
    others = [(f"fills[{j}]", fill.region) for j, fill in enumerate(scene.fills)]
    others += [(f"inflows[{j}]", other.region) for j, other in enumerate(scene.inflows) if j != i]
    for other, region in others:
        if region.contains(x).any():
            raise ValueError(f"{name}.region must not overlap that of {other}: it is full")


@dataclass(frozen=True)
class Inlets:
    """Inlets of an engine: first the inflows of a scene, then those of the gas.

    Attributes
    ----------
    masses : sequence of ndarray
        Masses of the particles that enter at the sites of each inlet [kg].
    """

    scene: Scene
    masses: tuple[Array, ...]

    @classmethod
    def add(cls, engine: _core.Sph, scene: Scene) -> Inlets:
        """Add the particles of the inflows of a scene and the gas of its jets."""
        masses = []
        for i, inflow in enumerate(scene.inflows):
            x = inlet_points(scene, i).x
            masses.append(np.full(len(x), scene.point_mass))
            _add(engine, inflow, x, masses[-1], scene.grid.cell, gas=False)
        for inflow, mass in scene.gas_inflows():
            x = inflow.entering(scene.grid, math.inf).x
            masses.append(np.full(len(x), mass))
            spacing = scene.grid.cell / inflow.points_per_axis
            _add(engine, inflow, x, masses[-1], spacing, gas=True)
        return cls(scene, tuple(masses))

    def __bool__(self) -> bool:
        return bool(self.masses)

    def entered(self, engine: _core.Sph) -> list[int]:
        """Number of particles that have entered by each inlet."""
        states, counts = engine.inflow()[1:], []
        for mass in self.masses:
            counts.append(int(states[0]))
            states = states[2 + 2 * len(mass) :]
        return counts

    def gas_entered(self, engine: _core.Sph) -> int:
        """Number of particles of gas that have entered."""
        return sum(self.entered(engine)[len(self.scene.inflows) :])

    def accounts(self, engine: _core.Sph) -> tuple[InflowState, ...]:
        """Accounts of the inflows of the scene."""
        scene, accounts = self.scene, []
        loads, entered = engine.inlet_loads(), self.entered(engine)
        gravity = np.array(scene.gravity.vectors[-1])
        for i, inflow in enumerate(scene.inflows):
            count, mass, velocity = entered[i], scene.point_mass, np.array(inflow.velocity)
            x = inlet_points(scene, i).x
            below = (np.array(scene.grid.lower) - x) @ gravity  # energy of 1 kg at each site
            of_site = count // len(x) + (np.arange(len(x)) < count % len(x))
            accounts.append(
                InflowState(
                    points=count,
                    missed=0,
                    mass=count * mass,
                    momentum=count * mass * velocity,
                    energy=0.5 * count * mass * float(velocity @ velocity),
                    height_energy=mass * float(of_site @ below),
                    impulse=loads[i, 3 : 3 + scene.dim].copy(),
                    work=float(loads[i, 6]),
                )
            )
        return tuple(accounts)


def _add(
    engine: _core.Sph, inflow: Inflow, x: Array, mass: Array, spacing: float, *, gas: bool
) -> None:
    vx, vy, vz = (*inflow.velocity, 0.0)[:3]
    v = np.broadcast_to(inflow.velocity, x.shape)
    rows = rows_of(engine, {"x": x, "v": v, "mass": mass}, len(x))
    box = _box(inflow) if not gas else FREE
    engine.add_inlet(rows, inflow.axis, (vx, vy, vz), spacing, *inflow.times, gas, *box)


def _box(inflow: Inflow) -> tuple[Place, Place]:
    """Ends of the region of an inflow, with three components."""
    (x, y, z), (X, Y, Z) = ((*end, 0.0)[:3] for end in inflow.region.bounds)
    return (x, y, z), (X, Y, Z)
