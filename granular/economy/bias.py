"""What softer grains change: laws from dimensionless numbers, prefactors measured.

docs/economy.md says where each law comes from and shows the runs behind the prefactors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from granular.materials import Material, MuI
from granular.mpm.limits import damps_by_step, height
from granular.mpm.scene import Scene
from granular.mpm.schemes import Scheme, default, dunatunga_kamrin_2015
from granular.theory import transient

__all__ = [
    "LAWS",
    "StiffnessLaw",
    "friction_shift",
    "grid_damping",
    "held_decay",
    "incline_error",
    "incline_resolution_error",
    "pressure_strain",
    "ramp_slip",
    "softening",
    "stiffness_error",
    "with_numbers_of_default",
]

RAMP_SLIP = 0.16
"""Velocity that a layer on an incline wins while gravity is switched on, over g h/c_w."""

RESOLUTION = 0.3
"""Error of the flow down an incline over (cell/height)^2."""

PROBE = 1e-4
"""Relative change of the friction by which the sensitivity of a flow is taken."""


@dataclass(frozen=True)
class StiffnessLaw:
    """``error = scatter + prefactor rho_c g H/K``, measured up to `largest` of that strain.

    Attributes
    ----------
    scatter : float
        What is left of it for stiff grains: how far runs differ that should be the same.
    prefactor : float
        Such that runs, or the means of several, do not differ more from the stiffest one, within
        their own uncertainty.
    largest : float
        Pressure strain of the softest of these runs: nothing is known beyond.
    held : bool
        Whether the rate of decay of the default scheme was held (`held_decay`).
    damping : float
        Largest damping (`grid_damping`) of a stiff scene that the soft runs agree with.
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
        ("column_collapse", "default"): StiffnessLaw(0.025, 5.0, 3.6e-3, damping=1.3),
        ("silo", "published"): StiffnessLaw(0.03, 2.8, 0.0177),
        ("silo", "default"): StiffnessLaw(0.015, 0.5, 0.0177, held=True, damping=0.19),
        ("hourglass", "published"): StiffnessLaw(0.03, 1.0, 4.5e-3),
        ("hourglass", "default"): StiffnessLaw(0.012, 2.3, 4.5e-3, damping=1.6),
        ("slug", "default"): StiffnessLaw(0.03, 2.0, 5.3e-3, held=True, damping=0.92),
    }
)
"""By the name of the scene function and of the scheme that is like the one measured. What is not
here was not measured, or did not settle: docs/economy.md."""


def with_numbers_of_default(scheme: Scheme) -> bool:
    """Whether a scheme is the default one, its steps aside."""
    return scheme.replace(cfl=default.cfl, dt=default.dt) == default


def kind(scheme: Scheme) -> str:
    """The scheme for which measurements of this one hold: "default", "published" or "" for none.

    The default scheme may have the rate of its decay held from stiffer grains (`held_decay`); with
    a fixed step it was not measured.
    """
    if scheme.density.name == "smoothed":
        own = (
            scheme.replace(tpic_decay=default.tpic_decay)
            if scheme.tpic_decay > default.tpic_decay
            else scheme
        )
        return "default" if scheme.dt is None and with_numbers_of_default(own) else ""
    plain = scheme.basis == "linear" and scheme.transfer == "flip" and not scheme.flip_decay
    return "published" if plain and scheme.mass_cutoff == dunatunga_kamrin_2015.mass_cutoff else ""


def gravity(scene: Scene) -> float:
    """Magnitude of gravity at the end of a run [m/s2]."""
    return float(np.linalg.norm(scene.gravity.at(scene.duration)))


def pressure_strain(scene: Scene, material: Material | None = None) -> float:
    """p/K at the foot of the material, with p = rho_c g H."""
    grains = scene.material if material is None else material
    return grains.rho_c * gravity(scene) * height(scene) / grains.K


def friction_shift(scene: Scene, material: Material) -> float:
    """Relative loss of friction of a soft layer in steady shear, averaged for its mean velocity.

    In steady shear the Jaumann rate holds a normal stress s_yy = -tau^2/G, so that the pressure
    is less than the weight, by (mu tau/G) of itself at depth z, tau = rho g z sin(angle). The
    mean velocity weighs depths by z^(3/2), which takes 5/7 of the value at the base.
    """
    angle = math.radians(float(scene.parameters["angle_deg"]))
    tau = material.rho_c * gravity(scene) * math.sin(angle) * height(scene)
    return 5 / 7 * math.tan(angle) * tau / material.G


