"""A run that several processes share: rank 0 has the simulation, the others serve it."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.measure.cell_sums import CellSums
from granular.mpm import engine as core
from granular.mpm import memory
from granular.mpm.body_overlaps import check_overlaps
from granular.mpm.patches import in_order
from granular.mpm.point_field import PointField
from granular.mpm.scene import Scene
from granular.mpm.simulation import Simulation
from granular.ranks.communicator import Communicator
from granular.ranks.part import Part, Plan, bare, joined
from granular.ranks.partition import EDGES, RUNS, UNEVEN, edge_of_blocks, owners_of_blocks
from granular.ranks.team import attend, team_of
from granular.record import Checkpoint
from granular.record.layout import Rows
from granular.run import diagnostics
from granular.run.machine import Machine
from granular.run.restarts import check_numbers
from granular.run.running import default_threads
from granular.tools.arrays import BoolArray, IntArray
from granular.tools.buffers import stored_type
from granular.tools.checks import positive, truth

BALANCED = 20
"""Calls of the core, of about a twentieth of a second each, after which the division of the
points is checked."""


ALONE = "processes share runs on processors alone"
"""Why a device is refused."""

AT_ONCE = 1 << 19
"""Points of a restart that are handed out at a time."""


class _Collected(PointField):
    """A field of the points of all ranks in the order of their ids, made column by column."""

    def __init__(
        self, sim: RankedSimulation, name: str, components: int, dtype: np.dtype, order: IntArray
    ) -> None:
        self.dtype, self._sim, self._name, self._order = stored_type(dtype), sim, name, order
        self.shape = (len(order), *((components,) if components > 1 else ()))
        self.wrap = {}

    def _take(self, k: int, column: NDArray) -> None:
        parts = self._sim._ask("column", self._name, k, "id")
        column[:] = np.concatenate(parts).take(self._order)


class _CollectedRows:
    """A field of the points of all ranks in the order of their cells, made row by row."""

    def __init__(
        self, sim: RankedSimulation, name: str, components: int, dtype: np.dtype, order: IntArray
    ) -> None:
        self.dtype, self._sim, self._name, self._order = stored_type(dtype), sim, name, order
        self.shape = (len(order),) if name == "id" else (components, len(order))

    def row(self, k: int) -> NDArray:
        """Return a row; see `granular.record.layout.Rows`."""
        parts = self._sim._ask("column", self._name, k, "cell")
        return np.concatenate(parts).take(self._order)


class RankedSimulation(Simulation, shares=Simulation):
    """A simulation by the material point method that several processes share.

    ``granular.Simulation(scene, comm=comm)`` makes one on rank 0. On all other ranks the same call
    does what rank 0 asks for, and exits when rank 0 ends: a script needs nothing else for them.

    Parameters
    ----------
    scene, isa, force, wall_forces, tractions
        As of `granular.Simulation`.
    comm : mpi4py.MPI.Comm
        Communicator of the ranks; or one of `granular.ranks.threads`.
    threads : int, optional
        Threads of each rank; by default the processors that the process may use, divided by the
        ranks of this machine. The results depend neither on them nor on the ranks, to the last bit.

    Raises
    ------
    ValueError
        As of `granular.Simulation`.
    """

    @staticmethod
    def _attend(comm: Any) -> Communicator:
        return attend(comm)

    def __init__(
        self,
        scene: Scene,
        *,
        comm: Any,
        threads: int | None = None,
        isa: str | None = None,
        device: None = None,
        force: bool = False,
        wall_forces: bool = False,
        tractions: bool = False,
    ) -> None:
        machine = Machine(threads, isa, device)
        machine.refuse_device(ALONE)
        ranks = attend(comm)
        wall_forces = truth("tractions", tractions) or truth("wall_forces", wall_forces)
        memory.check(scene, force, ranks.on_this_machine / ranks.size)
        check_overlaps(scene)
        diagnostics.warn(scene)
        plan = Plan(
            scene=scene,
            mean_mass=1.0,  # for an engine that is asked for places alone
            machine=machine,
            wall_forces=wall_forces,
            tractions=tractions,
        )
        empty, besides = bare(plan), dict[str, NDArray]()
        weights, points = _Weights(empty), scene.points_in_parts()

        def weighed() -> Iterator[dict[str, NDArray]]:
            for part in core.initial_parts(scene, points):
                weights.add(part["x"].T)
                yield part

        plan = replace(plan, mean_mass=core.mean_mass(scene, weighed()))
        if scene.inflows:
            besides["inflow"] = empty._engine.inflow()
            besides["inflow"][0] = weights.n  # the id of the first point that enters

        def rows() -> Iterator[dict[str, NDArray]]:
            first = 0
            for part in core.initial_parts(scene, points):  # again: not to keep them
                n = len(part["x"])
                fields = {name: np.atleast_2d(a.T) for name, a in part.items()}
                yield {**fields, "id": np.arange(first, first + n)}
                first += n

        self._distribute(ranks, plan, empty, weights, rows(), None, besides)

    @classmethod
    def _restored_by(
        cls,
        ranks: Communicator,
        scene: Scene,
        checkpoint: Checkpoint,
        machine: Machine,
    ) -> RankedSimulation:
        machine.refuse_device(ALONE)
        check_numbers(checkpoint)
        empty: Simulation = object.__new__(Simulation)
        empty._build_restored(scene, checkpoint, machine)
        arrays = empty._checked(checkpoint)
        scalars = dict(checkpoint.scalars)
        plan = Plan(
            scene=scene,
            mean_mass=float(scalars.pop("mean_mass")),
            machine=replace(machine, isa=empty.isa),
            wall_forces=empty._watches_walls,
            tractions=empty._has_tractions,
        )
        names = {*(field[0] for field in empty._engine.fields()), "id"}
        besides = {name: array for name, array in arrays.items() if name not in names}

        def rows() -> Iterator[dict[str, NDArray]]:
            for first in range(0, len(arrays["id"]), AT_ONCE):
                yield {name: arrays[name][..., first : first + AT_ONCE] for name in names}

        weights = _Weights(empty)
        for part in rows():
            weights.add(part["x"])
        sim = object.__new__(cls)
        sim._distribute(ranks, plan, empty, weights, rows(), scalars, besides)
        sim._monitor.restore(checkpoint.arrays, checkpoint.step)
        return sim

    def _distribute(
        self,
        ranks: Communicator,
        plan: Plan,
        empty: Simulation,
        weights: _Weights,
        rows: Iterable[dict[str, NDArray]],
        scalars: dict[str, float | int] | None,
        besides: dict[str, NDArray],
    ) -> None:
        """Give each rank its cells, and the points in them: `rows` has some points at a time."""
        size = ranks.size
        edge, owners = weights.divided(size)
        available = default_threads(empty.scene.dim) // ranks.on_this_machine
        threads = plan.machine.threads or max(available, 1)
        machine = replace(plan.machine, threads=threads)
        plan = replace(plan, machine=machine, edge=edge, owners=owners)
        self._team = team_of(ranks)
        self._number = self._team.number()
        weakref.finalize(self, self._team.close, self._number)
        self._here: Part | None = None

        def build() -> str:
            self._here = Part(ranks, plan)
            return self._here.isa()

        sets = self._team.ask(self._number, "build", [(plan,)] * size, build)
        if "baseline" in sets and len(set(sets)) > 1:
            raise ValueError(
                f"isa: ranks have the instruction sets {', '.join(sets)}, with other bits: give "
                "isa='baseline' for all"
            )
        for part in rows:
            to = owners[empty._engine.places(np.ascontiguousarray(part["x"]), edge)[1]]
            self._tell_each("take", [(_of(part, to == rank),) for rank in range(size)])
        counts = [{}, *[{"dropped": 0, "clamped": 0}] * (size - 1)]
        self._counts = self._tell_each(
            "begin", [(scalars and scalars | more, besides) for more in counts]
        )
        self._start(plan.scene, self._part.simulation._engine, machine)
        self._mean_mass = plan.mean_mass
        self._watches_walls = self._part.simulation._watches_walls
        self._has_tractions = plan.tractions
        self._inlets = self._part.simulation._inlets
        self._advances = 0

    @property
    def _part(self) -> Part:
        if self._here is None:
            raise RuntimeError("the run has no part on rank 0")
        return self._here

    def _ask(self, name: str, *arguments: Any) -> list:
        """Let each rank call a method of its part; return the results in the order of ranks."""
        return self._tell_each(name, [arguments] * self._team.ranks.size)

    def _tell_each(self, name: str, arguments: Sequence[tuple]) -> list:
        """Let each rank call a method of its part with arguments of its own."""

        def call() -> Any:
            return getattr(self._part, name)(*arguments[0])

        return self._team.ask(self._number, name, arguments, call)

    # ---- steps ----

    def _make_steps(self, max_steps: int, until: float) -> None:
        self._counts = self._ask("advance", max_steps, until)
        self._advances += 1
        if self._advances % BALANCED == 0:
            self.balance()

    def balance(self, uneven: float = UNEVEN) -> bool:
        """Divide the points anew if they are uneven; the results do not depend on it.

        A run does so by itself.

        Parameters
        ----------
        uneven : float
            Largest number of points of a rank over their mean from which on it is done, at least 1.

        Returns
        -------
        bool
            Whether blocks of cells have changed their owners.
        """
        positive("uneven", uneven)
        points = [counts["n_points"] for counts in self._counts]
        if max(points) <= uneven * max(sum(points) / len(points), 1):
            return False
        plan = self._part.plan
        weights = np.sum(self._ask("weights"), axis=0)
        shape = self._engine.blocks(plan.edge)
        owners = owners_of_blocks(weights, shape, self._team.ranks.size)
        if np.array_equal(owners, plan.owners):
            return False

        def move() -> dict[str, int]:
            self._here = self._part.moved(owners)
            return self._here.counts()

        given = [(owners,)] * self._team.ranks.size
        self._counts = self._team.ask(self._number, "moved", given, move)
        self._engine = self._part.simulation._engine
        return True

    def _total(self, name: str) -> int:
        return sum(counts[name] for counts in self._counts)

    @property
    def n_points(self) -> int:
        """Number of points in the domain, of all ranks."""
        return self._total("n_points")

    @property
    def points_of_ranks(self) -> tuple[int, ...]:
        """Number of points of each rank."""
        return tuple(counts["n_points"] for counts in self._counts)

    @property
    def dt(self) -> float:
        """Time step [s] of the last step; before the first step, of the first one."""
        return self._engine.scalars()["dt"] or self._ask("stable_dt")[0]

    @property
    def traffic(self) -> list[_core.Traffic]:
        """For each rank: ``peers``, ranks with cells near to its own; ``sent_cells`` and
        ``ghost_cells`` of a step; since the points were divided ``sent_bytes``, and the times that
        it waited for messages and that numbers were copied into and out of them,
        ``seconds_waiting`` and ``seconds_copying`` [s]."""
        return self._ask("traffic")

    def on_each_rank(self, function: Callable[[Any], Any]) -> list:
        """Call a function with the state of the points of each rank, in its process.

        Parameters
        ----------
        function : callable
            Called with a `granular.State`; a function of a module, which can be pickled, as its
            result. It must not use the simulation. Sums over points need no more than this,
            whereas `state` gathers all points on rank 0.

        Returns
        -------
        list
            Its results in the order of the ranks.
        """
        return self._ask("apply", function)

    @property
    def buffers(self) -> dict[str, NDArray]:
        """Not of a simulation that ranks share: raises ValueError."""
        raise ValueError(
            "buffers: each rank has those of its own points; use `state`, or `on_each_rank`"
        )

    @property
    def cell_counts(self) -> IntArray:
        """Not of a simulation that ranks share: raises ValueError."""
        raise ValueError("cell_counts: each rank has those of its own cells; use `state`")

    # ---- the state of all points ----

    def _sums(self, thorough: bool) -> CellSums:
        return CellSums.joined(self._ask("sums", thorough))

    def _tally(self) -> None:
        self._ask("tally")

    def _columns(self, recorded: bool) -> dict[str, PointField]:
        order: IntArray = np.argsort(
            np.concatenate(self._ask("column", "id", 0, "id")), kind="stable"
        )
        return {
            name: _Collected(self, name, n, dtype, order)
            for name, n, dtype in self._fields_to_gather(recorded)
        }

    def _checkpoint_data(self) -> tuple[dict[str, float | int], dict[str, NDArray | Rows]]:
        order = np.argsort(np.concatenate(self._ask("cells")), kind="stable")
        fields = [("id", 1, np.dtype(np.int64))]
        fields += [(name, n, dtype) for name, n, *_, dtype in self._engine.fields()]
        arrays = {name: _CollectedRows(self, name, n, dtype, order) for name, n, dtype in fields}
        scalars = self._engine.scalars() | {"mean_mass": self._mean_mass}
        scalars |= {name: self._total(name) for name in self._counts[0]}
        return scalars, {**arrays, **self._besides_points()}

    def _patch_rows(self) -> tuple[IntArray, NDArray]:
        places, numbers = zip(*self._ask("patches"), strict=True)
        return in_order(np.concatenate(places), np.concatenate(numbers))

    def _calm(self) -> IntArray:
        return joined([{"calm": calm} for calm in self._ask("calm")])["calm"]

    def _drive(self, body: int, rates: tuple[float, ...]) -> None:
        self._ask("drive", body, rates)

    def _load(self, body: int, load: tuple[float, ...]) -> None:
        self._ask("load", body, load)


def _of(rows: dict[str, NDArray], which: BoolArray) -> dict[str, NDArray]:
    """Return some points, with fields in memory of their own."""
    return {name: np.ascontiguousarray(array[..., which]) for name, array in rows.items()}


class _Weights:
    """Numbers of points of the blocks into which cells may be divided.

    Attributes
    ----------
    n : int
        Number of points.
    """

    def __init__(self, empty: Simulation) -> None:
        self._engine: _core.Engine = empty._engine
        nonlocal_law = empty.scene.nonlocal_material is not None
        edges = (RUNS,) if nonlocal_law else EDGES[empty.scene.dim]
        self.n = 0
        self._of = {edge: np.zeros(np.prod(self._engine.blocks(edge)), int) for edge in edges}

    def add(self, x: NDArray) -> None:
        """Count points at these positions, (dim, n) [m]."""
        self.n += x.shape[1]
        for edge, weights in self._of.items():
            blocks = self._engine.places(np.ascontiguousarray(x), edge)[1]
            weights += np.bincount(blocks, minlength=len(weights))

    def divided(self, size: int) -> tuple[int, NDArray[np.int32]]:
        """Return the edge of blocks for a number of ranks, and the owner of each block."""
        edge = edge_of_blocks({e: int((w > 0).sum()) for e, w in self._of.items()}, size)
        return edge, owners_of_blocks(self._of[edge], self._engine.blocks(edge), size)
