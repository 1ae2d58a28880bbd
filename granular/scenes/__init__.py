"""Ready-made scenes, with the numbers of the papers as defaults; one function per file.

To add a scene, write a file with a function that takes keyword arguments only and returns a
`Scene`, and add the function to `_FUNCTIONS`.
"""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

from granular.scenes.chute_ngf import chute_ngf
from granular.scenes.clogging_silo import clogging_silo
from granular.scenes.column_collapse import column_collapse
from granular.scenes.couette import couette
from granular.scenes.cylinder_collapse import cylinder_collapse
from granular.scenes.excavation import excavation
from granular.scenes.excavator import excavator
from granular.scenes.hourglass import hourglass
from granular.scenes.incline import incline
from granular.scenes.silo import silo
from granular.scenes.silo_3d import silo_3d
from granular.scenes.slug import slug
from granular.scenes.sph_column_collapse import column_collapse_sph
from granular.scenes.sph_gas import fluidised_bed, jet_on_bed
from granular.scenes.sph_incline import incline_sph
from granular.scenes.sph_inclined_collapse import inclined_collapse
from granular.scenes.sph_slump import slump_sph
from granular.scenes.wheel import wheel
from granular.typing import AnyScene

__all__ = [
    "chute_ngf",
    "clogging_silo",
    "column_collapse",
    "column_collapse_sph",
    "couette",
    "cylinder_collapse",
    "excavation",
    "excavator",
    "fluidised_bed",
    "hourglass",
    "incline",
    "incline_sph",
    "inclined_collapse",
    "jet_on_bed",
    "names",
    "registry",
    "silo",
    "silo_3d",
    "slug",
    "slump_sph",
    "sph_registry",
    "wheel",
]

_FUNCTIONS = (
    *(column_collapse, silo, hourglass, incline, slug, cylinder_collapse),
    *(chute_ngf, clogging_silo),
    *(silo_3d, couette, excavation, wheel, excavator),
)

registry: MappingProxyType[str, Callable[..., AnyScene]] = MappingProxyType(
    {function.__name__: function for function in _FUNCTIONS}
)
"""Scene functions of the material point method by name."""

sph_registry: MappingProxyType[str, Callable[..., AnyScene]] = MappingProxyType(
    {
        "slump_sph": slump_sph,
        "incline_sph": incline_sph,
        "inclined_collapse": inclined_collapse,
        "fluidised_bed": fluidised_bed,
        "jet_on_bed": jet_on_bed,
    }
)
"""Scene functions for SPH alone, by name; `column_collapse` can be run with either method."""


def names() -> tuple[str, ...]:
    """Names of the ready-made MPM scenes."""
    return tuple(registry)
