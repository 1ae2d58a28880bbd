"""The groups of a VTKHDF file of the kind PolyData, with steps in time."""

import h5py
import numpy as np

from granular.record.layout import TOPOLOGIES


def begin_poly_data(vtk: h5py.Group) -> None:
    """Mark a group as VTKHDF PolyData."""
    vtk.attrs["Version"] = np.array((2, 0), dtype="<i8")
    vtk.attrs.create("Type", np.bytes_("PolyData"), dtype=h5py.string_dtype("ascii", 8))


def write_vertices(vtk: h5py.Group, counts: np.ndarray) -> None:
    """Write one vertex cell per point; all frames share one table 0, 1, ... of the largest one."""
    most = int(counts.max(initial=0))
    for name, here, size in (("Vertices", counts, most), ("Lines", np.zeros_like(counts), 0)):
        group = vtk.create_group(name)
        group["NumberOfCells"] = here
        group["NumberOfConnectivityIds"] = group["NumberOfCells"]
        group["Connectivity"] = np.arange(size, dtype="<i8")
        group["Offsets"] = np.arange(size + 1, dtype="<i8")
    for name in TOPOLOGIES[2:]:
        vtk[name] = vtk["Lines"]  # equally empty: a second name of the same group


def write_steps(vtk: h5py.Group, times: np.ndarray, first_points: np.ndarray) -> h5py.Group:
    """Write the steps of PolyData: their times, and the first point of each; return the group."""
    steps = vtk.create_group("Steps")
    count = len(times)
    steps.attrs["NSteps"] = count
    steps["Values"] = times
    steps["PartOffsets"] = np.arange(count, dtype="<i8")
    steps["NumberOfParts"] = np.ones(count, dtype="<i8")
    steps["PointOffsets"] = first_points
    steps["CellOffsets"] = np.zeros((count, len(TOPOLOGIES)), dtype="<i8")
    steps["ConnectivityIdOffsets"] = steps["CellOffsets"]
    return steps
