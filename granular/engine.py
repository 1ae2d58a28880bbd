"""From a scene to an engine of the C core: the one place that speaks the core's language."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.boundaries import Solid, Wall, WallRow, creases, node_codes
from granular.geometry import Grid, seed_points
from granular.nodes import CORE_BASES
from granular.scene import Scene
from granular.stability import check_time_step

__all__ = [
    "allocate",
    "build",
    "default_isa",
    "initial_buffers",
    "initial_points",
    "show_config",
]

CORE_DENSITIES = ("tracked", "diffused", "shared")
AFFINE = {"flip": 0, "xpic": 0, "tpic": 1, "apic": 2}
FLAG_SOLID, FLAG_NO_SHIFT, FLAG_WALL = 1, 2, 4
PAGE, LINE = 4096, 64  # bytes
UNBOUNDED = 1e300


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


def _velocity_rate(scene: Scene) -> float:
    """Rate at which the velocity of a point dies out against the grid's; < 0: at once."""
    scheme = scene.scheme
    if scheme.transfer == "apic":
        return -1.0
    if scheme.transfer == "tpic":
        return scheme.decay * scene.material.wave_speed / scene.grid.cell
    return scheme.flip_decay


_Vector = NDArray[np.float64]
ABOVE, BELOW = 1, 2
"""Sides of a face where material may be."""


def _faces(scene: Scene) -> Iterator[tuple[_Vector, _Vector, int, int]]:
    """Faces of walls and blocks: lower and upper corner [m], axis, and sides."""
    for wall in scene.walls:
        if isinstance(wall, Wall):
            yield *_ends(wall, scene.grid), wall.axis, ABOVE | BELOW
            continue
        low, high = np.array(wall.lower), np.array(wall.upper)
        for axis, at in enumerate(np.eye(scene.grid.dim, dtype=bool)):
            yield np.where(at, high, low), high, axis, ABOVE
            yield low, np.where(at, low, high), axis, BELOW


def _cell_flags(scene: Scene) -> NDArray[np.uint8]:
    """Which cells are solid, are so near an outlet that points must not be shifted, or have walls
    at their faces."""
    grid = scene.grid
    on_nodes = scene.scheme.basis == "ugimp"  # its points are grouped by the nearest node
    shape = [n + (on_nodes and not p) for n, p in zip(grid.shape, grid.periodic, strict=True)]
    flags = np.zeros(shape[::-1], dtype=np.uint8)
    centre = [
        grid.lower[d] + (np.arange(n) + (0.0 if on_nodes else 0.5)) * grid.cell
        for d, n in enumerate(shape)
    ]

    def mark(lower: _Vector, upper: _Vector, flag: int) -> None:
        where = [
            np.flatnonzero((x > low) & (x < high))
            for x, low, high in zip(centre, lower, upper, strict=True)
        ]
        flags[np.ix_(*where[::-1])] |= flag

    for low, high, axis, sides in _faces(scene):
        half = 0.5 * grid.cell * on_nodes
        across = grid.cell * (np.arange(grid.dim) == axis)
        if sides & ABOVE:  # the face is at the low end of these cells
            mark(low - half, high + across + half, FLAG_WALL << 2 * axis)
        if sides & BELOW:
            mark(low - across - half, high + half, FLAG_WALL << 2 * axis + 1)
    reach = scene.scheme.shift_outlet_cells * grid.cell
    for wall in scene.walls:
        if isinstance(wall, Solid):
            mark(np.array(wall.lower), np.array(wall.upper), FLAG_SOLID)
        elif wall.opens_at < math.inf:
            low, high = _ends(wall, grid)
            mark(low - reach, high + reach, FLAG_NO_SHIFT)
    return flags