def ramp_slip(scene: Scene, material: Material) -> float:
    """Velocity [m/s] that a layer wins from the waves of the gravity ramp, about g h/c_w.

    They lower its pressure for a time of h/c_w, in which gravity is not opposed.
    """
    return RAMP_SLIP * gravity(scene) * height(scene) / material.wave_speed


@lru_cache(maxsize=64)
def _flow(angle: float, depth: float, grains: MuI, g: float, ramp: float, end: float) -> float:
    """Mean velocity at the end of a run [m/s], by the one-dimensional equation."""
    return float(transient(angle, depth, grains, [end], g, ramp, cells=100).mean[-1])


def one_column(scene: Scene) -> bool:
    """Whether the incline is one column of cells in the plane."""
    return scene.parameters["columns"] == 1 and scene.dim == 2


def incline_flow(scene: Scene, *, weaker: float = 0.0) -> float:
    """Mean velocity [m/s] of a rigid layer at the end of a run, with friction less by a share."""
    grains = scene.material
    weak = grains.replace(mu_s=grains.mu_s * (1 - weaker), mu_2=grains.mu_2 * (1 - weaker))
    called = scene.parameters
    return _flow(
        float(called["angle_deg"]),
        float(called["height"]),
        weak.replace(E=1e9),  # of no account here; one entry for all of them
        float(called["gravity"]),
        float(called["ramp"]),
        scene.duration,
    )


def incline_error(scene: Scene, material: MuI) -> float:
    """Largest error of the mean velocity over the run, relative to its value at the end.

    The flow of a layer with as much less friction, by the one-dimensional equation, and the slip
    of the ramp. nan where the ramp is another than the one measured, and under schemes that do
    not follow the equation: whose damping depends on the step, or that lose the flow of several
    columns.
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
    """Error of the flow down an incline with cells of this size [m], for its mean velocity."""
    return RESOLUTION * (cell / height(scene)) ** 2


def stiffness_error(scene: Scene, name: str, material: Material) -> float:
    """Expected relative change of the quantity of interest from a material as stiff as grains.

    Parameters
    ----------
    scene : Scene
    name : str
        Name of its scene function.
    material : Material

    Returns
    -------
    float
        nan where nothing was measured, which was with the mu(I) law alone; inf beyond what was.
    """
    if not isinstance(material, MuI):
        return math.nan
    if name == "incline":
        return incline_error(scene, material)
    law = law_of(scene, name)
    return math.nan if law is None else law(pressure_strain(scene, material))


def law_of(scene: Scene, name: str) -> StiffnessLaw | None:
    """The law for a scene by the name of its function; None where nothing was measured."""
    scheme = scene.scheme
    law = LAWS.get((name, kind(scheme)))
    if law is None or grid_damping(scene) > law.damping:
        return None
    damped_more = scheme.density.name == "smoothed" and scheme.tpic_decay > default.tpic_decay
    return None if damped_more and not law.held else law


def grid_damping(scene: Scene) -> float:
    """decay c_w dx over H sqrt(g H): how fast motions of the size of cells die against the flow."""
    flow = height(scene) * math.sqrt(gravity(scene) * height(scene))
    return scene.scheme.tpic_decay * scene.material.wave_speed * scene.grid.cell / flow


def softening(scene: Scene, name: str, E: float) -> dict[str, float]:
    """What is changed to make the grains of a scene as soft as that, by name: the rate of decay is
    held where the law of its scene was measured so."""
    law = law_of(scene, name)
    return {"E": E} | (held_decay(scene, E) if law is not None and law.held else {})


def held_decay(scene: Scene, E: float) -> dict[str, float]:
    """The number of the scheme with which the rate of its own damping [1/s] stays as E changes.

    The rate of decay goes with c_w/dx: left alone, softer grains would be damped less, which moves
    the rate of a silo or the way of a slug more than their elasticity does.
    """
    scheme = scene.scheme
    if scheme.transfer != "tpic":
        return {}
    return {"tpic_decay": scheme.tpic_decay * math.sqrt(scene.material.E / E)}
