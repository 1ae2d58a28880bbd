"""Simulation by the material point method."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.materials.law_functions import keeping_exceptions
from granular.materials.own import OwnLaw
from granular.measure.cell_sums import CellSums
from granular.model.inflow import InflowState, stored_inflow
from granular.model.plausible import stiffness_hint
from granular.model.seeding import DEEPEST
from granular.model.state import State
from granular.mpm import bodies as rigid
from granular.mpm import engine as core
from granular.mpm import memory
from granular.mpm.blocks import deep_within
from granular.mpm.body_distances import distance_from_bodies
from granular.mpm.body_overlaps import check_overlaps
from granular.mpm.coupling import Coupled
from granular.mpm.free_bodies import INTERVAL, FreeBodies
from granular.mpm.inflow_state import account
from granular.mpm.patches import in_order, patch_fields, stored_patches, watched_solids
from granular.mpm.point_field import SUMMED, PointField, PointRows, whole_groups
from granular.mpm.rigid_contact import touch_solids
from granular.mpm.scene import Scene
from granular.mpm.wall_owners import wall_owners
from granular.mpm.walls import WallState, split_impulses
from granular.record import Checkpoint
from granular.record.fresh import Streamed
from granular.record.layout import Rows
from granular.run import diagnostics, simulation
from granular.run.machine import Machine
from granular.run.monitor import Energies
from granular.run.restarts import LARGEST, LEAST, check_range
from granular.tools.arrays import BoolArray, IntArray
from granular.tools.buffers import allocate, check_stored, fill
from granular.tools.checks import positive, truth

CARRIED = frozenset(
    {
        "affine",
        "density_gradient",
        "shift_velocity",
        "overstress",
        "mean_shear_rate",
        "g_gain",
        "side",
        "contact_force",
    }
)
"""Fields that a scheme carries from step to step.

Checkpoints hold them, frames do not: they would become larger by two thirds, and no measure needs
these fields.
"""


AT_LIMIT = 0.999
"""Share of the limit of a quadrature weight from which it counts as being at the limit."""

SPARSE = 16
"""Largest id, in multiples of the number of slots, up to which points are ordered by a table.

