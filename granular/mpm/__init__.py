"""The material point method: scene, scheme, walls and bodies, and the simulation that runs them."""

from granular.mpm.bodies import Body, Motion
from granular.mpm.scene import Scene
from granular.mpm.schemes import Fluidity, Scheme
from granular.mpm.simulation import Simulation
from granular.mpm.walls import Solid, SpongeLayer, Wall

__all__ = [
    "Body",
    "Fluidity",
    "Motion",
    "Scene",
    "Scheme",
    "Simulation",
    "Solid",
    "SpongeLayer",
    "Wall",
]
