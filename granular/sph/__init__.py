"""Smoothed particle hydrodynamics of a dilative viscoplastic material."""

from granular.sph.gas import Gas, GasState, Jet
from granular.sph.material import Viscoplastic, glass, grit
from granular.sph.numerics import Numerics
from granular.sph.rest import run_to_rest
from granular.sph.scene import Scene
from granular.sph.simulation import Simulation
from granular.sph.walls import Wall

__all__ = [
    "Gas",
    "GasState",
    "Jet",
    "Numerics",
    "Scene",
    "Simulation",
    "Viscoplastic",
    "Wall",
    "glass",
    "grit",
    "run_to_rest",
]
