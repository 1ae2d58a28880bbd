"""Dense granular flow as a continuum through all its phases: heap, flow and gas."""

from importlib import import_module
from types import ModuleType

from granular import (
    bodies,
    dem,
    economy,
    friction_law,
    froude,
    inference,
    material_points,
    materials,
    measure,
    scenes,
    schemes,
    sph,
    theory,
)
from granular.engine import show_config
from granular.scene import Scene
from granular.schemes import Scheme
from granular.simulation import Simulation, SimulationError
from granular.stability import StabilityWarning
from granular.state import State
from granular.sweeping import sweep
from granular.trajectory import Trajectory, open_trajectory
from granular.trajectory import open_trajectory as open

__version__ = "0.1.0"


def __getattr__(name: str) -> ModuleType:
    if name == "plot":  # matplotlib takes longer to import than a small scene to run
        return import_module("granular.plot")
    raise AttributeError(f"module 'granular' has no attribute {name!r}")


__all__ = [
    "Scene",
    "Scheme",
    "Simulation",
    "SimulationError",
    "StabilityWarning",
    "State",
    "Trajectory",
    "bodies",
    "dem",
    "economy",
    "friction_law",
    "froude",
    "inference",
    "material_points",
    "materials",
    "measure",
    "open",
    "open_trajectory",
    "plot",
    "scenes",
    "schemes",
    "show_config",
    "sph",
    "sweep",
    "theory",
]