def _ends(wall: Wall, grid: Grid) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lower and upper corner of a wall [m]."""
    ends = [(wall.at, wall.at) if d == wall.axis else wall.extent(grid, d) for d in range(grid.dim)]
    return np.array([low for low, _ in ends]), np.array([high for _, high in ends])


def _numbers(scene: Scene, mean_mass: float, half_extent: float) -> dict[str, float]:
    scheme, material = scene.scheme, scene.material
    return {
        "dx": scene.grid.cell,
        "half_extent": half_extent,
        "keep_velocity_rate": _velocity_rate(scene),
        "rho_c": material.rho_c,
        "wave_speed": material.wave_speed,
        "mass_cutoff": scheme.mass_cutoff * mean_mass,
        "cfl": scheme.cfl,
        "dt": scheme.dt or 0.0,
        "diffusion": scheme.diffusion,
        "strain_diffusion": scheme.strain_diffusion,
        "feedback": scheme.feedback,
        "feedback_limit": _feedback_limit(scene),
        "feedback_noise": scheme.feedback_noise,
        "feedback_crowd": scheme.feedback_crowd,
        "shift": scheme.shift,
        "shift_limit": scheme.shift_limit,
        "weighting": scheme.weighting,
        "weight_limit": scheme.weight_limit,
        "weight_decay": scheme.weight_decay,
        # What bears tension is never loose.
        "tension_reach": scheme.tension_reach if material.law != "elastic" else UNBOUNDED,
    }


def averaging_interval(scene: Scene) -> int:
    """Steps between two averagings of the density."""
    scheme = scene.scheme
    crossing = scene.grid.cell / scene.material.wave_speed
    dt = scheme.dt or scheme.cfl * crossing
    return max(round(scheme.averaging_time * crossing / dt), 1)


def _feedback_limit(scene: Scene) -> float:
    """Largest rate of log-density [1/s] by the feedback: eps g/c_w, g the largest gravity."""
    g = float(np.linalg.norm(scene.gravity.vectors, axis=1).max())
    return scene.scheme.feedback_limit * g / scene.material.wave_speed if g else UNBOUNDED


def _row(row: WallRow) -> tuple[int, int, float, int, int, float, int]:
    return (row.fixed, row.clamp, row.friction, row.normal, row.side, row.opens_at, row.after)


def build(scene: Scene, mean_mass: float, isa: str = "") -> _core.Engine:
    """The engine of a scene, still without points.

    Raises
    ------
    ValueError
        If the time step is beyond its limit, or the scheme cannot be built.
    """
    check_time_step(scene)
    grid, scheme = scene.grid, scene.scheme
    per_axis = round(scene.fills[0].points_per_cell ** (1.0 / grid.dim))
    codes, rows = node_codes(scene)
    lines = tuple(
        np.array(creases(grid, scene.walls, axis), dtype=np.int32) for axis in range(grid.dim)
    )
    axes = "xyz"[: grid.dim]
    return _core.Engine(
        dim=grid.dim,
        basis=CORE_BASES.index(scheme.basis),
        affine=AFFINE[scheme.transfer],
        density=CORE_DENSITIES.index(scheme.density),
        averaging_interval=averaging_interval(scene),
        xpic_order=scheme.xpic_order if scheme.transfer == "xpic" else 0,
        pressure_from_density=int(scheme.density != "tracked"),
        law=scene.material.law,
        isa=isa,
        shape=tuple(grid.shape),
        lower=tuple(grid.lower),
        periodic=tuple(grid.periodic),
        open_low=tuple(f"{a}-" in grid.open_sides for a in axes),
        open_high=tuple(f"{a}+" in grid.open_sides for a in axes),
        creases=lines,
        walls=[(0, 0, 0.0, -1, 0, math.inf, 0), *map(_row, rows)],
        node_codes=codes,
        cell_flags=_cell_flags(scene)
        if scheme.density != "tracked" or AFFINE[scheme.transfer]
        else None,
        gravity_times=np.array(scene.gravity.times, dtype=float),
        gravity_vectors=np.array(scene.gravity.vectors, dtype=float).reshape(-1, grid.dim),
        numbers=_numbers(scene, mean_mass, 0.5 / per_axis),
        parameters=scene.material.arguments()
        | {"K": scene.material.K, "G": scene.material.G}
        | ({"xi": scene.material.xi} if hasattr(scene.material, "xi") else {}),
    )


def allocate(engine: _core.Engine, capacity: int) -> dict[str, NDArray]:
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
    buffers = {}
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
    """The fields of the points at the start, in the order of their ids; stress-free."""
    points = seed_points(scene.grid, scene.fills, scene.seed, scene.material.rho_c)
    return {
        "x": points.x,
        "v": points.v,
        "log_density": np.log(points.density / scene.material.rho_c),
        "mass": points.density * points.volume,
    }


def initial_buffers(engine: _core.Engine, points: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Buffers that hold the given points in rows 0 to n - 1, with room to group them."""
    n = len(points["mass"])
    buffers = allocate(engine, 3 * n + 64)
    for name, values in points.items():
        buffers[name][:, :n] = values.reshape(n, -1).T
    buffers["id"][:n] = np.arange(n)
    return buffers
