"""The stiffness of ready scenes: it follows from their load, unless it is given."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from granular.materials import Material
from granular.model.plausible import STIFFEST, largest_load, rounded

LARGEST_SHARE = 1e-3
"""Largest pressure at the foot of a ready scene over E, the rule of the guide "Choose a stiffness".
A scene with softer grains by default, as in its paper, keeps the ratio that it has by default."""


def stiff_enough(function: Callable[..., Any], scene: Any, material: Any) -> Material | None:
    """Return a material as stiff as a scene requires, or None if it is stiff enough.

    Parameters
    ----------
    function : callable
        Function that made the scene, with its default material or numbers of it other than E.
    scene, material : Scene, Material
        The scene, and the material it was made with.
    """
    load, E = largest_load(scene)
    if not load > LARGEST_SHARE * E or not hasattr(material, "E"):
        return None
    share = max(LARGEST_SHARE, _default_share(function))
    needed = material.E * load / (share * E)
    if needed <= material.E or needed > STIFFEST:  # probably a wrong gravity or size
        return None
    stiffer: Material = material.replace(E=rounded(needed))
    return stiffer


@functools.cache
def _default_share(function: Callable[..., Any]) -> float:
    """Load over E of the scene that a function makes without arguments."""
    load, E = largest_load(function())
    return load / E
