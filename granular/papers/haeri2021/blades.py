"""Scenes of a blade in soil, its forces, and the soil that it moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self, cast

import numpy as np

from granular import measure, scenes
from granular.materials import NGF, DruckerPrager
from granular.measure.soil_tools import FailureSurface
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.papers.haeri2021.document import EVERY, chosen_scheme, soft_soil
from granular.papers.runs import Runs
from granular.record import Trajectory
from granular.tools.arrays import Array, BoolArray

SOIL = cast(NGF, scenes.excavation().material)
"""GRC-1 with a hundredth of its Young's modulus."""
BED = {"length": 0.65, "width": 0.7, "start": 0.25, "travel": 0.1, "cell": 0.0125}
"""Bed as wide as the document's, and so long that the wedge before the blade does not fill it."""
WAY = {"length": 1.6, "start": 0.3, "travel": 0.64}
"""Bed and way of the document, which take 20 s."""
WIDTH = 0.305
"""Width of the blade [m]; forces between walls 0.05 m apart are scaled to it."""
THIN = {"width": 0.05, "blade": (0.006, 0.05, 0.457)}
"""Blade from wall to wall, as between glass walls, so that nothing depends on y."""
THICK = {"width": 0.05, "blade": (0.025, 0.05, 0.457), "scheme": scenes.wheel().scheme}
"""The same two of the default cells thick, so that no scheme need separate its two sides."""
FINE = {"cell": BED["cell"] / 1.5}
QUICK = {"speed": 0.2, "dive_speed": 0.1}
"""Five times the speed; cells of quick figures are at least twice as large as `BED` has, too."""
ARRIVED = 0.5
"""Time at depth over which forces with different cells are compared [s]."""
MOVING = 0.1
"""Share of the blade's speed from which soil moves."""
LATE = 0.5
"""Time before the end over which the speed of the soil is averaged [s]."""


def blade_scene(depth: float, **changes: Any) -> Scene:
    """Scene without the way out, for the force while the blade dives and moves forward."""
    scene = scenes.excavation(**(BED | {"depth": depth} | changes))
    return scene.replace(duration=end_of_way(scene))


def recorded_blade(runs: Runs, depth: float, name: str, **changes: Any) -> Trajectory:
    """Record of a blade that dives and moves forward."""
    parts: dict[str, Any] = {"scheme": scenes.excavation().scheme} | changes
    parts["scheme"] = chosen_scheme(runs, parts["scheme"])
    parts.setdefault("material", soft_soil(runs))
    if runs.quick:
        parts |= QUICK | {"cell": 2 * max(parts.get("cell", 0.0), BED["cell"])}
    return runs.record(blade_scene(depth, **parts), name, every=EVERY, precision="single")


def end_of_way(scene: Scene) -> float:
    """Time at which the blade has moved forward by its whole way [s]."""
    known = scene.parameters
    down, forward = known["depth"] / known["dive_speed"], known["travel"] / known["speed"]
    return float(known["settle"] + down + forward)


def plastic(soil: NGF) -> DruckerPrager:
    """Drucker-Prager with the elasticity and the static friction of a soil."""
    same = {"E": soil.E, "nu": soil.nu, "rho_c": soil.rho_c, "rho_s": soil.rho_s}
    return DruckerPrager(**same, mu=soil.mu_s, elasticity="hencky")


