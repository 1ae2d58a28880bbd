"""What is known to fail before a run: limits that are refused, settings that are warned of."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from granular.scene import Scene

__all__ = ["StabilityWarning", "check_time_step", "courant_limit", "dt_limit"]


class StabilityWarning(UserWarning):
    """A scene asks for what is known to go wrong without a word."""


COURANT_LIMIT = {"linear": 0.75, "ugimp": 0.75, "quadratic": 1.0}
"""Largest c dt/dx that was seen to be stable: beyond it a run fails without a NaN."""


def courant_limit(scene: Scene) -> float:
    """Largest stable (c + speed) dt/dx of the scene's scheme."""
    return COURANT_LIMIT[scene.scheme.basis]


def dt_limit(scene: Scene) -> float:
    """Largest stable time step at rest [s]: courant dx/c, c = sqrt((K + 4G/3)/rho_c)."""
    return courant_limit(scene) * scene.grid.cell / scene.material.wave_speed


def check_time_step(scene: Scene) -> None:
    """Refuse a time step beyond its limit.

    Raises
    ------
    ValueError
        Naming dt or cfl, its value and the limit.
    """
    scheme, limit = scene.scheme, dt_limit(scene)
    if scheme.dt is not None and scheme.dt > limit:
        raise ValueError(
            f"dt = {scheme.dt} must be <= {limit:.4g}, the limit of the {scheme.basis} basis with "
            f"cells of {scene.grid.cell} m and waves of {scene.material.wave_speed:.4g} m/s"
        )
    if scheme.dt is None and scheme.cfl > courant_limit(scene):
        raise ValueError(
            f"cfl = {scheme.cfl} must be <= {courant_limit(scene)} with the {scheme.basis} basis"
        )