The table is faster than sorting, but its size grows with the largest id: 128 bytes per slot.
"""


class Simulation(Coupled, simulation.Simulation, scenes=Scene):
    """Advance the material points of a `granular.Scene` in time; see `granular.Simulation`.

    Parameters
    ----------
    scene, threads, isa, device, force
        As of `granular.Simulation`.
    wall_forces : bool
        Add up the impulses on the walls and blocks of the scene, see `walls`. Frames of records and
        checkpoints then hold them. They do not affect the motion. They are added
        up in any case where a wall has a velocity or keeps a pressure.
    tractions : bool
        Add up the impulses on patches of walls, blocks and bodies, about a cell wide each, for
        `granular.measure.wall_traction`; with those of `wall_forces`.
    """

    scene: Scene
    _engine: _core.Engine
    _same_bits = ("one_lane", "avx2", "avx512")

    def __init__(
        self,
        scene: Scene,
        *,
        threads: int | None = None,
        isa: str | None = None,
        device: str | None = None,
        force: bool = False,
        wall_forces: bool = False,
        tractions: bool = False,
        comm: None = None,  # with processes it is another class
    ) -> None:
        wall_forces = truth("tractions", tractions) or truth("wall_forces", wall_forces)
        machine = Machine(threads, isa, device)
        memory.check(scene, force, of_device=machine.memory)
        check_overlaps(scene)
        diagnostics.warn(scene)
        parts = list(core.initial_parts(scene))
        self._build(scene, core.mean_mass(scene, parts), machine, wall_forces, tractions)
        self._buffers = core.initial_buffers(self._engine, parts)
        n = sum(len(part["mass"]) for part in parts)
        del parts
        self._bind(n)
        if scene.inflows:
            state = self._engine.inflow()
            state[0] = n  # the id of the first point that enters
            self._engine.restore_inflow(state)

    def _build(
        self,
        scene: Scene,
        mean_mass: float,
        machine: Machine,
        wall_forces: bool,
        tractions: bool,
    ) -> None:
        engine = core.build(scene, mean_mass, machine.kernels, machine.device or "")
        self._start(scene, engine, machine)
        self._user_laws = [m.function() for m in scene.materials if isinstance(m, OwnLaw)]
        self._watches_walls = scene.moves_walls or (wall_forces and bool(scene.walls))
        if self._watches_walls or tractions:
            engine.watch_walls(watched_solids(scene), *wall_owners(scene))
        self._has_tractions = tractions
        if tractions:
            engine.watch_patches()
        for servo in scene.servos:
            engine.hold_pressure(*core.servo_arguments(scene, servo))
        self._inlets = core.add_inlets(engine, scene)
        touch_solids(engine, scene)
        self._free_bodies = FreeBodies(scene)
        self._mean_mass = mean_mass

    def _bind(self, n_points: int) -> None:
        self._engine.bind(self._buffers, n_points, True)
        self._grow(self._engine.regroup())

    def _grow(self, needed: int) -> bool:
        """Give the core buffers of the capacity `needed`; 0 means that they suffice."""
        grown = needed > 0
        while needed:
            larger = allocate(self._engine, needed)
            for name, array in self._buffers.items():
                larger[name][..., : array.shape[-1]] = array
            self._engine.bind(larger, 0, False)
            self._buffers = larger
            needed = self._engine.regroup()
        return grown

    def _make_steps(self, max_steps: int, until: float) -> None:
        if not self._free_bodies:
            self._advance_core(max_steps, until)
            return
        end = self.steps + max_steps
        while (step := self.steps) < end and self.time < until:
            self._advance_core(min(end - step, INTERVAL - step % INTERVAL), until)
            if self.steps % INTERVAL == 0 or self.time >= until:
                self._free_bodies.check(self.bodies, self.time, self.steps)

    def _advance_core(self, max_steps: int, until: float) -> None:
        guard = keeping_exceptions(self._user_laws) if self._user_laws else nullcontext()
        try:
            with guard:
                needed = self._engine.advance(max_steps, until, self.threads)
        except RuntimeError as error:  # a SimulationError, too
            self._raise_of_laws(error)
            if isinstance(error, _core.SimulationError) and (hint := stiffness_hint(self.scene)):
                error.args = (f"{error}; {hint}",)
            raise
        if self._grow(needed):
            self._engine.tally()  # if one is due, as after any other step
        self._raise_of_laws(None)

    def _raise_of_laws(self, error: RuntimeError | None) -> None:
        """Raise the exceptions of user-defined laws; the core reports only that they failed."""
        for function in self._user_laws:
            failure = function.take_failure()
            if failure is not None:
                raise failure from error

    @property
    def cell_counts(self) -> IntArray:
        """Number of points in each active cell, one that has points or a neighbour with points."""
        return self._engine.cells()[1]

    @property
    def fluidity(self) -> _core.Fluidity | None:
        """Method of the diffusion of the fluidity, number of substeps and their limit [s].

        Also the number of iterations, and of cells in which negative values were set to zero, since
        this object was made. None for a local law.
        """
        return self._engine.fluidity()

    @property
    def bodies(self) -> tuple[rigid.BodyState, ...]:
        """States of the bodies of the scene, in their order: motion and impulses."""
        return tuple(rigid.state_of(row, self.scene.dim) for row in self._engine.bodies())

    @property
    def walls(self) -> tuple[WallState, ...]:
        """Impulses on the walls and blocks of the scene, in their order, and motion of the walls.

        They are the momentum that the points lose to the walls, so that the momentum of the points
        changes by the impulse of gravity less those on the walls and bodies (less the momentum lost
        to a sponge layer and by points that leave the domain). Where several meet, a component
        counts for a wall to which it is normal, else for a no-slip wall, a no-slip block, the
        roughest Coulomb wall, or a block.

        Raises
        ------
        ValueError
            If the simulation was not made with `wall_forces`, and no wall moves.
        """
        if not self._watches_walls and self.scene.walls:
            raise ValueError("wall_forces = False must be True for the impulses on the walls")
        rows = self._wall_rows()
        return tuple(WallState(**split_impulses(row, self.scene.dim)) for row in rows)

    @property
    def inflows(self) -> tuple[InflowState, ...]:
        """Account of each inflow of the scene, in their order: points that have entered or were
        missed."""
        rows = iter(self._engine.walls()[len(self.scene.walls) :] if self._watches_walls else ())
        states, at = self._engine.inflow()[1:], 0
        accounts = []
        for inflow, fields in zip(self.scene.inflows, self._inlets, strict=True):
            size = 2 + 2 * len(fields["mass"])
            row = next(rows) if inflow.driven else np.zeros(9)
            accounts.append(account(self.scene, fields, states[at : at + size], row))
            at += size
        return tuple(accounts)

    @property
    def buffers(self) -> dict[str, NDArray]:
        """Arrays of the core, not copied: {field: (component, capacity)} and "id".

        Points are grouped by cell; slots with a negative id are unused. When points spread, the
        core may replace the arrays by larger ones. Values written into them take effect from the
        next step on, if this property was read after the last step.
        """
        self._engine.refresh()
        return dict(self._buffers)

    def _slots(self) -> IntArray:
        """Return the slots of the points in the buffers, in the order of their ids."""
        ids = self._buffers["id"]
        living = np.flatnonzero(ids >= 0)
        if (end := int(ids.max(initial=-1)) + 1) <= SPARSE * len(ids):
            ordered = np.full(end, -1)
            ordered[ids[living]] = living  # by id, with gaps for points that have left
            return ordered if len(living) == end else ordered[ordered >= 0]
        return living[np.argsort(ids[living], kind="stable")]

    def _fields_to_gather(self, recorded: bool) -> list[tuple[str, int, np.dtype]]:
        """Return name, number of components and type of the fields of a state."""
        without = CARRIED if recorded else frozenset()
        fields = [(name, n, dtype) for name, n, *_, dtype in self._engine.fields()]
        ids = ("id", 1, np.dtype(np.int64))
        return [ids, *(field for field in fields if field[0] not in without)]

    def _columns(self, recorded: bool) -> dict[str, PointField]:
        """Return the fields of a state as the core has them."""
        return self._columns_at(self._slots(), recorded)

    def _columns_at(self, slots: IntArray, recorded: bool) -> dict[str, PointField]:
        fields = self._fields_to_gather(recorded)
        return {name: PointField(self._buffers[name], slots) for name, *_ in fields}

    def _sums(self, thorough: bool) -> CellSums:
        slots, counts, _ = self._engine.cells()
        parts = []
        for points in whole_groups(counts, SUMMED):
            columns = self._wrapped(self._columns_at(slots[points], recorded=True))
            state = self._state_of({name: field.whole() for name, field in columns.items()})
            parts.append(CellSums.from_state(state, self._marked(state, thorough)))
        return CellSums.joined(parts)

    def _gathered(self, recorded: bool) -> dict[str, PointField]:
        """Return the fields of a state, to be made column by column."""
        return self._wrapped(self._columns(recorded))

    def _wrapped(self, columns: dict[str, PointField]) -> dict[str, PointField]:
        grid = self.scene.grid
        # Positions are wrapped into the domain along periodic axes: ugimp groups by shifted cells.
        columns["x"].wrap = {
            int(d): (grid.lower[d], grid.shape[d] * grid.cell)
            for d in np.flatnonzero(grid.periodic)
        }
        return columns

    def _fields(self, recorded: bool) -> dict[str, NDArray]:
        return {name: field.whole() for name, field in self._gathered(recorded).items()}

    def _streamed(self) -> Streamed:
        scalars = self._engine.scalars()
        time, step, dt = scalars["time"], int(scalars["step"]), scalars["dt"]
        return Streamed(time, step, dt, self._gathered(recorded=True))

    def _tally(self) -> None:
        """Make the tally that is due."""
        self._engine.tally()

    def _marked(self, state: State, thorough: bool) -> dict[str, BoolArray]:
        marked, grid = dict[str, BoolArray](), self.scene.grid
        if "weight_correction" in state.fields:
            limit = self.scene.scheme.density.numbers()["weight_correction_limit"]
            at_limit = np.abs(state.weight_correction) >= AT_LIMIT * limit
            marked |= {"stressed": state.dense, "weights_at_limit": state.dense & at_limit}
        if thorough and any(wall.is_block for wall in self.scene.walls):
            marked["in_solids"] = deep_within(grid, self.scene.walls, state.x)
        if thorough and self.scene.bodies:
            phi, _ = distance_from_bodies(grid, self.scene.bodies, self.bodies)(state.x)
            marked["in_bodies"] = phi < -DEEPEST * grid.cell
        return marked

    def _indicators(self, sums: CellSums) -> dict[str, float]:
        self._tally()
        tally = self._engine.scalars()
        numbers: dict[str, float] = {
            "mach": tally["tally_fastest"] / self.scene.wave_speed,
            "compression": tally["tally_densest"],
            "dilution": abs(tally["tally_loosest"]),
            "strain_step": tally["tally_strain_step"],
        }
        for servo in self.scene.servos:
            moved = abs(float(self.walls[servo.wall].displacement))
            numbers["wall_strain"] = moved / core.extent(self.scene, servo.axis)
        totals = {"weights_at_limit": "stressed", "in_solids": "mass", "in_bodies": "mass"}
        shares = {name: sums.share(name, of) for name, of in totals.items() if name in sums.of}
        return numbers | shares

    # ---- restart ----

    def _checkpoint_data(self) -> tuple[dict[str, float | int], dict[str, NDArray | Rows]]:
        slots, *_ = self._engine.cells()
        arrays = {name: PointRows(array, slots) for name, array in self._buffers.items()}
        scalars = self._engine.scalars() | {"mean_mass": self._mean_mass}
        return scalars, {**arrays, **self._besides_points()}

    @classmethod
    def _filled(cls, scene: Scene, checkpoint: Checkpoint, machine: Machine) -> Self:
        self = object.__new__(cls)
        self._build_restored(scene, checkpoint, machine)
        n = len(checkpoint.arrays.get("id", ()))
        self._buffers = allocate(self._engine, n)
        arrays = self._checked(checkpoint)
        fill(self._buffers, arrays, np.arange(n))
        self._bind_restored(n, arrays)
        scalars = dict(checkpoint.scalars)
        del scalars["mean_mass"]
        self._engine.restore(scalars)
        return self

    def _build_restored(self, scene: Scene, checkpoint: Checkpoint, machine: Machine) -> None:
        """Build the core for a checkpoint, without points."""
        if "mean_mass" not in checkpoint.scalars:
            raise ValueError("the checkpoint has no mean_mass: it is not one of a simulation")
        mean_mass = positive("mean_mass of the checkpoint", checkpoint.scalars["mean_mass"])
        patches = stored_patches(checkpoint.arrays) is not None
        self._build(scene, mean_mass, machine, "walls" in checkpoint.arrays, patches)

    def _checked(self, checkpoint: Checkpoint) -> dict[str, NDArray]:
        """Return the arrays of a checkpoint; ValueError if they do not fit the scene."""
        arrays, scene = dict(checkpoint.arrays), self.scene
        ids = arrays.get("id", np.empty(0, dtype=np.int64))
        check_stored(self._engine, arrays, len(ids))
        names = {name for name, *_ in self._engine.fields()}
        for name, low, high in (
            ("mass", LEAST, LARGEST),
            ("material", 0, len(scene.materials) - 1),
            ("side", -1, 1),
            ("bulking", 0.1, 10.0),
        ):
            if name in names:
                check_range(arrays, name, low, high)
        if scene.bodies and "bodies" not in arrays:
            raise ValueError("the checkpoint does not hold the bodies of the scene")
        if scene.inflows:
            arrays["inflow"] = stored_inflow(arrays, ids)
        return arrays

    def _bind_restored(self, n_points: int, arrays: Mapping[str, NDArray]) -> None:
        """Bind the points of a restart, and set what the core has besides them."""
        engine = self._engine
        if (patches := stored_patches(arrays)) is not None:
            engine.restore_patches(*patches)
        if "walls" in arrays:
            engine.restore_walls(arrays["walls"])
        if self.scene.bodies:  # before the points: those near thin bodies are grouped by side
            if "bodies" in arrays:
                engine.restore_bodies(arrays["bodies"])
            if "split" in arrays:
                engine.restore_split(arrays["split"])
        self._bind(n_points)
        if self.scene.inflows and "inflow" in arrays:
            engine.restore_inflow(arrays["inflow"])
        if "calm" in arrays:
            engine.restore_calm(arrays["calm"])

    def _besides_points(self) -> dict[str, NDArray]:
        """Return what the core has besides the points, for a restart."""
        engine, arrays = self._engine, dict[str, NDArray]()
        if self.scene.bodies:
            arrays |= {"bodies": engine.bodies(), "split": engine.split()}
        if self._watches_walls:
            arrays |= {"walls": engine.walls()}
        if self._has_tractions:
            places, numbers = self._patch_rows()
            arrays |= {"patch_places": places, "patch_numbers": numbers}
        if self.scene.inflows:
            arrays |= {"inflow": engine.inflow()}
        if self.scene.scheme.sleep_speed:
            arrays |= {"calm": self._calm()}
        return arrays

    def _patch_rows(self) -> tuple[IntArray, NDArray]:
        """Return places and numbers of the patches, in the order of their places."""
        return in_order(*self._engine.patches())

    def _calm(self) -> IntArray:
        """Return the cells that are calm, and for how long they are, in the order of the grid."""
        calm = self._engine.calm()
        return calm.take(np.argsort(calm[0], kind="stable"), axis=1)

    @classmethod
    def _adapted(cls, before: Any, scene: Any, checkpoint: Checkpoint) -> Checkpoint:
        """Return a checkpoint of one scene with which a run goes on under a changed one.

        Material at rest may move, the time step may be too long, and the densities of
        hypoelastic materials follow from their stresses.
        """
        arrays = {name: array for name, array in checkpoint.arrays.items() if name != "calm"}
        old, new = (np.array([material.K for material in s.materials]) for s in (before, scene))
        hencky = [material.elasticity == "hencky" for material in scene.materials]
        number = arrays["material"].ravel().astype(np.intp) if len(new) > 1 else 0
        share = np.where(hencky, 1.0, old / new)[number]
        stressed = np.any(arrays["stress"], axis=0)
        arrays["log_density"] = np.where(stressed, share, 1.0) * arrays["log_density"]
        for i, (last, now) in enumerate(zip(before.bodies, scene.bodies, strict=True)):
            if last.motion != now.motion:  # instead of what has driven it from outside
                arrays["bodies"] = np.array(arrays["bodies"])
                arrays["bodies"][i, rigid.place_of("driven", "driven")] = 0.0
        # The flutter damping, which depends on gravity, begins anew with it.
        for name in {"overstress", "mean_shear_rate"} - set(arrays):
            arrays[name] = np.zeros((1, len(arrays["id"])))
        scalars = {  # another account of energy
            name: 0.0 if name.startswith("tally_") else value
            for name, value in checkpoint.scalars.items()
        }
        scalars |= {"tally_time": -1.0, "dt": 0.0}  # a new step, too, at the first
        return replace(checkpoint, arrays=arrays, scalars=scalars)

    def _body_rows(self) -> NDArray:
        return self._engine.bodies()

    def _extra_state(self) -> dict[str, tuple[rigid.BodyState, ...]]:
        return {"bodies": self.bodies}

    def _wall_rows(self) -> NDArray:
        if not self._watches_walls:
            return np.empty((0, 9))
        return self._engine.walls()[: len(self.scene.walls)]

    def _patches(self) -> dict[str, NDArray] | None:
        return patch_fields(self.scene, *self._patch_rows()) if self._has_tractions else None

    def _energies(self) -> Energies | None:
        self._tally()
        tally = self._engine.scalars()
        if tally["tally_time"] != tally["time"]:
            return None
        work = tally["tally_gravity_work"] + sum(float(body.work) for body in self.bodies)
        if self._watches_walls:
            work += sum(float(wall.work) for wall in self.walls)
        work += sum(inflow.work + inflow.energy for inflow in self.inflows)
        lost = tally["tally_plastic_work"] + tally["tally_outflow"]
        return Energies(tally["tally_energy"], lost, work)
