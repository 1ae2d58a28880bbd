"""States and records for other programs: pandas, xarray, pyvista, ParaView."""

from granular.export.meshes import to_pyvista
from granular.export.surfaces import write_bodies
from granular.export.tables import to_pandas, to_xarray

__all__ = ["to_pandas", "to_pyvista", "to_xarray", "write_bodies"]
