"""From a scene to an engine of the C core: the one place that speaks the core's language."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.geometry import seed_points
from granular.materials import NGF
from granular.mpm.cell_codes import cell_flags, fluidity_faces
from granular.mpm.limits import check_blades, check_overlaps, check_time_step
from granular.mpm.node_codes import WallRow, c0_lines, node_codes
from granular.mpm.scene import Scene

__all__ = [
    "allocate",
    "build",
    "default_isa",
    "initial_buffers",
    "initial_points",
    "show_config",
]

CORE = _core.enumerations()
PAGE, LINE = 4096, 64  # bytes
UNBOUNDED = 1e300
LOCAL_PHASE = 10.0
"""Length of the local phase of a nonlocal law without an initial fluidity, in its t0."""


def default_isa() -> str:
    """Instruction set that is asked for by the environment; empty: the best of the machine."""
    return os.environ.get("GRANULAR_ISA", "")


def show_config() -> _core.BuildInfo:
    """What the build is: compiler, flags, OpenMP, and the instruction set a simulation would use.

    Raises
    ------
    ValueError
        If the environment variable GRANULAR_ISA asks for a set that this machine has not.
    """
    return _core.build_info(default_isa())


def _numbers(scene: Scene, mean_mass: float, half_extent: float) -> dict[str, float]:
    return {
        "dx": scene.grid.cell,
        "half_extent": half_extent,
        "rho_c": scene.material.rho_c,
        "wave_speed": scene.material.wave_speed,
        "mean_mass": mean_mass,
    }


def _density_numbers(scene: Scene) -> dict[str, float]:
    """Those of the density, two of them as the core takes them."""
    numbers = scene.scheme.density.numbers()
    if "relaxation_limit" in numbers:
        numbers["relaxation_limit"] = _relaxation_limit(scene)
    if not scene.material.granular:  # what bears tension is never disconnected
        numbers["separation_strain"] = UNBOUNDED
    return numbers


def _fluidity_numbers(scene: Scene) -> dict[str, float]:
    fluidity = scene.scheme.fluidity
    return {
        "begins_at": _local_phase(scene),
        "tolerance": fluidity.tolerance,
        "floor": fluidity.floor,
        "substeps": float(fluidity.substeps),
    }


def _local_phase(scene: Scene) -> float:
    """Time [s] from which a nonlocal law diffuses its fluidity."""
    given = scene.scheme.fluidity.initial is not None
    return 0.0 if given or not isinstance(scene.material, NGF) else LOCAL_PHASE * scene.material.t0


def _parameters(scene: Scene) -> dict[str, float]:
    """The numbers of the law by their names in the core, and others of the material."""
    material = scene.material
    numbers = material.arguments() | {"K": material.K, "G": material.G}
    if hasattr(material, "xi"):
        numbers["xi"] = material.xi
    if isinstance(material, NGF):
        averaging = scene.scheme.fluidity.pressure_averaging
        if averaging is None:
            layers = 1 if scene.scheme.basis == "linear" else scene.fills[0].points_per_axis
            averaging = 0.5 / layers
        numbers |= material.core_friction()
        # Along an axis: a layer on a slope is held by what gravity has across it.
        across = float(np.abs(scene.gravity.vectors).max())
        layer = material.rho_c * across * scene.grid.cell
        numbers["p_averaging"] = averaging * layer
        numbers["reconnect_fluidity"] = float(scene.scheme.fluidity.reconnect_fluidity)
    return numbers


def largest_gravity(scene: Scene) -> float:
    """Largest gravity of a scene [m/s2]."""
    return float(np.linalg.norm(scene.gravity.vectors, axis=1).max())


def averaging_interval(scene: Scene) -> int:
    """Steps between two averagings of the density."""
    scheme = scene.scheme
    if scheme.density.name != "smoothed":
        return 1
    crossing = scene.grid.cell / scene.material.wave_speed
    dt = scheme.dt or scheme.cfl * crossing
    return max(round(scheme.density.averaging_time * crossing / dt), 1)


def _relaxation_limit(scene: Scene) -> float:
    """Largest rate of log-density [1/s] by the relaxation: eps g/c_w, g the largest gravity."""
    g = largest_gravity(scene)
    return scene.scheme.density.relaxation_limit * g / scene.material.wave_speed if g else UNBOUNDED


def _sponge_layers(scene: Scene) -> tuple[tuple[float, float], ...]:
    """Along each axis, where the sponge begins [m], and its rate [1/s]."""
    found = {a.axis: (a.above, a.damping) for a in scene.sponge_layers}
    return tuple(found.get(axis, (math.inf, 0.0)) for axis in range(scene.grid.dim))


def _row(row: WallRow) -> tuple[int, float, int, int, float, int]:
    return (row.fixed, row.friction, row.normal, row.side, row.opens_at, row.after)


def build(scene: Scene, mean_mass: float, isa: str = "") -> _core.Engine:
    """The engine of a scene, still without points.

    Raises
    ------
    ValueError
        If the time step is beyond its limit, or the scheme cannot be built.
    """
    check_time_step(scene)
    check_blades(scene)
    check_overlaps(scene)
    grid, scheme = scene.grid, scene.scheme
    per_axis = round(scene.fills[0].points_per_cell ** (1.0 / grid.dim))
    codes, rows = node_codes(scene)
    lines = tuple(
        np.array(c0_lines(grid, scene.walls, axis), dtype=np.int32) for axis in range(grid.dim)
    )
    axes = "xyz"[: grid.dim]
    return _core.Engine(
        dim=grid.dim,
        basis=CORE["basis"][scheme.basis],
        transfer=CORE["transfer"][scheme.transfer],
        density=CORE["density"][scheme.density.name],
        averaging_interval=averaging_interval(scene),
        pressure_from_density=int(scheme.density.name != "particle"),
        law=scene.material.law,
        isa=isa,
        shape=tuple(grid.shape),
        lower=tuple(grid.lower),
        periodic=tuple(grid.periodic),
        open_low=tuple(f"{a}-" in grid.open_sides for a in axes),
        open_high=tuple(f"{a}+" in grid.open_sides for a in axes),
        c0_lines=lines,
        sponge_layers=_sponge_layers(scene),
        walls=[(0, 0.0, -1, 0, math.inf, 0), *map(_row, rows)],
        node_codes=codes,
        cell_flags=cell_flags(scene)
        if scheme.density.name != "particle" or scheme.transfer in ("apic", "tpic")
        else None,
        gravity_times=np.array(scene.gravity.times, dtype=float),
        gravity_vectors=np.array(scene.gravity.vectors, dtype=float).reshape(-1, grid.dim),
        numbers=_numbers(scene, mean_mass, 0.5 / per_axis),
        scheme_numbers=scheme.numbers() | {"dt": scheme.dt or 0.0},
        density_numbers=_density_numbers(scene),
        fluidity_numbers=_fluidity_numbers(scene),
        parameters=_parameters(scene),
        fluidity_method=scheme.fluidity.method,
        fluidity_stencil=scheme.fluidity.stencil,
        fluidity_faces=fluidity_faces(scene) if scene.material.has_fluidity else None,
        bodies=[body.row() for body in scene.bodies],
    )


def allocate(engine: _core.Engine | _core.Sph, capacity: int) -> dict[str, NDArray]:
    """Zeroed buffers for so many places: {field: (component, capacity)} and "id" (capacity,).

    All rows lie in one block at multiples of 64 bytes, and the same place of different rows at
    different offsets in a page, so that loads from one row are not taken for stores to another
    (a precaution: on the one machine tried it changed nothing).
    """
    rows = [(name, count) for name, count, _, _ in engine.fields()]
    total = sum(count for _, count in rows) + 1
    skew = max(PAGE // total // LINE, 1) * LINE
    length = -(-capacity * 8 // PAGE) * PAGE + skew
    raw = np.zeros(total * length + LINE, dtype=np.uint8)
    start = -raw.ctypes.data % LINE
    buffers: dict[str, NDArray] = {}
    for name, count in [*rows, ("id", 1)]:
        flat = raw[start : start + count * length]
        if name == "id":
            buffers[name] = flat.view(np.int64)
        else:
            buffers[name] = flat.view(np.float64).reshape(count, length // 8)
        start += count * length
    buffers["id"][:] = -1
    return buffers


def initial_points(scene: Scene) -> dict[str, NDArray]:
    """The fields of the points at the start, in the order of their ids.

    Stress-free; lithostatic fills are in balance, dp/dz = rho g with rho = rho_c exp(p/K).
    """
    material = scene.material
    points = seed_points(scene.grid, scene.fills, scene.seed, material.rho_c)
    weight = -material.rho_c * scene.gravity.at(0.0)[-1] * points.depth
    if weight.max() >= material.K:
        raise ValueError(f"K = {material.K} must exceed rho_c g depth = {weight.max()}")
    log_density = np.log(points.density / material.rho_c) - np.log1p(-weight / material.K)
    fields = {
        "x": points.x,
        "v": points.v,
        "log_density": log_density,
        "mass": points.density * points.volume / (1.0 - weight / material.K),
    }
    if weight.any():
        fields["stress"] = np.zeros((len(weight), 4 if scene.dim == 2 else 6))
        fields["stress"][:, :3] = -material.K * np.where(points.depth > 0, log_density, 0)[:, None]
    if scene.scheme.fluidity.initial is not None and material.has_fluidity:
        fields["g"] = np.full(len(weight), scene.scheme.fluidity.initial)
    return fields


def initial_buffers(engine: _core.Engine, points: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Buffers that hold the given points in rows 0 to n - 1, with room to group them."""
    n = len(points["mass"])
    buffers = allocate(engine, 3 * n + 64)
    for name, values in points.items():
        buffers[name][:, :n] = values.reshape(n, -1).T
    buffers["id"][:n] = np.arange(n)
    return buffers
