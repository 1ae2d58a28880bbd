"""A simulation by SPH."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.measure.cell_sums import CellSums
from granular.model.inflow import InflowState, stored_inflow
from granular.model.state import State
from granular.record import Checkpoint
from granular.record.layout import Rows
from granular.run import diagnostics, simulation
from granular.run.machine import Machine
from granular.run.restarts import LARGEST, LEAST, check_range
from granular.run.running import MOST_STEPS
from granular.sph import memory
from granular.sph.gas import GasState
from granular.sph.inflow import Inlets
from granular.sph.scene import Scene, seeding_gradient
from granular.sph.walls import wall_rows
from granular.tools.arrays import IntArray
from granular.tools.buffers import allocate, fill
from granular.tools.checks import integer

SHOWN = ("x", "v", "a", "stress", "rho", "shear_rate", "mass")
"""Fields from which a state is made, besides the id; `rho` becomes the log-density."""


OF_MATERIAL = ("rho0", "kappa", "mu_l", "mu_h", "D_star", "cohesion", "shear_modulus", "dilation")
OF_NUMERICS = ("regularisation", "z_max", "cfl")
"""Parameters that the core takes as they are, by their names."""

LEAST_SPARE = 256
"""Rows for particles that enter, in addition to a quarter of the present number."""


@dataclass(frozen=True)
class _Rows:
    """Rows of the material, wall and gas particles in the buffers."""

    grains: int
    wall_first: int
    walls: int
    gas_first: int = 0
    gas: int = 0
    spare: int = 0

    @classmethod
    def of(cls, grains: int, walls: int, gas: int | None = None, *, grows: bool = False) -> Self:
        """Rows for given numbers of particles; `gas` is None if there is no gas.

        If the number grows, there are spare rows for particles that enter.
        """
        spare = LEAST_SPARE + max(grains, gas or 0) // 4 if grows else 0
        wall_first = (-(-(grains + spare) // _core.LANES) + 1) * _core.LANES
        if gas is None:
            return cls(grains, wall_first, walls)
        gas_first = wall_first + walls + _core.LANES
        return cls(grains, wall_first, walls, gas_first, gas, spare)

    def slots(self) -> IntArray:
        """Rows of all particles."""
        firsts = ((0, self.grains), (self.wall_first, self.walls), (self.gas_first, self.gas))
        return np.concatenate([np.arange(first, first + n) for first, n in firsts])

    @property
    def capacity(self) -> int:
        gas_end = self.gas_first + self.gas + self.spare
        return max(self.wall_first + self.walls, gas_end) + _core.LANES


def _weight(scene: Scene) -> float:
    """Weight of the material at the start on an area [Pa]; infinite without gravity or fills."""
    pull = float(np.linalg.norm(scene.gravity.vectors, axis=1).max())
    if not scene.fills or not pull:
        return math.inf
    lows, highs = zip(*(fill.region.bounds for fill in scene.fills), strict=True)
    height = max(high[-1] for high in highs) - min(low[-1] for low in lows)
    return scene.material.rho0 * pull * height


def _build(scene: Scene, machine: Machine) -> _core.Sph:
    machine.refuse_device("processors alone compute SPH")
    grid, material, numerics = scene.grid, scene.material, scene.numerics
    gas, point_volume = scene.gas, scene.point_mass / material.rho0
    return _core.Sph(
        dim=grid.dim,
        lower=tuple(grid.lower),
        upper=tuple(grid.upper),
        periodic=tuple(grid.periodic),
        isa=machine.kernels,
        wall_friction=material.mu_wall is not None,
        parameters={name: getattr(material, name) for name in OF_MATERIAL}
        | {name: getattr(numerics, name) for name in OF_NUMERICS}
        | {
            "h": scene.h,
            "skin": numerics.skin * scene.h,
            "rho0_wall": numerics.rho0_wall(material, _weight(scene)),
            "mu_wall": material.mu_wall or 0.0,
            "gradient": seeding_gradient(grid.dim, numerics.smoothing),
            "dt": numerics.dt or 0.0,
        },
        gravity_times=np.array(scene.gravity.times, dtype=float),
        gravity_vectors=np.array(scene.gravity.vectors, dtype=float).reshape(-1, grid.dim),
        walls=wall_rows(grid, scene.walls),
        gas=None if gas is None else gas.for_core(grid.dim, material.rho0, point_volume),
    )


class Simulation(simulation.Simulation, scenes=Scene):
    """Simulation of a `granular.sph.Scene`; see `granular.Simulation`."""

    scene: Scene
    _engine: _core.Sph

    def __init__(
        self,
        scene: Scene,
        *,
        threads: int | None = None,
        isa: str | None = None,
        device: None = None,
        force: bool = False,
        comm: None = None,  # with processes it is another class
    ) -> None:
        machine = Machine(threads, isa, device)
        memory.check(scene, force)
        diagnostics.warn(scene)
        self._start(scene, _build(scene, machine), machine)
        points, walls = scene.points(), scene.wall_points()
        gas = None if scene.gas is None else scene.gas.points(scene.grid, scene.seed)
        self._inlets = Inlets.add(self._engine, scene)
        rows = _Rows.of(
            len(points.x),
            len(walls["x"]),
            None if gas is None else len(gas.x),
            grows=bool(self._inlets),
        )
        self._buffers = allocate(self._engine, rows.capacity)
        grains = slice(0, rows.grains)
        behind = slice(rows.wall_first, rows.wall_first + rows.walls)
        for name, part in (("x", points.x), ("v", points.v)):
            self._buffers[name][:, grains] = part.T
        for name, part in walls.items():
            self._buffers[name][:, behind] = part.T
        for rows_of in (grains, behind):
            self._buffers["mass"][:, rows_of] = scene.point_mass
        self._buffers["id"][grains] = np.arange(rows.grains)
        self._buffers["id"][behind] = rows.grains + np.arange(rows.walls)
        if gas is not None:
            # The mass of the gas follows from its density and the porosity, which the core finds.
            above = slice(rows.gas_first, rows.gas_first + rows.gas)
            for name, values in (("x", gas.x.T), ("v", gas.v.T), ("rho", gas.density)):
                self._buffers[name][:, above] = values
            self._buffers["id"][above] = rows.grains + rows.walls + np.arange(rows.gas)
        self._bind(rows, fresh=True)
        if self._inlets:
            state = self._engine.inflow()
            state[0] = rows.grains + rows.walls + rows.gas  # the id of the first that enters
            self._engine.restore_inflow(state)

    def _bind(self, rows: _Rows, *, fresh: bool) -> None:
        self._rows = rows
        gas = (rows.gas_first, rows.gas)
        self._engine.bind(self._buffers, rows.grains, rows.wall_first, rows.walls, fresh, *gas)

    @property
    def counts(self) -> dict[str, float]:
        """Counts of events since the start.

        `rebuilds` of the neighbour list; number and mass [kg] of particles dropped at the ends of
        the domain, `dropped` and `dropped_mass`; number of times that a particle entered a wall and
        was put back on it, `stopped`; numbers of gas particles dropped, `gas_dropped`, and fed by
        jets, `gas_entered`.
        """
        scalars = self._engine.scalars()
        names = ("rebuilds", "dropped", "dropped_mass", "stopped", "gas_dropped")
        counts = {name: scalars[name] for name in names}
        return counts | {"gas_entered": self._inlets.gas_entered(self._engine)}

    @property
    def inflows(self) -> tuple[InflowState, ...]:
        """Mass, momentum and energy that have entered by each inflow of the scene, in their order.

        The impulse and the work are those of its region on the particles in it; the rest of the
        change of momentum is that of the other particles.
        """
        return self._inlets.accounts(self._engine)

    def _indicators(self, sums: CellSums) -> dict[str, float]:
        return {"stopped": float(self.counts["stopped"])}

    @property
    def buffers(self) -> dict[str, NDArray]:
        """Arrays on which the core works, not copied: {field: (component, capacity)} and "id".

        Particles are sorted by cell, those of the material first, then those of walls. Spare slots
        have the id -1.
        """
        return dict(self._buffers)

    @property
    def walls(self) -> State:
        """A snapshot of the particles of the present walls, ordered by id."""
        self._evaluate()
        first, scalars = self._rows.wall_first, self._engine.scalars()
        return self._state_of(self._fields_of(slice(first, first + int(scalars["n_walls"]))))

    @property
    def gas(self) -> GasState:
        """A snapshot of the particles of the gas, ordered by id.

        Raises
        ------
        AttributeError
            If the scene has no gas.
        """
        extra = self._extra_state()
        if "gas" not in extra:
            raise AttributeError(f"the scene {self.scene.name} has no gas")
        return extra["gas"]

    def _extra_state(self) -> dict[str, GasState]:
        if self.scene.gas is None:
            return {}
        self._evaluate()
        first = self._rows.gas_first
        rows = slice(first, first + int(self._engine.scalars()["n_gas"]))
        fields = self._ordered(rows, ("x", "v", "a", "mass", "rho", "stress", "porosity"))
        fields["density"] = fields.pop("rho")
        fields["pressure"] = np.ascontiguousarray(-fields.pop("stress")[:, 0])
        return {"gas": GasState(time=self.time, **fields)}

    def _fields(self, recorded: bool) -> dict[str, NDArray]:
        self._evaluate()
        fields = self._fields_of(slice(0, self.n_points))
        grid = self.scene.grid
        inside = ((fields["x"] >= grid.lower) & (fields["x"] <= grid.upper)).all(axis=1)
        if inside.all():
            return fields
        return {name: values[inside] for name, values in fields.items()}  # the next list drops them

    def _evaluate(self) -> None:
        """At the start, compute the fields that follow from positions and velocities."""
        if self.steps == 0:
            self._advance(0, math.inf)

    def _ordered(self, rows: slice, names: tuple[str, ...]) -> dict[str, NDArray]:
        """Fields of some rows in the order of ids, with positions within the period."""
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

    def _fields_of(self, rows: slice) -> dict[str, NDArray]:
        fields = self._ordered(rows, SHOWN)
        fields["log_density"] = np.log(fields.pop("rho") / self.scene.material.rho_c)
        return fields

    # ---- stepping ----

    def step(self, n: int = 1) -> None:
        """Make `n` steps; with 0 only evaluate the initial stresses and accelerations."""
        self._evaluate()
        if integer("n", n, 0, MOST_STEPS - self.steps):
            super().step(n)

    def _make_steps(self, max_steps: int, until: float) -> None:
        if self._engine.advance(max_steps, until, self.threads):
            self._grow()

    def _grow(self) -> None:
        """Give the core larger buffers, for particles that enter."""
        now = self._present()
        rows = _Rows.of(
            now.grains, now.walls, None if self.scene.gas is None else now.gas, grows=True
        )
        larger = allocate(self._engine, rows.capacity)
        for name, array in self._buffers.items():
            larger[name][..., rows.slots()] = array.take(now.slots(), axis=-1)
        self._buffers = larger
        self._bind(rows, fresh=False)

    # ---- restart ----

    def _present(self) -> _Rows:
        """Rows of the present particles."""
        scalars = self._engine.scalars()
        counts = {"grains": "n_points", "walls": "n_walls", "gas": "n_gas"}
        return replace(self._rows, **{name: int(scalars[n]) for name, n in counts.items()})

    def _checkpoint_data(self) -> tuple[dict[str, float | int], dict[str, NDArray | Rows]]:
        slots = self._present().slots()
        arrays: dict[str, NDArray | Rows] = {
            name: rows.take(slots, axis=-1) for name, rows in self._buffers.items()
        }
        if self._inlets:
            arrays |= {"inflow": self._engine.inflow(), "inlet_loads": self._engine.inlet_loads()}
        return self._engine.scalars(), arrays

    @classmethod
    def _filled(cls, scene: Scene, checkpoint: Checkpoint, machine: Machine) -> Self:
        self = object.__new__(cls)
        self._start(scene, _build(scene, machine), machine)
        total = len(checkpoint.arrays.get("id", ()))
        n = integer("the number n_points of the checkpoint", checkpoint.scalars.get("n_points"), 0)
        gas = integer("the number n_gas of the checkpoint", checkpoint.scalars.get("n_gas", 0), 0)
        if n + gas > total or (gas and scene.gas is None):
            raise ValueError(
                f"the checkpoint holds {total} points, must hold n_points = {n} and n_gas = {gas}"
            )
        self._inlets = Inlets.add(self._engine, scene)
        has_gas = None if scene.gas is None else gas
        rows = _Rows.of(n, total - n - gas, has_gas, grows=bool(self._inlets))
        self._buffers = allocate(self._engine, rows.capacity)
        fill(self._buffers, checkpoint.arrays, rows.slots())
        # Before the first step the density of all and the mass of the gas are not known yet.
        least = LEAST if checkpoint.scalars.get("started") else 0.0
        for name, low, high in (("rho", least, LARGEST), ("porosity", 0.0, 1.0)):
            if name in self._buffers:
                check_range(checkpoint.arrays, name, low, high)
        check_range({"mass": checkpoint.arrays["mass"][:, : total - gas]}, "mass", LEAST, LARGEST)
        self._bind(rows, fresh=False)
        if self._inlets:
            ids = checkpoint.arrays["id"]
            self._engine.restore_inflow(stored_inflow(checkpoint.arrays, ids))
            loads = checkpoint.arrays.get("inlet_loads")
            if loads is None:
                raise ValueError("the checkpoint does not hold the inlet_loads of the scene")
            self._engine.restore_inlet_loads(loads)
        self._engine.restore(dict(checkpoint.scalars))
        return self
