"""A running simulation of particle hydrodynamics: step, run, look, stop, go on."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.checks import integer, positive
from granular.engine import allocate, default_isa
from granular.record.checkpoint import Checkpoint
from granular.sph.gas import GasState
from granular.sph.scene import Scene
from granular.state import State

__all__ = ["Simulation"]

CHUNK_SECONDS = 0.05
"""Wall time between two returns from the core, so that Ctrl-C is heard."""
SHOWN = ("x", "v", "a", "stress", "rho", "shear_rate", "mass")
"""Fields that a state has, besides the id and the log-density."""


@dataclass(frozen=True)
class _Rows:
    """Where the grains, the wall points and those of a gas are in the buffers."""

    grains: int
    wall_first: int
    walls: int
    gas_first: int = 0
    gas: int = 0

    @classmethod
    def of(cls, grains: int, walls: int, gas: int | None = None) -> Self:
        """With so many points of gas; None where there is no gas."""
        wall_first = (-(-grains // _core.LANES) + 1) * _core.LANES
        if gas is None:
            return cls(grains, wall_first, walls)
        return cls(grains, wall_first, walls, wall_first + walls + _core.LANES, gas)

    def places(self) -> NDArray[np.int64]:
        """The rows of all points."""
        firsts = ((0, self.grains), (self.wall_first, self.walls), (self.gas_first, self.gas))
        return np.concatenate([np.arange(first, first + n) for first, n in firsts])

    @property
    def capacity(self) -> int:
        return max(self.wall_first + self.walls, self.gas_first + self.gas) + _core.LANES


def _build(scene: Scene, isa: str) -> _core.Sph:
    grid, material, numerics = scene.grid, scene.material, scene.numerics
    gas = scene.gas
    point_volume = scene.point_mass / material.rho0
    return _core.Sph(
        dim=grid.dim,
        lower=tuple(grid.lower),
        upper=tuple(grid.upper),
        periodic=tuple(grid.periodic),
        isa=isa,
        wall_friction=material.mu_wall is not None,
        parameters={
            "h": scene.h,
            "skin": numerics.skin * scene.h,
            "rho0": material.rho0,
            "rho0_wall": numerics.wall_density * material.rho0,
            "kappa": material.kappa,
            "mu_l": material.mu_l,
            "mu_h": material.mu_h,
            "D_star": material.D_star,
            "cohesion": material.cohesion,
            "mu_wall": material.mu_wall or 0.0,
            "dilation": material.dilation,
            "regularisation": numerics.regularisation,
            "z_max": numerics.z_max,
            "cfl": numerics.cfl,
            "dt": numerics.dt or 0.0,
        },
        gravity_times=np.array(scene.gravity.times, dtype=float),
        gravity_vectors=np.array(scene.gravity.vectors, dtype=float).reshape(-1, grid.dim),
        gas=None if gas is None else gas.for_core(grid.dim, material.rho0, point_volume),
    )


class Simulation:
    """Steps the points of a scene of particle hydrodynamics.

    Parameters
    ----------
    scene : granular.sph.Scene
    threads : int
        Threads of the core, 1 to 64. The result does not depend on it, to the last bit.
    isa : str, optional
        Instruction set of the kernels, "baseline", "avx2" or "avx512"; by default the environment
        variable GRANULAR_ISA, else the best of the machine.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    def __init__(self, scene: Scene, *, threads: int = 1, isa: str | None = None) -> None:
        self._start(scene, threads, isa)
        points, walls = scene.points(), scene.wall_points()
        gas = None if scene.gas is None else scene.gas.points(scene.grid, scene.seed)
        rows = _Rows.of(len(points.x), len(walls["x"]), None if gas is None else len(gas.x))
        self._buffers = allocate(self._engine, rows.capacity)
        grains = slice(0, rows.grains)
        behind = slice(rows.wall_first, rows.wall_first + rows.walls)
        for name, part in (("x", points.x), ("v", points.v)):
            self._buffers[name][:, grains] = part.T
        for name, part in walls.items():
            self._buffers[name][:, behind] = part.T
        for part in (grains, behind):
            self._buffers["mass"][:, part] = scene.point_mass
        self._buffers["id"][grains] = np.arange(rows.grains)
        self._buffers["id"][behind] = rows.grains + np.arange(rows.walls)
        if gas is not None:
            # Its mass follows from its density and the porosity that the core finds.
            above = slice(rows.gas_first, rows.gas_first + rows.gas)
            for name, values in (("x", gas.x.T), ("v", gas.v.T), ("rho", gas.density)):
                self._buffers[name][:, above] = values
            self._buffers["id"][above] = rows.grains + rows.walls + np.arange(rows.gas)
        self._bind(rows, fresh=True)

    def _start(self, scene: Scene, threads: int, isa: str | None) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(f"scene = {scene!r} must be a granular.sph.Scene")
        self.scene = scene
        self.threads = integer("threads", threads, 1, _core.MAX_THREADS)
        self._engine = _build(scene, default_isa() if isa is None else isa)
        self._chunk = 1

    def _bind(self, rows: _Rows, *, fresh: bool) -> None:
        self._rows = rows
        gas = (rows.gas_first, rows.gas)
        self._engine.bind(self._buffers, rows.grains, rows.wall_first, rows.walls, fresh, *gas)

    @property
    def time(self) -> float:
        """Time [s]."""
        return self._engine.scalars()["time"]

    @property
    def steps(self) -> int:
        """Steps made."""
        return self._engine.scalars()["step"]

    @property
    def dt(self) -> float:
        """Time step of the last step, or of the first [s]."""
        return self._engine.scalars()["dt"]

    @property
    def n_points(self) -> int:
        """Grains that are still in the domain."""
        return self._engine.scalars()["n_points"]

    @property
    def isa(self) -> str:
        """Instruction set of the kernels."""
        return self._engine.isa

    @property
    def counts(self) -> dict[str, float]:
        """What has happened: `rebuilds` of the list; grains and mass [kg] `dropped` at the
        ends of the domain, and points of gas, `gas_dropped`."""
        scalars = self._engine.scalars()
        names = ("rebuilds", "dropped", "dropped_mass", "gas_dropped")
        return {name: scalars[name] for name in names}

    @property
    def buffers(self) -> dict[str, NDArray]:
        """What the core works on, without copying: {field: (component, capacity)} and "id". Rows
        are sorted by cell, first those of grains, then those of walls; spare ones have id -1."""
        return dict(self._buffers)

    @property
    def state(self) -> State:
        """A snapshot of the grains, ordered by id; positions lie within their period."""
        return self._snapshot(slice(0, self.n_points))

    @property
    def walls(self) -> State:
        """A snapshot of the points of walls, ordered by id."""
        first = self._rows.wall_first
        return self._snapshot(slice(first, first + self._rows.walls))

    @property
    def gas(self) -> GasState:
        """A snapshot of the points of the gas, ordered by id.

        Raises
        ------
        AttributeError
            If the scene has no gas.
        """
        if self.scene.gas is None:
            raise AttributeError(f"the scene {self.scene.name} has no gas")
        if not self.steps:
            self.step(0)
        first = self._rows.gas_first
        rows = slice(first, first + self._engine.scalars()["n_gas"])
        return GasState.of(self.time, self._fields(rows, (*SHOWN, "porosity")))

    def _fields(self, rows: slice, names: tuple[str, ...]) -> dict[str, NDArray]:
        """Fields of some rows in the order of ids, positions within their period."""
        ids = self._buffers["id"][rows]
        order = np.argsort(ids)
        fields: dict[str, NDArray] = {"id": ids[order]}
        for name in names:
            values = self._buffers[name][:, rows].take(order, axis=1)
            fields[name] = values[0] if len(values) == 1 else np.ascontiguousarray(values.T)
        grid = self.scene.grid
        for axis in np.flatnonzero(grid.periodic):
            length = grid.shape[axis] * grid.cell
            x = fields["x"][:, axis]
            x -= length * np.floor((x - grid.lower[axis]) / length)
        return fields

    def _snapshot(self, rows: slice) -> State:
        fields = self._fields(rows, SHOWN)
        rho = fields.pop("rho")
        fields["log_density"] = np.log(
            rho / self.scene.material.rho_c, out=np.full(len(rho), -np.inf), where=rho > 0
        )
        return State(scene=self.scene, time=self.time, step=self.steps, dt=self.dt, fields=fields)

    # ---- stepping ----

    def step(self, n: int = 1) -> None:
        """Make `n` steps; 0 evaluates the stresses and accelerations of the start.

        Raises
        ------
        SimulationError
            If a point is not finite.
        """
        self._engine.advance(integer("n", n, 0), math.inf, self.threads)

    def run(
        self,
        until: float | None = None,
        *,
        every: float | None = None,
        hooks: tuple[Callable[[Simulation], Any], ...] = (),
    ) -> Self:
        """Run to a time.

        Parameters
        ----------
        until : float, optional
            Time to stop at [s]: the first step at or past it; the scene's duration by default.
        every : float, optional
            Time between two calls of the hooks [s]: the first step at or past each. None: at the
            end only. The steps do not depend on it.
        hooks : tuple of callables
            Called with the simulation; what they raise ends the run.

        Raises
        ------
        SimulationError
            If a point is not finite.
        """
        until = self.scene.duration if until is None else positive("until", until)
        every = until if every is None else positive("every", every)
        while self.time < until:
            frame = min((math.floor(self.time / every + 1e-9) + 1) * every, until)
            while self.time < frame:
                self._advance(frame)
            for hook in hooks:
                hook(self)
        return self

    def _advance(self, until: float) -> None:
        begin, first = clock.perf_counter(), self.steps
        self._engine.advance(self._chunk, until, self.threads)
        seconds = max(clock.perf_counter() - begin, 1e-6) / max(self.steps - first, 1)
        self._chunk = int(min(max(CHUNK_SECONDS / seconds, 1), 4 * self._chunk + 1))

    # ---- restart ----

    def checkpoint(self) -> Checkpoint:
        """All that a bitwise restart needs: the points in the order of rows, and the clock."""
        n, rows = self.n_points, self._rows
        scalars = self._engine.scalars()
        places = replace(rows, grains=n, gas=scalars["n_gas"]).places()
        return Checkpoint(
            time=scalars["time"],
            step=scalars["step"],
            dt=scalars["dt"],
            scalars=scalars,
            arrays={name: array.take(places, axis=-1) for name, array in self._buffers.items()},
        )

    @classmethod
    def from_checkpoint(
        cls, scene: Scene, checkpoint: Checkpoint, *, threads: int = 1, isa: str | None = None
    ) -> Self:
        """A simulation that goes on from a checkpoint as if it had never stopped.

        Raises
        ------
        ValueError
            If the checkpoint does not belong to such a scene.
        """
        self = cls.__new__(cls)
        self._start(scene, threads, isa)
        total = len(checkpoint.arrays.get("id", ()))
        n = integer("the number n_points of the checkpoint", checkpoint.scalars.get("n_points"), 0)
        gas = integer("the number n_gas of the checkpoint", checkpoint.scalars.get("n_gas", 0), 0)
        if n + gas > total or (gas and scene.gas is None):
            raise ValueError(
                f"the checkpoint holds {total} points, must hold n_points = {n} and n_gas = {gas}"
            )
        rows = _Rows.of(n, total - n - gas, None if scene.gas is None else gas)
        self._buffers = allocate(self._engine, rows.capacity)
        for name, array in self._buffers.items():
            stored = checkpoint.arrays.get(name)
            if stored is None or stored.shape != (*array.shape[:-1], total):
                raise ValueError(f"the checkpoint does not hold {name} of {total} points")
            array[..., rows.places()] = stored
        self._bind(rows, fresh=False)
        self._engine.restore(dict(checkpoint.scalars))
        return self

    def __repr__(self) -> str:
        return (
            f"Simulation({self.scene.name}, t = {self.time:.6g} s, step {self.steps}, "
            f"{self.n_points} points)"
        )
