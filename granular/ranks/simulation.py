"""A run that several processes share: rank 0 has the simulation, the others serve it."""

from __future__ import annotations

import atexit
import itertools
import threading
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.mpm import engine as core
from granular.mpm import memory
from granular.mpm.body_overlaps import check_overlaps
from granular.mpm.patches import in_order
from granular.mpm.point_field import PointField
from granular.mpm.scene import Scene
from granular.mpm.simulation import Simulation
from granular.ranks.communicator import (
    Communicator,
    LostRankError,
    MpiCommunicator,
    communicator,
)
from granular.ranks.part import Part, Plan, bare, joined, remoteness
from granular.ranks.partition import EDGES, RUNS, UNEVEN, edge_of_blocks, owners_of_blocks
from granular.ranks.worker import is_serving, serve
from granular.record import Checkpoint
from granular.run import diagnostics
from granular.run.interrupts import DeferredSignals
from granular.run.restarts import check_numbers
from granular.run.running import default_threads
from granular.tools.arrays import BoolArray, IntArray
from granular.tools.buffers import default_isa, stored_type
from granular.tools.checks import positive, truth

BALANCED = 20
"""Calls of the core, of about a twentieth of a second each, after which the division of the
points is checked."""


Arguments = Callable[[int], tuple]
"""Arguments of a request to a rank."""


class _Team:
    """The ranks of a communicator as rank 0 sees them."""

    def __init__(self, ranks: Communicator) -> None:
        self.ranks = ranks
        self.closing: list[int] = []  # parts that are no longer used
        self.lost = False
        self._numbers = itertools.count()
        self._lock = threading.Lock()  # columns of a frame are made ahead in a thread
        self._asking: int | None = None  # the thread that waits for answers

    def number(self) -> int:
        """Number of a new run."""
        return next(self._numbers)

    def close(self, number: int) -> None:
        """Note that a run is no longer used; the next request says so."""
        self.closing.append(number)

    def ask(self, number: int, name: str, arguments: Arguments, call: Callable[[], Any]) -> list:
        """Ask all ranks, rank 0 by a function; return their answers in the order of ranks.

        The arguments of a rank are made when they are sent.

        Signals wait: an exception between request and answer would confuse all that follow.
        """
        if self._asking == threading.get_ident() or is_serving():
            raise RuntimeError("a function that runs on each rank must not use the simulation")
        with DeferredSignals(), self._lock:
            self._asking = threading.get_ident()
            try:
                return self._answers(number, name, arguments, call)
            finally:
                self._asking = None

    def _answers(
        self, number: int, name: str, arguments: Arguments, call: Callable[[], Any]
    ) -> list:
        if self.lost:
            raise LostRankError("a rank of the run does not answer; start the run again")
        ranks = self.ranks
        answers: list[Any] = [None] * ranks.size
        errors: list[BaseException] = []
        while self.closing:
            self._tell(self.closing.pop(), "close")
        for rank in range(1, ranks.size):
            ranks.send((number, name, arguments(rank)), rank)
        try:
            answers[0] = call()
        except BaseException as error:  # raised when all have answered
            errors.append(error)
        for rank in range(1, ranks.size):
            try:
                good, answers[rank] = ranks.receive(rank)
                if not good:
                    errors.append(answers[rank])
            except LostRankError as error:
                errors.append(error)
                break
            except Exception as error:  # what cannot be unpickled here
                errors.append(error)
        self.lost = any(isinstance(error, LostRankError) for error in errors)
        if errors:
            raise min(errors, key=remoteness)
        return answers

    def _tell(self, number: int, name: str) -> None:
        for rank in range(1, self.ranks.size):
            self.ranks.send((number, name, ()), rank)
        for rank in range(1, self.ranks.size):
            self.ranks.receive(rank)

    def end(self) -> None:
        """Let the other processes end; by force if one of them does not answer."""
        if self.lost:
            self.ranks.abort()
        else:
            for rank in range(1, self.ranks.size):
                self.ranks.send(None, rank)


_TEAMS: dict[int, _Team] = {}
"""Teams by the identity of their communicators."""


def _team_of(ranks: Communicator) -> _Team:
    team = _TEAMS.get(id(ranks))
    if team is None or team.ranks is not ranks:
        team = _TEAMS[id(ranks)] = _Team(ranks)
        if isinstance(ranks, MpiCommunicator):  # threads end with their block
            atexit.register(team.end)
    return team


