"""The C core; its arrays are borrowed, never converted or copied."""

from typing import Any, Final, TypedDict, final

import numpy as np
from numpy.typing import NDArray

from granular.tools.arrays import Array, BoolArray, IntArray

LANES: Final[int]
"""Every cell owns a multiple of this many slots in the point arrays."""
MAX_THREADS: Final[int]
MOST_DIFFUSED: Final[float]
"""Largest viscosity of the damping of flutter times the time of an update, over rho_c dx^2."""
TALLY_INTERVAL: Final[int]
"""Steps between two tallies of an engine (csrc/mpm/tally.h)."""

Map = tuple[tuple[NDArray[np.int32], ...], NDArray[np.uint8]]
"""Class of each index along each axis, and a byte for each combination of classes."""

class SimulationError(RuntimeError):
    """A run failed: a point is not finite or ran away, or a free body met what it does not feel."""

    body: int
    point: int
    step: int

class BuildInfo(TypedDict):
    isa: str
    lanes: int
    compiler: str
    flags: str

class Nodes(TypedDict):
    x: Array  # (n, dim) m
    mass: Array  # (n,) kg
    momentum: Array  # (n, dim) kg m/s
    force: Array  # (n, dim) N, internal
    v: Array  # (n, dim) m/s, after the forces and walls
    w: Array  # (n, dim) m/s, what points add to the old velocity they keep

class Fluidity(TypedDict):
    method: str
    substeps: int
    limit: float  # s, a substep must be shorter
    iterations: int  # conjugate gradients or stages, since the engine was built
    clamped: int  # cells that would have become negative, since the engine was built

class Diffusion(TypedDict):
    iterations: int  # conjugate gradients or stages, over all steps
    clamped: int  # cells that would have become negative, over all steps
    limit: float  # s, a step must be shorter

class Traffic(TypedDict):
    peers: int  # ranks with cells near to those of this one
    sent_cells: int  # in a step, one that several ranks have once for each
    ghost_cells: int
    reach: int  # distance of ghost cells, in cells
    sent_bytes: int  # since the points were divided, as the times
    seconds_waiting: float  # for messages, s
    seconds_copying: float  # into messages and out of them, s

class Gpu(TypedDict):
    name: str
    free: int
    total: int

def open_gpu(double: bytes, single: bytes, /) -> Gpu: ...
def build_info(isa: str = "", /) -> BuildInfo: ...
def scheme_numbers() -> dict[str, list[tuple[str, float | None, str, str, str]]]: ...
def damped_dt(dt: float, damping_time: float, /) -> float: ...
def material_numbers() -> dict[str, tuple[str, str]]: ...
def enumerations() -> dict[str, dict[str, int]]: ...
def laws() -> dict[str, tuple[str, list[tuple[str, str, str]], bool]]: ...
def law_update(
    law: str,
    dim: int,
    parameters: dict[str, float],
    dt: float,
    pressure_from_density: int,
    gradient: Array,
    log_density: Array,
    stress: Array,
    shear_rate: Array,
    isa: str,
    g_star: Array | None = None,
    g: Array | None = None,
    plastic_strain: Array | None = None,
    separated: Array | None = None,
    bulking: Array | None = None,
    /,
) -> None: ...
def fluidity_update(
    parameters: dict[str, float],
    dt: float,
    mu_trial: Array,
    p: Array,
    g_star: Array,
    shear_rate: Array,
    mu: Array,
    g: Array,
    isa: str,
    /,
) -> None: ...
def hencky_update(
    flow: str,
    parameters: dict[str, float],
    dt: float,
    gradient: Array,
    log_density: Array,
    stress: Array,
    g: Array,
    shear_rate: Array,
    isa: str,
    /,
) -> None: ...
def fluidity_diffuse(
    *,
    method: str,
    stencil: str,
    dx: float,
    A: float,
    d: float,
    t0: float,
    dt: float,
    steps: int,
    tolerance: float,
    max_iterations: int,
    periodic: tuple[bool, ...],
    faces: NDArray[np.uint8],
    dense: BoolArray,
    g: Array,
    distance: Array | None,
    threads: int,
    isa: str,
    first_radius: float,
) -> Diffusion: ...
def body_distance(parts: Array, samples: tuple[Any, ...], x: Array, /) -> tuple[Array, Array]: ...
def mesh_tree(vertices: Array, faces: NDArray[np.int32], /) -> object: ...
def mesh_distance(tree: object, x: Array, closed: bool, /) -> Array: ...
def mesh_winding(tree: object, x: Array, /) -> Array: ...
def mesh_clear(tree: object, x: Array, radius: Array, /) -> BoolArray: ...
def node_positions(
    basis: int, n_cells: int, periodic: bool, c0_lines: NDArray[np.int32], /
) -> Array: ...

BodyRow = tuple[
    Array, tuple[tuple[NDArray, ...], ...], Array, Array, Array, int, int, int, float, float, Array
]
"""parts (k, 17), samples, pose (7,), motion (n, 7), extent (3,), contact, free, rough, friction,
mass, inertia (0,) or (12,): principal moments and their axes"""

AxisRow = tuple[int, float, bool, bool, bool, NDArray[np.int32], float, float]
"""cells, lower (m), periodic, open_low, open_high, C0 lines, sponge: above (m), damping (1/s)"""

MaterialRow = tuple[
    str, dict[str, float], dict[str, float], tuple[object, tuple[float, ...], bool] | None
]

