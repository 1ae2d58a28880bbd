"""States and records as tables of pandas, data sets of xarray and meshes of pyvista."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from granular.geometry import AXES
from granular.measure.derived import DERIVED, check_derived, with_derived
from granular.record.layout import RecordError

if TYPE_CHECKING:
    from granular.record.reader import Trajectory
    from granular.state import State

COMPONENTS = {2: ("xx", "yy", "zz", "xy"), 3: ("xx", "yy", "zz", "xy", "yz", "xz")}
QUATERNION = ("w", "x", "y", "z")
UNITS = {
    "x": "m", "v": "m/s", "a": "m/s2", "stress": "Pa", "mass": "kg", "shear_rate": "1/s",
    "log_density": "1", "porosity": "1", "g": "1/s",
} | {name: unit for name, (_, unit) in DERIVED.items()}  # fmt: skip


def needed(package: str, extra: str) -> Any:
    """Import a package that an extra brings."""
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error}: this needs {package}: pip install 'granular[{extra}]'"
        ) from error


def columns_of(name: str, count: int, dim: int) -> list[str]:
    """Names of the components of a field: v_x, stress_xy, x, or affine_0 and so on."""
    if count == dim:
        return [axis if name == "x" else f"{name}_{axis}" for axis in AXES[:dim]]
    if name == "stress":
        return [f"stress_{part}" for part in COMPONENTS[dim]]
    return [f"{name}_{k}" for k in range(count)]


def dataframe(state: State, fields: Collection[str]) -> Any:
    """Table of the points of a state; see `State.to_dataframe`."""
    pandas = needed("pandas", "tables")
    columns: dict[str, NDArray[Any]] = {}
    for name, array in with_derived(state, check_derived("fields", fields)).items():
        if array.ndim == 1:
            columns[name] = array
        else:
            names = columns_of(name, array.shape[1], state.dim)
            columns |= dict(zip(names, array.T, strict=True))
    table = pandas.DataFrame(columns).set_index("id")
    table.attrs.update(scene=state.scene.name, time=state.time, step=state.step)
    return table


def blocks(state: State, fields: Collection[str]) -> Any:
    """Material, gas and bodies of a state as meshes; see `State.to_pyvista`."""
    pyvista = needed("pyvista", "pictures3d")
    # Imported here: only these meshes need the surfaces.
    from granular.record.surfaces import placed_surface

    found = pyvista.MultiBlock()
    found["material"] = _cloud(pyvista, with_derived(state, check_derived("fields", fields)))
    if hasattr(state, "gas"):
        found["gas"] = _cloud(pyvista, state.gas.fields)
    for k, (body, pose) in enumerate(
        zip(getattr(state.scene, "bodies", ()), state.bodies, strict=True)
    ):
        vertices, polygons = placed_surface(state.scene.grid, body, pose)
        faces = np.concatenate([(len(polygon), *polygon) for polygon in polygons])
        found[f"body{k}"] = pyvista.PolyData(vertices, faces)
    return found


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


def dataset(record: Trajectory, fields: Collection[str]) -> Any:
    """Points, gas, bodies and samples of a record; see `Trajectory.to_xarray`."""
    xarray = needed("xarray", "tables")
    if not len(record):
        raise ValueError(f"record = {record!r} must have frames")
    names = check_derived("fields", fields)
    states = list(record)
    dim = states[0].dim
    variables = _stacked([with_derived(state, names) for state in states], "id", "", dim)
    coordinates: dict[str, Any] = {
        "time": ("time", record.times, {"units": "s"}),
        "id": variables.pop("id"),
        "axis": list(AXES[:dim]),
        "component": list(COMPONENTS[dim]),
    }
    if record.has_gas:
        gas = [state.gas.fields if hasattr(state, "gas") else {} for state in states]
        more = _stacked(gas, "gas_id", "gas_", dim)
        coordinates["gas_id"] = more.pop("gas_id")
        variables |= more
    if getattr(record.scene, "bodies", ()):
        variables |= _bodies(record)
        coordinates |= {"quaternion": list(QUATERNION), "space": list(AXES)}
    for name, values in record.samples.items():
        variables[f"sample_{name}"] = ("time", values)
    told = {"scene": record.scene.name, "file": str(record.path)}
    return xarray.Dataset(variables, coordinates, told)


def _stacked(frames: Sequence[dict[str, NDArray[Any]]], of: str, prefix: str, dim: int) -> dict:
    """Fields of all frames by the ids of points; nan where a frame has not the point."""
    ids = np.unique(np.concatenate([frame["id"] for frame in frames if frame]))
    found: dict[str, Any] = {of: (of, ids)}
    first = next(frame for frame in frames if frame)
    for name, array in first.items():
        if name == "id":
            continue
        whole = np.full((len(frames), len(ids), *array.shape[1:]), np.nan)
        for values, frame in zip(whole, frames, strict=True):
            if frame:
                values[np.searchsorted(ids, frame["id"])] = frame[name]
        dims = ["time", of]
        if array.ndim == 2:
            known = {dim: "axis", len(COMPONENTS[dim]): "component"}
            is_known = name == "stress" or array.shape[1] == dim
            dims.append(known[array.shape[1]] if is_known else f"{prefix}{name}_component")
        units = {"units": UNITS[name]} if name in UNITS else {}
        found[prefix + name] = (dims, whole, units)
    return found


def _bodies(record: Trajectory) -> dict[str, Any]:
    """Motion and impulses of the bodies at all frames."""
    from granular.mpm.bodies import split

    sizes = {4: "quaternion", 3: "space"}
    found: dict[str, Any] = {}
    for name, values in split(record.bodies, 3).items():
        more = [sizes[values.shape[2]]] if values.ndim == 3 else []
        found[f"body_{name}"] = (["time", "body", *more], values)
    if any(values.size == 0 for _, values in found.values()):
        raise RecordError(f"{record.path}: damaged record: no numbers of its bodies")
    return found
