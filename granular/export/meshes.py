"""States as meshes of pyvista."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular.export.surfaces import placed_surface
from granular.measure.derived import STANDARD, check_derived, with_derived
from granular.model.state import State
from granular.tools.checks import instance
from granular.tools.extras import imported


def to_pyvista(state: State, fields: Collection[str] = STANDARD) -> Any:
    """Return a `pyvista.MultiBlock` of "material" and "gas" (points), "body0", "body1", ...

    Parameters
    ----------
    fields : collection of str
        Derived quantities besides the stored fields, of `granular.measure.derived`.

    Raises
    ------
    ModuleNotFoundError
        If pyvista is not installed: ``pip install 'granular-flow[pictures3d]'``.
    TypeError, ValueError
        If there is no such quantity, or the scene lacks the numbers that it needs.
    """
    instance("state", state, State)
    pyvista = imported("pyvista", "pictures3d")
    blocks = pyvista.MultiBlock()
    blocks["material"] = _cloud(pyvista, with_derived(state, check_derived("fields", fields)))
    if hasattr(state, "gas"):
        blocks["gas"] = _cloud(pyvista, state.gas.fields)
    for k, (body, pose) in enumerate(zip(state.scene.bodies, state.bodies, strict=True)):
        vertices, polygons = placed_surface(state.scene.grid, body, pose)
        faces = np.concatenate([(len(polygon), *polygon) for polygon in polygons])
        blocks[f"body{k}"] = pyvista.PolyData(vertices, faces)
    return blocks


def _cloud(pyvista: Any, fields: dict[str, NDArray[Any]]) -> Any:
    """Points with their fields; vectors have three components, as arrows need them."""
    if not len(fields["x"]):
        return pyvista.PolyData()
    cloud = pyvista.PolyData(_in_space(fields["x"]))
    dim = fields["x"].shape[1]
    for name, array in fields.items():
        if name != "x":
            is_vector = array.ndim == 2 and array.shape[1] == dim
            cloud[name] = _in_space(array) if is_vector else array
    return cloud


def _in_space(array: NDArray[Any]) -> NDArray[Any]:
    return np.pad(array, ((0, 0), (0, 3 - array.shape[1])))
