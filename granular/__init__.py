"""Dense granular flow as a continuum through all its phases: heap, flow and gas."""

from granular import materials, measure, schemes, scenes, theory
from granular._core import build_info as show_config
from granular.scene import Scene
from granular.schemes import Scheme
from granular.simulation import Simulation, SimulationError
from granular.state import State
from granular.trajectory import Trajectory, open_trajectory
from granular.trajectory import open_trajectory as open

__version__ = "0.1.0"

__all__ = [
    "Scene",
    "Scheme",
    "Simulation",
    "SimulationError",
    "State",
    "Trajectory",
    "materials",
    "measure",
    "open",
    "open_trajectory",
    "scenes",
    "schemes",
    "show_config",
    "theory",
]
