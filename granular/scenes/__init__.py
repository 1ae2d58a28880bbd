"""Ready-made scenes, with the numbers of the papers as defaults.

Each function is decorated with `scene_function`, which registers it under its name. Numbers of the
material may be given as keywords of each: ``column_collapse(E=1e7, mu_s=0.4)``.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from granular.scenes._registry import METHODS, SceneFunction, functions
from granular.scenes.cohesive_cliff import cohesive_cliff
from granular.scenes.column_collapse import column_collapse, cylinder_collapse
from granular.scenes.conveyor import conveyor
from granular.scenes.couette import couette
from granular.scenes.excavation import excavation, excavator
from granular.scenes.fed import chute_fed, conveyor_heap, silo_fed
from granular.scenes.files import SceneFile, changed, read_scene, template
from granular.scenes.flexible_barrier import flexible_barrier
from granular.scenes.hopper import hopper
from granular.scenes.hourglass import hourglass
from granular.scenes.incline import chute_ngf, incline
from granular.scenes.landslide import landslide
from granular.scenes.obstacle import obstacle
from granular.scenes.penetration import penetration
from granular.scenes.rolling_wheel import rolling_wheel
from granular.scenes.rotating_drum import rotating_drum
from granular.scenes.settling_bed import settling_bed
from granular.scenes.silo import clogging_silo, silo, silo_3d
from granular.scenes.slug import slug
from granular.scenes.soil_works import footing, retaining_wall, slope
from granular.scenes.sph_collapse import column_collapse_sph, inclined_collapse
from granular.scenes.sph_gas import fluidised_bed, jet_on_bed
from granular.scenes.sph_incline import incline_sph
from granular.scenes.sph_slump import slump_sph
from granular.scenes.sphere_drop import sphere_drop
from granular.scenes.tumbling_block import tumbling_block
from granular.scenes.wheel import wheel
from granular.tools.checks import one_of

__all__ = [
    "SceneFile",
    "SceneFunction",
    "changed",
    "chute_fed",
    "chute_ngf",
    "clogging_silo",
    "cohesive_cliff",
    "column_collapse",
    "column_collapse_sph",
    "conveyor",
    "conveyor_heap",
    "couette",
    "cylinder_collapse",
    "excavation",
    "excavator",
    "flexible_barrier",
    "fluidised_bed",
    "footing",
    "hopper",
    "hourglass",
    "incline",
    "incline_sph",
    "inclined_collapse",
    "jet_on_bed",
    "landslide",
    "names",
    "obstacle",
    "penetration",
    "read_scene",
    "registry",
    "retaining_wall",
    "rolling_wheel",
    "rotating_drum",
    "settling_bed",
    "silo",
    "silo_3d",
    "silo_fed",
    "slope",
    "slug",
    "slump_sph",
    "sphere_drop",
    "template",
    "tumbling_block",
    "wheel",
]

registry: Mapping[str, SceneFunction[..., Any]] = MappingProxyType(dict(sorted(functions.items())))
"""Scene functions by name; each has `methods`, the methods of solution of its scenes."""


def names(method: str | None = None) -> tuple[str, ...]:
    """Names of the ready scenes.

    Parameters
    ----------
    method : {"mpm", "sph"}, optional
        Method of solution; None for the scenes of all methods.

    Raises
    ------
    TypeError, ValueError
        If there is no such method.
    """
    if method is None:
        return tuple(registry)
    one_of("method", method, METHODS)
    return tuple(name for name, function in registry.items() if method in function.methods)
