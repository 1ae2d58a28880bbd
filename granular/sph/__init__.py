"""Smoothed particle hydrodynamics of a dilative viscoplastic material."""

from granular.sph.gas import Gas as Gas
from granular.sph.gas import GasState as GasState
from granular.sph.gas import Jet as Jet
from granular.sph.material import Viscoplastic as Viscoplastic
from granular.sph.material import glass as glass
from granular.sph.material import grit as grit
from granular.sph.numerics import Numerics as Numerics
from granular.sph.rest import run_to_rest as run_to_rest
from granular.sph.scene import Scene as Scene
from granular.sph.simulation import Simulation as Simulation
from granular.sph.walls import ParticleWall as ParticleWall
from granular.tools.docstrings import complete as _complete

_complete(__name__)
