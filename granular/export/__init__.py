"""States and records for other programs: pandas, xarray, pyvista, ParaView."""

from granular.export.meshes import to_pyvista as to_pyvista
from granular.export.surfaces import write_bodies as write_bodies
from granular.export.tables import to_dataframe as to_dataframe
from granular.export.tables import to_xarray as to_xarray
from granular.tools.docstrings import complete as _complete

_complete(__name__)