@dataclass(frozen=True)
class BladeForces:
    """Forces on a blade over time, averaged between frames.

    Attributes
    ----------
    times, height : ndarray, shape (k,)
        Middles of the windows [s], and elevation of the edge [m].
    forward, vertical, lateral : ndarray, shape (k,)
        Forces [N] on the width of the blade, as of `granular.measure.soil_tools.tool_force`.
    """

    times: Array
    height: Array
    forward: Array
    vertical: Array
    lateral: Array

    @classmethod
    def measured(cls, record: Trajectory) -> Self:
        """Forces of a record."""
        force = measure.soil_tools.tool_force(record)
        return cls(force.times, force.position[:, 2], force.forward, force.vertical, force.lateral)

    def scaled(self, factor: float) -> BladeForces:
        """The same on a blade so many times as wide."""
        parts = (factor * part for part in (self.forward, self.vertical, self.lateral))
        return BladeForces(self.times, self.height, *parts)

    @property
    def level(self) -> BoolArray:
        """Windows in which the blade is at its depth."""
        deepest = self.height.min()
        return self.height - deepest < 0.01 * abs(deepest)

    def means(self) -> dict[str, float]:
        """Mean forces at depth, and standard deviations of two of them [N]."""
        at = self.level
        return {
            "forward": float(self.forward[at].mean()),
            "vertical": float(self.vertical[at].mean()),
            "lateral": float(self.lateral[at].mean()),
            "deviation": float(self.forward[at].std()),
            "lateral_deviation": float(self.lateral[at].std()),
        }

    def arrival(self) -> tuple[float, float]:
        """Mean forward and vertical force just after the blade has reached its depth [N]."""
        at = self.level
        early = at & (self.times < self.times[at][0] + ARRIVED)
        return float(self.forward[early].mean()), float(self.vertical[early].mean())


def forces_on_width(record: Trajectory) -> BladeForces:
    """Forces of a record, scaled to the document's blade if it is one between walls."""
    width = record.scene.parameters["blade"][1]
    return BladeForces.measured(record).scaled(WIDTH / width)


def coulomb(soil: NGF, depth: float) -> float:
    """Passive force of Coulomb on an upright blade in a level bed [N]: tan(phi) = mu_s, a friction
    of the blade of 30 degrees."""
    phi, wall = math.atan(soil.mu_s), math.radians(30.0)
    root = math.sqrt(math.sin(phi + wall) * math.sin(phi) / math.cos(wall))
    return 0.5 * soil.rho_c * 9.81 * depth**2 * WIDTH * (math.cos(phi) / (1 - root)) ** 2


@dataclass(frozen=True)
class MovedSoil:
    """Soil before a blade at the end of its way.

    Attributes
    ----------
    state : State
        Last state.
    speed : ndarray, shape (n,)
        Speed of its points [m/s], averaged over `LATE`.
    blade : ndarray, shape (3,)
        Position of the edge of the blade [m].
    surface : FailureSurface
        Lower boundary of the cells that move, averaged likewise.
    """

    state: State
    speed: Array
    blade: Array
    surface: FailureSurface

    @classmethod
    def measured(cls, record: Trajectory, span: tuple[float, float] | None = None) -> Self:
        """Soil of a record up to the end of the way, in a slice along y (by default all of it)."""
        known, end = record.scene.parameters, end_of_way(cast(Scene, record.scene))
        last = int(np.argmin(np.abs(record.times - end)))
        late = np.flatnonzero(record.times >= record.times[last] - LATE - 1e-9)
        states = [record[int(i)] for i in late if i <= last]
        surface = measure.soil_tools.failure_surface(
            states, speed=known["speed"], share=MOVING, span=span
        )
        speed = np.mean([state.speed for state in states], axis=0)  # no point leaves
        return cls(states[-1], speed, measure.body_motion(record).position[last], surface)

    @property
    def before(self) -> BoolArray:
        """Columns of cells before the blade in which soil moves."""
        surface = self.surface
        return (surface.x > self.blade[0]) & ~np.isnan(surface.z)

    def area(self) -> float:
        """Area of the moving soil before the blade, in the plane of its way [m2]."""
        surface, at = self.surface, self.before
        return float(np.sum(surface.top[at] - surface.z[at]) * self.state.scene.grid.cell)

    def reach(self) -> float:
        """Distance from the blade to the farthest column whose surface moves [m]."""
        return float(self.surface.x[self.before].max(initial=self.blade[0]) - self.blade[0])

    def heap(self) -> float:
        """Height of the highest dense point before the blade above the bed [m]."""
        x = self.state.x[self.state.dense]
        return float(x[x[:, 0] > self.blade[0], 2].max())