@final
class Engine:
    def __init__(
        self,
        *,
        dim: int,
        basis: int,
        transfer: int,
        density: int,
        single: int,
        axisymmetric: int,
        averaging_interval: int,
        flutter_interval: int,
        pressure_from_density: int,
        materials: list[MaterialRow],
        isa: str,
        device: str,
        axes: tuple[AxisRow, ...],
        walls: list[
            tuple[
                int,
                tuple[int, int, int],
                tuple[float, float, float],
                float,
                int,
                tuple[float, float, float],
            ]
        ],
        node_codes: Map,
        cell_flags: Map | None,
        gravity_times: Array,
        gravity_vectors: Array,
        numbers: dict[str, float],
        scheme_numbers: dict[str, float],
        density_numbers: dict[str, float],
        fluidity_numbers: dict[str, float],
        fluidity_method: str,
        fluidity_stencil: str,
        fluidity_faces: NDArray[np.uint8] | None,
        bodies: list[BodyRow],
    ) -> None: ...
    @property
    def isa(self) -> str: ...
    @property
    def refused_threads(self) -> int: ...
    def bind(self, buffers: dict[str, Array | IntArray], n_points: int, fresh: bool, /) -> None: ...
    def regroup(self) -> int: ...
    def bodies(self) -> Array: ...
    def restore_bodies(self, state: Array, /) -> None: ...
    def drive(self, body: int, rates: tuple[float, ...], /) -> None: ...
    def load(self, body: int, load: tuple[float, ...], /) -> None: ...
    def touch_solids(
        self, balls: Array, first_ball: IntArray, restitution: Array, obstacles: Array, /
    ) -> None: ...
    def split(self) -> Array: ...
    def restore_split(self, poses: Array, /) -> None: ...
    def watch_walls(
        self,
        n_walls: int,
        codes: NDArray[np.int32],
        owners: NDArray[np.int32],
        opens_at: Array,
        after: NDArray[np.int32],
        /,
    ) -> None: ...
    def hold_pressure(
        self,
        wall: int,
        axis: int,
        side: int,
        pressure: float,
        area: float,
        height: float,
        rate: float,
        limit: float,
        /,
    ) -> None: ...
    def add_inlet(
        self,
        records: Array,
        axis: int,
        velocity: tuple[float, float, float],
        spacing: float,
        begin: float,
        end: float,
        yields: bool,
        /,
    ) -> None: ...
    def inflow(self) -> IntArray: ...
    def restore_inflow(self, state: IntArray, /) -> None: ...
    def walls(self) -> Array: ...
    def restore_walls(self, impulses: Array, /) -> None: ...
    def watch_patches(self) -> None: ...
    def patches(self) -> tuple[IntArray, Array]: ...
    def restore_patches(self, places: IntArray, numbers: Array, /) -> None: ...
    def calm(self) -> IntArray: ...
    def restore_calm(self, calm: IntArray, /) -> None: ...
    def share(
        self, link: Any, rank: int, size: int, edge: int, owners: NDArray[np.int32], /
    ) -> None: ...
    def blocks(self, edge: int, /) -> tuple[int, int, int]: ...
    def places(self, x: Array, edge: int, /) -> tuple[IntArray, IntArray]: ...
    def traffic(self) -> Traffic | None: ...
    def refresh(self) -> None: ...
    def advance(self, max_steps: int, until: float, threads: int, /) -> int: ...
    def p2g(self) -> int: ...
    def grid(self) -> int: ...
    def g2p(self) -> int: ...
    def nodes(self) -> Nodes: ...
    def cells(self) -> tuple[IntArray, IntArray, IntArray]: ...
    def scalars(self) -> dict[str, float | int]: ...
    def tally(self) -> None: ...
    def restore(self, scalars: dict[str, float | int], /) -> None: ...
    def stable_dt(self) -> float: ...
    def fluidity(self) -> Fluidity | None: ...
    def fields(self) -> list[tuple[str, int, str, str, np.dtype[Any]]]: ...
    def zeros(self, n: int, /) -> NDArray[np.uint8]: ...
    def foreign_array(self) -> str | None: ...

@final
class Sph:
    def __init__(
        self,
        *,
        dim: int,
        lower: tuple[float, ...],
        upper: tuple[float, ...],
        periodic: tuple[bool, ...],
        isa: str,
        wall_friction: bool,
        parameters: dict[str, float],
        gravity_times: Array,
        gravity_vectors: Array,
        walls: Array,
        gas: tuple[dict[str, float], Array] | None,
    ) -> None: ...
    @property
    def isa(self) -> str: ...
    @property
    def refused_threads(self) -> int: ...
    def bind(
        self,
        buffers: dict[str, Array | IntArray],
        n_grains: int,
        wall_first: int,
        n_walls: int,
        fresh: bool,
        gas_first: int = 0,
        n_gas: int = 0,
        /,
    ) -> None: ...
    def advance(self, max_steps: int, until: float, threads: int, /) -> bool: ...
    def add_inlet(
        self,
        records: Array,
        axis: int,
        velocity: tuple[float, float, float],
        spacing: float,
        begin: float,
        end: float,
        is_gas: bool,
        lower: tuple[float, float, float],
        upper: tuple[float, float, float],
        /,
    ) -> None: ...
    def inflow(self) -> IntArray: ...
    def restore_inflow(self, state: IntArray, /) -> None: ...
    def inlet_loads(self) -> Array: ...
    def restore_inlet_loads(self, loads: Array, /) -> None: ...
    def scalars(self) -> dict[str, float | int]: ...
    def restore(self, scalars: dict[str, float | int], /) -> None: ...
    def stable_dt(self) -> float: ...
    def fields(self) -> list[tuple[str, int, str, str, np.dtype[Any]]]: ...
    def zeros(self, n: int, /) -> NDArray[np.uint8]: ...
