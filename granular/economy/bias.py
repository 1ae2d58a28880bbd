"""Errors due to softer grains: laws in dimensionless numbers, with measured prefactors.

docs/reports/economy.md shows the runs from which the prefactors come.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import cast

import numpy as np

from granular.materials import Material, MuI
from granular.model.plausible import rounded
from granular.mpm.damping import velocity_decay
from granular.mpm.limits import damps_by_step, height
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme, default, dunatunga_kamrin_2015
from granular.theory import transient

RAMP_SLIP = 0.16
"""Velocity that a layer on an incline gains while gravity is switched on, divided by g h/c_w."""

RESOLUTION = 0.3
"""Error of the flow down an incline, divided by (cell/height)^2."""

PROBE = 1e-4
"""Relative change of the friction from which the sensitivity of a flow is computed."""


@dataclass(frozen=True)
class StiffnessLaw:
    """Error law ``error = scatter + prefactor rho_c g H/K`` of a scene and scheme.

    The strain rho_c g H/K was measured up to the value `largest`.

    Attributes
    ----------
    scatter : float
        Error that remains for stiff grains: the difference between runs that should agree.
    prefactor : float
        Chosen so large that runs (or means of several runs) differ from the stiffest one by no more
        than the law, within their own uncertainty.
    largest : float
        Pressure strain of the softest of these runs; the error beyond it is unknown.
    held : bool
        True if the decay rate of the default scheme was held constant (`held_decay`).
    damping : float
        Largest numerical damping (`grid_damping`) of a stiff scene with which the soft runs agree.
    """

    scatter: float
    prefactor: float
    largest: float
    held: bool = False
    damping: float = math.inf

    def __call__(self, strain: float) -> float:
        if strain > self.largest * (1 + 1e-6):
            return math.inf
        return self.scatter + self.prefactor * strain


LAWS: Mapping[tuple[str, str], StiffnessLaw] = MappingProxyType(
    {
        ("column_collapse", "published"): StiffnessLaw(0.12, 20.0, 3.6e-3),
        ("column_collapse", "default"): StiffnessLaw(0.04, 5.0, 3.6e-3, damping=1.3),
        ("silo", "published"): StiffnessLaw(0.03, 2.8, 0.0177),
        ("silo", "default"): StiffnessLaw(0.015, 0.5, 0.0177, held=True, damping=0.19),
        ("hourglass", "published"): StiffnessLaw(0.03, 1.0, 4.5e-3),
        ("hourglass", "default"): StiffnessLaw(0.012, 2.3, 4.5e-3, damping=1.6),
        ("slug", "default"): StiffnessLaw(0.03, 2.0, 5.3e-3, held=True, damping=0.92),
    }
)
"""Error laws by the names of the scene function and of the scheme that was measured. Cases that are
missing were not measured, or did not converge; see docs/reports/economy.md."""


def with_numbers_of_default(scheme: Scheme) -> bool:
    """True if a scheme is the default one, apart from its time step."""
    return scheme.replace(cfl=default.cfl, dt=default.dt) == default


def kind(scheme: Scheme) -> str:
    """Name of the scheme whose measurements apply to this one: "default", "published" or "".

    The default scheme may have the decay rate of stiffer grains (`held_decay`). With a fixed time
    step it was not measured.
    """
    if scheme.density.name == "smoothed":
        held = (
            scheme.replace(tpic_decay=default.tpic_decay)
            if scheme.tpic_decay > default.tpic_decay
            else scheme
        )
        return "default" if scheme.dt is None and with_numbers_of_default(held) else ""
    plain = scheme.basis == "linear" and scheme.transfer == "flip" and not scheme.flip_decay
    return "published" if plain and scheme.mass_cutoff == dunatunga_kamrin_2015.mass_cutoff else ""


def gravity(scene: Scene) -> float:
    """Magnitude of gravity at the end of a run [m/s2]."""
    return float(np.linalg.norm(scene.gravity.at(scene.duration)))


def pressure_strain(scene: Scene, material: Material | None = None) -> float:
    """Pressure strain p/K at the foot of the material, with p = rho_c g H."""
    grains = scene.material if material is None else material
    return grains.rho_c * gravity(scene) * height(scene) / grains.K


def friction_shift(scene: Scene, material: Material) -> float:
    """Relative loss of friction of a soft layer in steady shear, averaged for its mean velocity.

    In steady shear the Jaumann rate causes a normal stress s_yy = -tau^2/G, so that the pressure
    is lower than the weight by the fraction mu tau/G at depth z, with tau = rho g z sin(angle).
    The mean velocity weighs depths by z^(3/2), which gives 5/7 of the value at the base.
    """
    angle = math.radians(float(scene.parameters["angle_deg"]))
    tau = material.rho_c * gravity(scene) * math.sin(angle) * height(scene)
    return 5 / 7 * math.tan(angle) * tau / material.G


def ramp_slip(scene: Scene, material: Material) -> float:
    """Velocity [m/s] that a layer gains from the waves of the gravity ramp, about g h/c_w.

    The waves lower its pressure for a time of h/c_w, in which no friction opposes gravity.
    """
    return RAMP_SLIP * gravity(scene) * height(scene) / material.wave_speed


@lru_cache(maxsize=64)
def _flow(angle: float, depth: float, grains: MuI, g: float, ramp: float, end: float) -> float:
    """Mean velocity at the end of a run [m/s], by the one-dimensional equation."""
    return float(transient(angle, depth, grains, [end], g, ramp, cells=100).mean[-1])


@lru_cache(maxsize=64)
def _weakened(grains: MuI, weaker: float) -> MuI:
    """Material whose friction is reduced by the fraction `weaker`.

    E has no effect on a rigid layer: with a fixed value `_flow` solves once for all E.
    """
    mu_s, mu_2 = (mu * (1 - weaker) for mu in (grains.mu_s, grains.mu_2))
    return grains.replace(mu_s=mu_s, mu_2=mu_2, E=1e9)


def one_column(scene: Scene) -> bool:
    """True if the incline is one column of cells in 2D."""
    return scene.parameters["columns"] == 1 and scene.dim == 2


def incline_flow(scene: Scene, *, weaker: float = 0.0) -> float:
    """Mean velocity [m/s] of a rigid layer at the end of a run.

    The friction is reduced by the fraction `weaker`.
    """
    called = scene.parameters
    return _flow(
        float(called["angle_deg"]),
        float(called["height"]),
        _weakened(cast(MuI, scene.material), weaker),
        float(called["gravity"]),
        float(called["ramp"]),
        scene.duration,
    )


def incline_error(scene: Scene, material: MuI) -> float:
    """Largest error of the mean velocity over the run, relative to its value at the end.

    It is the sum of the change of the flow due to the lower friction, by the one-dimensional
    equation, and of the slip of the ramp. It is nan if the ramp differs from the measured one, and
    for schemes that do not follow the equation: those whose numerical damping depends on the time
    step, or that lose the flow of several columns.
    """
    if scene.parameters["ramp"] != 0.1:
        return math.nan
    scheme = scene.scheme
    if damps_by_step(scheme) or (scheme.density.name == "particle" and not one_column(scene)):
        return math.nan
    flow = incline_flow(scene)
    if flow <= 0.0:
        return math.nan
    slope = (incline_flow(scene, weaker=PROBE) / flow - 1) / PROBE
    return slope * friction_shift(scene, material) + ramp_slip(scene, material) / flow


def incline_resolution_error(scene: Scene, cell: float) -> float:
    """Relative error of the mean velocity down an incline with cells of this size [m]."""
    return RESOLUTION * (cell / height(scene)) ** 2


def stiffness_error(scene: Scene, name: str, material: Material) -> float:
    """Expected relative difference of the quantity of interest from that of stiff grains.

    Parameters
    ----------
    name : str
        Name of its scene function.

    Returns
    -------
    float
        nan where the error was not measured, such as with cohesion and for all laws but mu(I); inf
        beyond the measured range.
    """
    if not isinstance(material, MuI) or material.cohesion or len(scene.materials) > 1:
        return math.nan
    if name == "incline":
        return incline_error(scene, material)
    law = law_of(scene, name)
    return math.nan if law is None else law(pressure_strain(scene, material))


STIFFNESSES = (0.1, 1e10)
"""Least and largest E of the search, over rho g H."""


def softest(scene: Scene, error: Callable[[float], float], tolerance: float) -> float:
    """Smallest E [Pa] whose expected error is within a tolerance; nan if there is none."""
    load = scene.material.rho_c * gravity(scene) * height(scene)
    low, high = (load * ratio for ratio in STIFFNESSES)
    if not error(high) <= tolerance:
        return math.nan
    for _ in range(60):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if error(middle) <= tolerance else (middle, high)
    return rounded(high)


def law_of(scene: Scene, name: str) -> StiffnessLaw | None:
    """Error law for a scene, by the name of its function; None where it was not measured."""
    scheme = scene.scheme
    law = LAWS.get((name, kind(scheme)))
    if law is None or grid_damping(scene) > law.damping:
        return None
    damped_more = scheme.density.name == "smoothed" and scheme.tpic_decay > default.tpic_decay
    return None if damped_more and not law.held else law


def grid_damping(scene: Scene) -> float:
    """Ratio of decay c_w dx to H sqrt(g H): the numerical damping of motions at the size of the
    cells, compared with the flow."""
    flow = height(scene) * math.sqrt(gravity(scene) * height(scene))
    return velocity_decay(scene, gravity(scene)) * scene.grid.cell**2 / flow


def softening(scene: Scene, name: str, E: float) -> dict[str, float]:
    """Changes, by name, that reduce Young's modulus of a scene to `E` [Pa].

    The decay rate is held constant where the error law of the scene was measured so.
    """
    law = law_of(scene, name)
    return {"E": E} | (held_decay(scene, E) if law is not None and law.held else {})


def held_decay(scene: Scene, E: float) -> dict[str, float]:
    """Change of `tpic_decay` with which the decay rate of the scheme stays the same as E changes.

    The decay rate is tpic_decay c_w/dx [1/s] where that is above its least one. Without this change
    softer grains would have less numerical damping, which affects the rate of a silo or the path of
    a slug more than their elasticity does.

    Parameters
    ----------
    E : float
        New Young's modulus of the material [Pa], > 0.

    Returns
    -------
    dict
        ``{"tpic_decay": ...}``, changes for `Scheme.replace`; empty if the transfer is not "tpic".
    """
    scheme = scene.scheme
    if scheme.transfer != "tpic":
        return {}
    return {"tpic_decay": scheme.tpic_decay * math.sqrt(scene.material.E / E)}
