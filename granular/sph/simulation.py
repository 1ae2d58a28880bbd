"""A simulation by particle hydrodynamics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from granular import _core, simulation, stability
from granular.checks import integer
from granular.engine import allocate, default_isa
from granular.sph.scene import Scene
from granular.sph.walls import wall_rows
from granular.state import State
from granular.trajectory import Checkpoint

__all__ = ["Simulation"]

SHOWN = ("x", "v", "a", "stress", "rho", "shear_rate", "mass")
"""Fields that a state has, besides the id and the log-density."""


@dataclass(frozen=True)
class _Rows:
    """Where the grains and the wall points are in the buffers."""

    grains: int
    wall_first: int
    walls: int

    @classmethod
    def of(cls, grains: int, walls: int) -> Self:
        blocks = -(-grains // _core.LANES)
        return cls(grains, (blocks + 1) * _core.LANES, walls)

    @property
    def capacity(self) -> int:
        return self.wall_first + self.walls + _core.LANES


def _build(scene: Scene, isa: str) -> _core.Sph:
    grid, material, numerics = scene.grid, scene.material, scene.numerics
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
        walls=wall_rows(grid, scene.walls),
    )


class Simulation(simulation.Simulation, scenes=Scene):
    """Steps the points of a `granular.sph.Scene`; see `granular.Simulation`."""

    def __init__(self, scene: Scene, *, threads: int | None = None, isa: str | None = None) -> None:
        stability.warn(scene)
        self._start(scene, _build(scene, default_isa() if isa is None else isa), threads)
        points, walls = scene.points(), scene.wall_points()
        rows = _Rows.of(len(points.x), len(walls["x"]))
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
        self._bind(rows, fresh=True)

    def _bind(self, rows: _Rows, *, fresh: bool) -> None:
        self._rows = rows
        self._engine.bind(self._buffers, rows.grains, rows.wall_first, rows.walls, fresh)

    @property
    def counts(self) -> dict[str, float]:
        """What has happened: `rebuilds` of the list; grains and mass [kg] `dropped` at the
        ends of the domain; how often a grain had to be `stopped` in a wall, see `Scene`."""
        scalars = self._engine.scalars()
        names = ("rebuilds", "dropped", "dropped_mass", "stopped")
        return {name: scalars[name] for name in names}

    @property
    def _stopped(self) -> float:
        return float(self.counts["stopped"])

    @property
    def buffers(self) -> dict[str, NDArray]:
        """What the core works on, without copying: {field: (component, capacity)} and "id". Rows
        are sorted by cell, first those of grains, then those of walls; spare ones have id -1."""
        return dict(self._buffers)

    @property
    def walls(self) -> State:
        """A snapshot of the points of walls that are there, ordered by id."""
        self._evaluate()
        first, scalars = self._rows.wall_first, self._engine.scalars()
        return State(
            scene=self.scene,
            time=scalars["time"],
            step=scalars["step"],
            dt=scalars["dt"],
            fields=self._shown(slice(first, first + scalars["n_walls"])),
        )

    def _fields(self, kept: bool) -> dict[str, NDArray]:
        self._evaluate()
        fields = self._shown(slice(0, self.n_points))
        grid = self.scene.grid
        inside = ((fields["x"] >= grid.lower) & (fields["x"] <= grid.upper)).all(axis=1)
        if inside.all():
            return fields
        return {name: values[inside] for name, values in fields.items()}  # the next list drops them

    def _evaluate(self) -> None:
        """At the start, find what follows from positions and velocities."""
        if self.steps == 0:
            self._make_steps(0, math.inf)

    def _shown(self, rows: slice) -> dict[str, NDArray]:
        ids = self._buffers["id"][rows]
        order = np.argsort(ids)
        fields: dict[str, NDArray] = {"id": ids[order]}
        for name in SHOWN:
            values = self._buffers[name][:, rows].take(order, axis=1)
            fields[name] = values[0] if len(values) == 1 else np.ascontiguousarray(values.T)
        material, grid = self.scene.material, self.scene.grid
        for axis in np.flatnonzero(grid.periodic):
            length = grid.shape[axis] * grid.cell
            x = fields["x"][:, axis]
            x -= length * np.floor((x - grid.lower[axis]) / length)
        fields["log_density"] = np.log(fields.pop("rho") / material.rho_c)
        return fields

    # ---- stepping ----

    def step(self, n: int = 1) -> None:
        """Make `n` steps; 0 evaluates the stresses and accelerations of the start."""
        self._evaluate()
        if integer("n", n, 0):
            super().step(n)

    def _make_steps(self, max_steps: int, until: float) -> None:
        self._engine.advance(max_steps, until, self.threads)

    # ---- restart ----

    def _kept(self) -> tuple[dict[str, float | int], dict[str, NDArray]]:
        scalars, first = self._engine.scalars(), self._rows.wall_first
        places = np.r_[0 : scalars["n_points"], first : first + scalars["n_walls"]]
        return scalars, {name: rows.take(places, axis=-1) for name, rows in self._buffers.items()}

    @classmethod
    def _restored(
        cls, scene: Scene, checkpoint: Checkpoint, threads: int | None, isa: str | None
    ) -> Self:
        self = cls.__new__(cls, scene)
        self._start(scene, _build(scene, default_isa() if isa is None else isa), threads)
        total = len(checkpoint.arrays.get("id", ()))
        n = integer("the number n_points of the checkpoint", checkpoint.scalars.get("n_points"), 0)
        if n > total:
            raise ValueError(f"the checkpoint holds {total} points, must hold n_points = {n}")
        rows = _Rows.of(n, total - n)
        self._buffers = allocate(self._engine, rows.capacity)
        for name, array in self._buffers.items():
            stored = checkpoint.arrays.get(name)
            if stored is None or stored.shape != (*array.shape[:-1], total):
                raise ValueError(f"the checkpoint does not hold {name} of {total} points")
            array[..., :n] = stored[..., :n]
            array[..., rows.wall_first : rows.wall_first + rows.walls] = stored[..., n:]
        self._bind(rows, fresh=False)
        self._engine.restore(dict(checkpoint.scalars))
        return self
