"""Scenes of the flow between cylinders, its profile and its moments."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self, cast

import numpy as np

from granular import measure, scenes
from granular.materials import NGF, couette_beads
from granular.model.state import State
from granular.mpm.scene import Scene
from granular.papers.haeri2021.document import EVERY, chosen_scheme, softened
from granular.papers.runs import Runs
from granular.record import Trajectory
from granular.theory.couette import CouetteFlow, couette_flow, couette_quasi_static
from granular.tools.arrays import Array

BEADS = cast(NGF, scenes.couette().material)
"""The beads with a hundredth of their moduli."""
LOW: dict[str, Any] = {"height": 0.024, "duration": 1.0}
"""A cell of a quarter of the document's height, with its rate."""
HIGH: dict[str, Any] = {"omega": 0.1, "duration": 1.1}
"""The document's cell at four times its rate; its 22 s would take ten hours of a core."""
COARSE: dict[str, Any] = {"height": 0.024, "cell": 0.012, "duration": 0.4}
LAYER = 2
"""Cells below the surface in which the profile is measured."""


def recorded_flow(runs: Runs, name: str, **changes: Any) -> Trajectory:
    """Record of the flow between cylinders in beads of the figure."""
    parts: dict[str, Any] = {"scheme": chosen_scheme(runs, scenes.couette().scheme)} | changes
    parts.setdefault("material", softened(runs, couette_beads))
    scene: Scene = scenes.couette(**parts)
    return runs.record(scene, name, every=EVERY, precision="single")


@dataclass(frozen=True)
class Window:
    """Flow in a time window.

    Attributes
    ----------
    time : float
        Its end [s].
    r, omega : ndarray, shape (k,)
        Radii of the rings [m] and their angular velocity [rad/s], at the top.
    moments : tuple of 2 floats
        Mean moments of the material on the inner and on the outer cylinder [N m].
    """

    time: float
    r: Array
    omega: Array
    moments: tuple[float, ...]

    @classmethod
    def measured(cls, before: State, after: State) -> Self:
        """Flow between two states."""
        scene = after.scene
        top = scene.parameters["height"] - LAYER * scene.grid.cell
        profile = measure.cylinder_profile((before, after), above=top)
        span = after.time - before.time
        moments = [
            float((now.angular_impulse - then.angular_impulse)[2] / span)
            for then, now in zip(before.bodies, after.bodies, strict=True)
        ]
        return cls(after.time, profile.r, profile.omega, tuple(moments))


@dataclass(frozen=True)
class CylinderFlow:
    """Flow at the top of a cell in the last third of its windows, and the flows of theory.

    Attributes
    ----------
    windows : tuple of Window
        All windows, in the order of time.
    r, omega : ndarray, shape (k,)
        Radii [m], and mean angular velocity of the last third over that of the inner cylinder.
    each : ndarray, shape (n, k)
        The same in the single windows of the last third.
    slow, driven : CouetteFlow
        In the limit of slow flow, and at the rate of the scene and the pressure of the layer.
    moment, moment_of_theory : float
        Mean moment with which the inner cylinder drives the material in the last third, and that of
        theory at the mean pressure [N m].
    """

    windows: tuple[Window, ...]
    r: Array
    omega: Array
    each: Array
    slow: CouetteFlow
    driven: CouetteFlow
    moment: float
    moment_of_theory: float

    @classmethod
    def measured(cls, states: Iterable[State]) -> Self:
        """Measure states of the scene `couette` in the order of time, two at a time."""
        scene, windows = None, []
        for before, after in pairwise(states):
            scene = after.scene
            windows.append(Window.measured(before, after))
        if scene is None:
            raise ValueError("states: a flow needs at least two")
        late = windows[-max(len(windows) // 3, 1) :]
        each = np.array([window.omega for window in late]) / scene.parameters["omega"]
        slow, driven, moment = _theory(cast(Scene, scene))
        return cls(
            windows=tuple(windows),
            r=late[0].r,
            omega=each.mean(axis=0),
            each=each,
            slow=slow,
            driven=driven,
            moment=-float(np.mean([window.moments[0] for window in late])),
            moment_of_theory=moment,
        )

    def errors(self, known: CouetteFlow, omega: Array | None = None) -> Array:
        """Error of the speed of each ring, over that of the inner cylinder.

        `omega` has the shape (..., k); by default it is the mean of the last third.
        """
        expected = np.interp(self.r, known.r, known.omega)
        turning = self.omega if omega is None else omega
        return np.abs(turning - expected) * self.r / known.r[0]


def _theory(scene: Scene) -> tuple[CouetteFlow, CouetteFlow, float]:
    """Slow flow, flow at the rate of the scene at its top, and the moment in all of it.

    A local law has the profile of the nonlocal one for comparison.
    """
    size, material = scene.parameters, cast(NGF, scene.material)
    weight = material.rho_c * size["gravity"]
    gap = size["inner"], size["outer"], material.replace(A=material.A or BEADS.A)
    driven, below = (
        couette_flow(*gap, rate=size["omega"], pressure=weight * depth, walls="smooth")
        for depth in (scene.grid.cell, size["height"] / 2)  # in the middle of either
    )
    moment = 2 * math.pi * size["inner"] ** 2 * below.mu_wall * weight * size["height"] ** 2 / 2
    return couette_quasi_static(*gap, walls="smooth"), driven, moment


def decay_length(r: Array, omega: Array, *, low: float = 0.02, high: float = 0.3) -> float:
    """Length over which an angular velocity falls by e between two values [m]; nan without it."""
    tail = (omega > low) & (omega < high)
    if tail.sum() < 2:
        return math.nan
    return float(-1 / np.polyfit(r[tail], np.log(omega[tail]), 1)[0])
