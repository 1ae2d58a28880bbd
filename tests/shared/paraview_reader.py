"""The reader of ParaView, without ParaView: that of the vtk wheel."""

import numpy as np
import pytest


def paraview(path):
    """Yield time and data of every frame of a VTKHDF file; the data last until the next frame."""
    vtk = pytest.importorskip(
        "vtkmodules.vtkIOHDF", reason="needs the extra 'paraview' (the vtk wheel)"
    )
    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    for step in range(reader.GetNumberOfSteps()):
        reader.SetStep(step)
        reader.Update()
        yield reader.GetTimeValue(), reader.GetOutputDataObject(0)


def as_array(data):
    """NumPy array of an array of vtk."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    return np.asarray(vtk_to_numpy(data))
