"""The material point method: scene, scheme, walls and bodies, and the simulation that runs them."""

from granular.mpm.bodies import Body, Motion
from granular.mpm.scene import Scene
from granular.mpm.schemes import (
    CellAveragedDensity,
    Fluidity,
    ParticleDensity,
    Scheme,
    SmoothedDensity,
)
from granular.mpm.simulation import Simulation
from granular.mpm.walls import Solid, SpongeLayer, Wall

__all__ = [
    "Body",
    "CellAveragedDensity",
    "Fluidity",
    "Motion",
    "ParticleDensity",
    "Scene",
    "Scheme",
    "Simulation",
    "SmoothedDensity",
    "Solid",
    "SpongeLayer",
    "Wall",
]