def attend(comm: Any) -> Communicator:
    """Return the communicator of rank 0; any other rank serves it, and exits when it ends."""
    ranks = communicator(comm)
    if ranks.rank:
        serve(ranks)
        raise SystemExit(0)
    _team_of(ranks)  # which lets the others end, however this process ends
    return ranks


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
        force: bool = False,
        wall_forces: bool = False,
        tractions: bool = False,
    ) -> None:
        ranks = attend(comm)
        wall_forces = truth("tractions", tractions) or truth("wall_forces", wall_forces)
        memory.check(scene, force, ranks.on_this_machine / ranks.size)
        check_overlaps(scene)
        diagnostics.warn(scene)
        points = scene.points()
        plan = Plan(
            scene=scene,
            mean_mass=core.mean_mass(scene, core.masses_of(scene, points)),
            threads=threads,
            isa=isa or default_isa(),
            wall_forces=wall_forces,
            tractions=tractions,
        )
        empty, besides = bare(plan), dict[str, NDArray]()
        if scene.inflows:
            besides["inflow"] = empty._engine.inflow()
            besides["inflow"][0] = len(points.x)  # the id of the first point that enters

        def part(chosen: BoolArray) -> dict[str, NDArray]:
            fields = core.fields_of(scene, points.taken(chosen))
            rows = {name: np.ascontiguousarray(np.atleast_2d(a.T)) for name, a in fields.items()}
            return {**rows, "id": np.flatnonzero(chosen)}

        self._distribute(ranks, plan, empty, np.ascontiguousarray(points.x.T), part, None, besides)

    @classmethod
    def _restored_by(
        cls,
        ranks: Communicator,
        scene: Scene,
        checkpoint: Checkpoint,
        threads: int | None,
        isa: str | None,
    ) -> RankedSimulation:
        check_numbers(checkpoint)
        empty: Simulation = object.__new__(Simulation)
        empty._build_restored(scene, checkpoint, threads, isa)
        arrays = empty._checked(checkpoint)
        scalars = dict(checkpoint.scalars)
        plan = Plan(
            scene=scene,
            mean_mass=float(scalars.pop("mean_mass")),
            threads=threads,
            isa=empty.isa,
            wall_forces=empty._watches_walls,
            tractions=empty._has_tractions,
        )
        names = {*(field[0] for field in empty._engine.fields()), "id"}
        besides = {name: array for name, array in arrays.items() if name not in names}

        def part(chosen: BoolArray) -> dict[str, NDArray]:
            return {name: np.ascontiguousarray(arrays[name][..., chosen]) for name in names}

        sim = object.__new__(cls)
        sim._distribute(ranks, plan, empty, arrays["x"], part, scalars, besides)
        sim._monitor.restore(checkpoint.arrays, checkpoint.step)
        return sim

    def _distribute(
        self,
        ranks: Communicator,
        plan: Plan,
        empty: Simulation,
        x: NDArray,
        part: Callable[[BoolArray], dict[str, NDArray]],
        scalars: dict[str, float | int] | None,
        besides: dict[str, NDArray],
    ) -> None:
        """Give each rank its cells, and the points in them: `part` has the fields of some."""
        size = ranks.size
        edge, owners, blocks = _divided(empty, x, size)
        available = default_threads(x.shape[1]) // ranks.on_this_machine
        threads = plan.threads or max(available, 1)
        plan = replace(plan, threads=threads, edge=edge, owners=owners)
        to = owners[blocks]
        del blocks

        def request(rank: int) -> tuple:
            counts = {} if rank == 0 else {"dropped": 0, "clamped": 0}
            return plan, part(to == rank), scalars and scalars | counts, besides

        self._team = _team_of(ranks)
        self._number = self._team.number()
        weakref.finalize(self, self._team.close, self._number)
        self._here: Part | None = None

        def build() -> dict[str, int]:
            self._here = Part(ranks, *request(0))
            return self._here.counts()

        self._counts = self._team.ask(self._number, "build", request, build)
        sets = self._ask("isa")
        if "baseline" in sets and len(set(sets)) > 1:
            raise ValueError(
                f"isa: ranks have the instruction sets {', '.join(sets)}, with other bits: give "
                "isa='baseline' for all"
            )
        self._start(plan.scene, self._part.simulation._engine, threads)
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

        def call() -> Any:
            return getattr(self._part, name)(*arguments)

        return self._team.ask(self._number, name, lambda _: arguments, call)

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

        self._counts = self._team.ask(self._number, "moved", lambda _: (owners,), move)
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

    def _ordered(self, name: str, k: int, order: IntArray) -> NDArray:
        """Return a component of a field of all points in the order of their cells."""
        return np.concatenate(self._ask("column", name, k, "cell")).take(order)

    def _checkpoint_data(self) -> tuple[dict[str, float | int], dict[str, NDArray]]:
        order = np.argsort(np.concatenate(self._ask("cells")), kind="stable")
        arrays = {"id": self._ordered("id", 0, order)}
        for name, n, *_, dtype in self._engine.fields():
            arrays[name] = np.empty((n, len(order)), dtype=stored_type(dtype))
            for k, row in enumerate(arrays[name]):
                row[:] = self._ordered(name, k, order)
        scalars = self._engine.scalars() | {"mean_mass": self._mean_mass}
        scalars |= {name: self._total(name) for name in self._counts[0]}
        return scalars, arrays | self._besides_points()

    def _patch_rows(self) -> tuple[IntArray, NDArray]:
        places, numbers = zip(*self._ask("patches"), strict=True)
        return in_order(np.concatenate(places), np.concatenate(numbers))

    def _calm(self) -> IntArray:
        return joined([{"calm": calm} for calm in self._ask("calm")])["calm"]

    def _drive(self, body: int, rates: tuple[float, ...]) -> None:
        self._ask("drive", body, rates)

    def _load(self, body: int, load: tuple[float, ...]) -> None:
        self._ask("load", body, load)


def _divided(
    empty: Simulation, x: NDArray, size: int
) -> tuple[int, NDArray[np.int32], NDArray[np.int64]]:
    """Return the edge of blocks, the owner of each block, and the block of each point."""
    engine: _core.Engine = empty._engine
    weights: dict[int, NDArray] = {}
    blocks: dict[int, NDArray] = {}
    nonlocal_law = empty.scene.nonlocal_material is not None
    for edge in (RUNS,) if nonlocal_law else EDGES[empty.scene.dim]:
        blocks[edge] = engine.places(x, edge)[1]
        weights[edge] = np.bincount(blocks[edge], minlength=int(np.prod(engine.blocks(edge))))
    edge = edge_of_blocks({e: int((w > 0).sum()) for e, w in weights.items()}, size)
    owners = owners_of_blocks(weights[edge], engine.blocks(edge), size)
    return edge, owners, blocks[edge]
