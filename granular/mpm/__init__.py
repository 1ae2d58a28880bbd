"""The material point method: scene, scheme, walls and bodies, and the simulation that runs them."""

from granular.mpm.scene import Scene
from granular.mpm.simulation import Simulation

__all__ = ["Scene", "Simulation"]
