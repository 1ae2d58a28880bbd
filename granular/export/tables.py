"""States as tables of pandas, and records as data sets of xarray."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular.measure.body import BodyMotion
from granular.measure.derived import DERIVED, STANDARD, check_derived, with_derived
from granular.model.grid import AXES
from granular.model.state import State
from granular.mpm.bodies import split
from granular.record.layout import RecordError
from granular.record.reader import Trajectory
from granular.tools.checks import instance
from granular.tools.extras import imported

COMPONENTS = {2: ("xx", "yy", "zz", "xy"), 3: ("xx", "yy", "zz", "xy", "yz", "xz")}
QUATERNION = ("w", "x", "y", "z")
UNITS = {
    "x": "m", "v": "m/s", "a": "m/s2", "stress": "Pa", "mass": "kg", "shear_rate": "1/s",
    "log_density": "1", "porosity": "1", "g": "1/s",
} | {name: unit for name, (_, unit) in DERIVED.items()}  # fmt: skip
BODY_UNITS = {name: BodyMotion.UNITS[name] for name in BodyMotion.UNITS if name != "times"}
WITH_DEPTH = {"kg": "kg/m", "m3": "m2"}
"""Units of what is per metre of depth in 2D."""


def unit_in(dim: int, unit: str) -> str:
    """Unit in this dimension, of one that names that of 2D, or of a quantity of points."""
    whole, _, plane = unit.removesuffix(" in 2D").partition("; ")
    return (plane or WITH_DEPTH.get(whole, whole)) if dim == 2 else whole


def columns_of(name: str, count: int, dim: int) -> list[str]:
    """Names of the components of a field: v_x, stress_xy, x, or affine_0 and so on."""
    if count == dim:
        return [axis if name == "x" else f"{name}_{axis}" for axis in AXES[:dim]]
    if name == "stress":
        return [f"stress_{part}" for part in COMPONENTS[dim]]
    return [f"{name}_{k}" for k in range(count)]


def to_dataframe(state: State, fields: Collection[str] = STANDARD) -> Any:
    """Return a `pandas.DataFrame` of a state with one row per point, indexed by id.

    Its columns are the stored fields, x, y, v_x, stress_xy and so on, and derived quantities.
    Its `attrs` are the name of the scene, time, step, and the units of the columns.

    Parameters
    ----------
    fields : collection of str
        Derived quantities, of `granular.measure.derived`.

    Raises
    ------
    ModuleNotFoundError
        If pandas is not installed: ``pip install 'granular-flow[tables]'``.
    TypeError, ValueError
        If there is no such quantity, or the scene lacks the numbers that it needs.
    """
    instance("state", state, State)
    pandas = imported("pandas", "tables")
    columns: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    for name, array in with_derived(state, check_derived("fields", fields)).items():
        names = [name] if array.ndim == 1 else columns_of(name, array.shape[1], state.dim)
        columns |= dict(zip(names, array.T.reshape(len(names), -1), strict=True))
        if name in UNITS:
            units |= dict.fromkeys(names, unit_in(state.dim, UNITS[name]))
    table = pandas.DataFrame(columns).set_index("id")
    table.attrs.update(scene=state.scene.name, time=state.time, step=state.step, units=units)
    return table


def to_xarray(record: Trajectory, fields: Collection[str] = STANDARD) -> Any:
    """Return a `xarray.Dataset` of the frames of a record, all in memory.

    Each variable that has a unit has it as its attribute "units". Fields of points have the
    dimensions time and id, and are nan where a point has left; those of a
    gas begin with "gas_", the motion and impulses of bodies with "body_", and the samples of the
    monitor with "sample_". For a part of the frames, slice the record.

    Parameters
    ----------
    fields : collection of str
        Derived quantities besides the stored fields, of `granular.measure.derived`.

    Raises
    ------
    ModuleNotFoundError
        If xarray is not installed: ``pip install 'granular-flow[tables]'``.
    TypeError, ValueError
        If there are no frames or no such quantity, or the scene lacks the numbers that it needs.
    """
    instance("record", record, Trajectory)
    xarray = imported("xarray", "tables")
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
    if record.scene.bodies:
        variables |= _bodies(record)
        coordinates |= {"quaternion": list(QUATERNION), "space": list(AXES)}
    for name, values in record.samples.items():
        variables[f"sample_{name}"] = ("time", values)
    attributes = {"scene": record.scene.name, "file": str(record.path)}
    return xarray.Dataset(variables, coordinates, attributes)


def _stacked(frames: Sequence[dict[str, NDArray[Any]]], of: str, prefix: str, dim: int) -> dict:
    """Fields of all frames by the ids of points; nan where a frame does not have the point."""
    ids = np.unique(np.concatenate([frame["id"] for frame in frames if frame]))
    variables: dict[str, Any] = {of: (of, ids)}
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
        units = {"units": unit_in(dim, UNITS[name])} if name in UNITS else {}
        variables[prefix + name] = (dims, whole, units)
    return variables


def _bodies(record: Trajectory) -> dict[str, Any]:
    """Motion and impulses of the bodies at all frames."""
    sizes = {4: "quaternion", 3: "space"}
    variables: dict[str, Any] = {}
    for name, values in split(record.bodies, 3).items():
        more = [sizes[values.shape[2]]] if values.ndim == 3 else []
        unit = BODY_UNITS.get(name, "")
        units = {"units": unit_in(record.scene.dim, unit)} if unit else {}
        variables[f"body_{name}"] = (["time", "body", *more], values, units)
    if any(values.size == 0 for _, values, _ in variables.values()):
        raise RecordError(f"{record.path}: damaged record: no numbers of its bodies")
    return variables
