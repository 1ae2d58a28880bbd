"""Froude scaling: a scene at another size whose flow is the same at corresponding positions and
times.

Gravity and densities do not change. If lengths are multiplied by s, times and velocities scale with
sqrt(s), stresses (and so the moduli) with s, forces with s^3. Friction coefficients, strains and
the inertial number gdot d sqrt(rho/p) do not change if grains are scaled with the rest; the time
scale t0 of the fluidity scales with sqrt(s). The number of steps and of points is the same, so that
the cost is not reduced. The purpose is the comparison with physical models and with runs made at
another scale, such as those of Haeri & Skonieczny 2021 at a quarter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from granular import materials, shapes
from granular.materials.own import OwnLaw
from granular.model import regions, surfaces
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.model.inflow import Inflow
from granular.mpm import bodies as rigid
from granular.mpm.motion import Motion
from granular.mpm.scene import Scene
from granular.mpm.scheme_numbers import Numbers
from granular.mpm.schemes import DENSITIES, Fluidity, Scheme
from granular.mpm.walls import BOUNDARIES, SpongeLayer
from granular.tools.checks import check_fields, one_of, positive
from granular.tools.serializable import arguments_of

__all__ = ["POWERS", "Froude"]

POWERS = {
    "length": 1.0,
    "time": 0.5,
    "velocity": 0.5,
    "angular_velocity": -0.5,
    "rate": -0.5,
    "acceleration": 0.0,
    "density": 0.0,
    "stress": 1.0,
    "volume": 3.0,
    "mass": 3.0,
    "inertia": 5.0,
    "mass_rate": 2.5,
    "force": 3.0,
    "impulse": 3.5,
    "torque": 4.0,
    "angular_impulse": 4.5,
    "energy": 4.0,
    "power": 3.5,
    "none": 0.0,
}
"""Power of the ratio of lengths with which a quantity scales in 3D."""
_PLANE = (
    *("volume", "mass", "mass_rate", "inertia", "force", "impulse", "torque"),
    *("angular_impulse", "energy", "power"),
)
"""Quantities that are per metre of depth in 2D, where their power is less by one."""

_UNITS = {"1/s": "rate", "s": "time", "m/s": "velocity"}


def _of_units(kind: type[Numbers]) -> dict[str, str]:
    """Return the quantities of the numbers of a class from the units declared for them."""
    return {name: _UNITS[unit] for name, unit in kind.units.items() if unit != "1"}


_MATERIAL = {
    "E": "stress",
    "d": "length",
    "t0": "time",
    "contact_diameter": "length",
    "cohesion": "stress",
    "tensile_strength": "stress",
}
_SHAPE = dict.fromkeys(
    (
        *("lower", "upper", "size", "center", "through", "origin", "radius", "radii", "tube"),
        *("length", "thickness", "by", "vertices", "profile", "spacing", "z"),
    ),
    "length",
)
"""All that has a unit in a shape is a length."""
_QUANTITIES: dict[type, dict[str, str]] = {
    Grid: {"lower": "length", "cell": "length"},
    Fill: {"velocity": "velocity"},
    Inflow: {"velocity": "velocity", "rate": "mass_rate", "times": "time"},
    surfaces.Heights: {"z": "length", "lower": "length", "spacing": "length"},
    surfaces.Layer: {name: "length" for name in ("on", "thickness", "lower", "upper", "spacing")},
    regions.Mask: {"lower": "length", "spacing": "length"},
    regions.Cloud: {"x": "length", "volume": "volume", "velocity": "velocity"},
    # numbers of a user-defined law may be of any unit: such a scene is refused
    **{law: _MATERIAL for law in materials.Material.__subclasses__() if law is not OwnLaw},
    **{kind: _of_units(kind) for kind in (Fluidity, Scheme, *DENSITIES.values())},
    **{kind: kind.quantities for kind in BOUNDARIES},
    SpongeLayer: {"above": "length", "damping": "rate"},
    Gravity: {"times": "time"},
    **{s: _SHAPE for s in vars(shapes).values() if isinstance(s, type) and is_dataclass(s)},
    Motion: {"times": "time", "velocity": "velocity", "angular_velocity": "angular_velocity"},
    rigid.Body: {"position": "length", "mass": "mass", "inertia": "inertia"},
    Scene: {"duration": "time"},
}
"""Quantities of the fields of the parts of a scene; other fields are dimensionless or parts."""


@dataclass(frozen=True)
class Froude:
    """Ratio of the scaled world to the real one, between which flows are similar.

    Parameters
    ----------
    length : float
        Length in the scaled world over that in the real one, > 0. With 1/4 or another power of 4
        all factors are powers of 2, and a run gives the same digits.
    {raises}.
    """

    length: float

    def __post_init__(self) -> None:
        check_fields(self, positive, "length")

    def factor(self, quantity: str, *, dim: int = 3) -> float:
        """Ratio of a quantity in the scaled world to that in the real one.

        Parameters
        ----------
        quantity : str
            One of `POWERS`.
        dim : int
            2 for quantities per metre of depth.

        Raises
        ------
        ValueError
            For an unknown quantity or dimension.
        """
        power = POWERS[one_of("quantity", quantity, tuple(POWERS))]
        if one_of("dim", dim, (2, 3)) == 2 and quantity in _PLANE:
            power -= 1.0
        # Powers of the square root, so that powers of 4 give powers of 2 without rounding.
        return math.sqrt(self.length) ** round(2 * power)

    def real(self, quantity: str, value: ArrayLike, *, dim: int = 3) -> Any:
        """Convert a value measured in the scaled world, of any shape, to the real one.

        Raises
        ------
        ValueError
            As `factor`.
        """
        return (np.asarray(value, dtype=float) / self.factor(quantity, dim=dim))[()]

    def scene(self, scene: Scene) -> Scene:
        """Return the scene in the scaled world.

        Its `parameters` are those of the real scene, with ``froude_length`` in addition. Lengths
        must therefore be given to measures that would read them from the parameters.

        Raises
        ------
        TypeError
            If the units of the numbers of a part of the scene are not known, as those of a
            user-defined law.
        """
        if not isinstance(scene, Scene):
            raise TypeError(f"scene = {scene!r} must be a Scene")
        ratio = self.length * float(scene.parameters.get("froude_length", 1.0))
        parameters = dict(scene.parameters) | {"froude_length": ratio}
        return self._scaled(scene, scene.dim).replace(parameters=parameters)

    def _scaled(self, part: Any, dim: int) -> Any:
        """Return a part of a scene, scaled; values that are no dataclasses are left unchanged."""
        if isinstance(part, tuple):
            return tuple(self._scaled(entry, dim) for entry in part)
        if not is_dataclass(part):
            return part
        kind: Any = type(part)
        if kind not in _QUANTITIES:
            raise TypeError(f"{part!r} cannot be scaled: the units of its numbers are not known")
        values = arguments_of(part)
        if values.get("xi") is not None:
            values["xi"] /= self.length  # I0/(d sqrt(rho_s))
        if values.get("csl_slope"):  # of the pressure of the atmosphere, which is not scaled
            values["csl_slope"] /= self.length ** values["csl_exponent"]
        quantities = _QUANTITIES[kind]
        return kind(
            **{
                name: _times(value, self.factor(quantities[name], dim=dim))
                if name in quantities and not is_dataclass(value)
                else self._scaled(value, dim)
                for name, value in values.items()
            }
        )


def _times(value: Any, factor: float) -> Any:
    """Multiply a number or nested tuples of numbers by a factor; None stays None."""
    if value is None:
        return None
    if isinstance(value, tuple):
        return tuple(_times(entry, factor) for entry in value)
    return value * factor
