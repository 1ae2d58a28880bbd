"""Planes of symmetry that cut a scene, of which only one side is modelled, and axes of symmetry.

Measures return the forces and masses of the whole set-up, with their argument ``total`` False those
of the modelled part.
"""

from __future__ import annotations

from granular.model.grid import AXES
from granular.model.typing import AnyScene


def mirror_axes(scene: AnyScene) -> tuple[int, ...]:
    """Axes of the grid whose lower end is a plane of symmetry.

    They are named by the parameter ``symmetry`` of the scene ("y"); otherwise ``quarter`` means x
    and y, and ``half`` x.
    """
    given = scene.parameters
    planes = "xy" if given.get("quarter", False) else "x" if given.get("half", False) else ""
    return tuple(AXES.index(letter) for letter in given.get("symmetry", planes))


def modelled_share(scene: AnyScene) -> float:
    """Part of the whole set-up that a scene models: 1, or 1/2 or 1/4 between planes of symmetry."""
    return 0.5 ** len(mirror_axes(scene))


def refuse_rings(scene: AnyScene, name: str) -> None:
    """Raise ValueError for a measure that an axisymmetric grid does not have."""
    if scene.grid.axisymmetric:
        raise ValueError(
            f"{name} is not available in an axisymmetric grid: take a scene in a plane or in 3D"
        )
