"""Dense granular flow as a continuum through all its phases: heap, flow and gas."""

from importlib import import_module
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

if not any(Path(__file__).with_name(f"_core{suffix}").exists() for suffix in EXTENSION_SUFFIXES):
    raise ImportError(
        f"the folder {Path(__file__).parent} is source code without its compiled core and hides "
        "the installed package: run Python in another folder, or install with `pip install -e .`"
    )

import granular.mpm.simulation  # noqa: F401 (by which `Simulation` solves a `Scene`)
from granular import materials, ranks, shapes
from granular.materials import (
    NGF,
    DilatantMuI,
    DruckerPrager,
    Elastic,
    HardeningDruckerPrager,
    MuI,
    RegularisedMuI,
)
from granular.model.fill import Fill
from granular.model.gravity import Gravity
from granular.model.grid import Grid
from granular.model.inflow import Inflow
from granular.model.regions import Cloud, Mask
from granular.model.state import State
from granular.model.surfaces import Heights, Layer
from granular.mpm import bodies, scaling, schemes, stability
from granular.mpm.bodies import Body
from granular.mpm.motion import Motion
from granular.mpm.scene import Scene
from granular.mpm.schemes import (
    CellAveragedDensity,
    Fluidity,
    ParticleDensity,
    Scheme,
    SmoothedDensity,
)
from granular.mpm.walls import Solid, SpongeLayer, Wall
from granular.record import Trajectory, open_trajectory
from granular.record import open_trajectory as open
from granular.run import stop
from granular.run.diagnostics import StabilityWarning, scene_warnings
from granular.run.simulation import Simulation, SimulationError
from granular.run.sweeping import sweep
from granular.shapes import (
    Box,
    Capsule,
    Complement,
    Cylinder,
    Difference,
    Frustum,
    HalfSpace,
    HeightMap,
    Intersection,
    Mesh,
    Offset,
    Polygon,
    Prism,
    Revolve,
    Shell,
    Sphere,
    Torus,
    Union,
)
from granular.tools.buffers import show_config
from granular.tools.docstrings import complete as _complete
from granular.tools.notebook import pictures
from granular.tools.version import package_version

if TYPE_CHECKING:
    from granular import (
        calibrate,
        economy,
        export,
        grain_scale,
        measure,
        papers,
        plot,
        scenes,
        sph,
        theory,
    )

    __version__: str

LATER = (
    "calibrate",
    "economy",
    "export",
    "grain_scale",
    "measure",
    "papers",
    "plot",
    "ranks",
    "scenes",
    "sph",
    "theory",
)
"""Subpackages that are imported when they are used first: some take longer than a small run."""


def _picture_of_scene(scene: Any) -> Any:
    """Picture of a scene in a notebook; matplotlib is imported with the first."""
    from granular.plot.scene import scene as draw

    return draw(scene)


pictures["scene"] = _picture_of_scene
_complete(__name__)


def __getattr__(name: str) -> ModuleType | str:
    if name in LATER:
        return import_module(f"granular.{name}")
    if name == "__version__":
        return package_version()
    raise AttributeError(f"module 'granular' has no attribute {name!r}")


__all__ = [
    "NGF",
    "Body",
    "Box",
    "Capsule",
    "CellAveragedDensity",
    "Cloud",
    "Complement",
    "Cylinder",
    "Difference",
    "DilatantMuI",
    "DruckerPrager",
    "Elastic",
    "Fill",
    "Fluidity",
    "Frustum",
    "Gravity",
    "Grid",
    "HalfSpace",
    "HardeningDruckerPrager",
    "HeightMap",
    "Heights",
    "Inflow",
    "Intersection",
    "Layer",
    "Mask",
    "Mesh",
    "Motion",
    "MuI",
    "Offset",
    "ParticleDensity",
    "Polygon",
    "Prism",
    "RegularisedMuI",
    "Revolve",
    "Scene",
    "Scheme",
    "Shell",
    "Simulation",
    "SimulationError",
    "SmoothedDensity",
    "Solid",
    "Sphere",
    "SpongeLayer",
    "StabilityWarning",
    "State",
    "Torus",
    "Trajectory",
    "Union",
    "Wall",
    "bodies",
    "calibrate",
    "economy",
    "export",
    "grain_scale",
    "materials",
    "measure",
    "open",
    "open_trajectory",
    "papers",
    "plot",
    "ranks",
    "scaling",
    "scene_warnings",
    "scenes",
    "schemes",
    "shapes",
    "show_config",
    "sph",
    "stability",
    "stop",
    "sweep",
    "theory",
]
