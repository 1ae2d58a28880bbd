"""The part of a run that a rank has: points of its own cells, and what it does when it is asked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular import _core
from granular.measure.cell_sums import CellSums
from granular.mpm.patches import in_order
from granular.mpm.scene import Scene
from granular.mpm.simulation import Simulation
from granular.ranks.communicator import Communicator, Link, LostRankError
from granular.run.machine import Machine
from granular.tools.arrays import IntArray
from granular.tools.buffers import allocate, stored_type

SPREAD = {"calm": 1, "patch_places": 0, "patch_numbers": 0}
"""Arrays of a restart, besides those of points, of which each rank has a part; and its axis."""


@dataclass(frozen=True)
class Plan:
    """The scene and the division of a run, the same on all ranks.

    Attributes
    ----------
    scene : Scene
        The scene of the run.
    mean_mass : float
        Mean mass of its points at the start [kg].
    machine : Machine
        Threads of each rank, and the instruction set of the kernels.
    wall_forces, tractions : bool
        Whether the impulses on walls are added up, and those on patches of walls and bodies.
    edge : int
        Cells of a block along each axis.
    owners : ndarray of int32
        The rank of each block.
    """

    scene: Scene
    mean_mass: float
    machine: Machine
    wall_forces: bool
    tractions: bool
    edge: int = 0
    owners: NDArray[np.int32] = field(default_factory=lambda: np.empty(0, np.int32))


class Part:
    """Points of a rank and the core that advances them.

    It has none at first: `take` is given some at a time, and `begin` follows.

    Parameters
    ----------
    communicator : Communicator
        The ranks of the run.
    plan : Plan
        What all of them have in common.
    """

    def __init__(self, communicator: Communicator, plan: Plan) -> None:
        self._communicator, self.plan = communicator, plan
        self.link = Link(communicator)
        self.simulation = bare(plan)
        engine = self.simulation._engine
        engine.share(self.link, communicator.rank, communicator.size, plan.edge, plan.owners)
        self._taken: list[Mapping[str, NDArray]] = []
        self._orders: dict[str, IntArray] = {}  # slots of the points, until the next step

    def take(self, rows: Mapping[str, NDArray]) -> None:
        """Take points of this rank, in the order of their ids or cells.

        Parameters
        ----------
        rows : mapping
            Their fields, (components, n), and "id"; those that are missing are zero.
        """
        self._taken.append(rows)

    def begin(
        self,
        scalars: Mapping[str, float | int] | None = None,
        besides: Mapping[str, NDArray] | None = None,
    ) -> dict[str, int]:
        """Begin with the points taken; return the counts of the points of this rank.

        Parameters
        ----------
        scalars : mapping, optional
            Numbers of a restart.
        besides : mapping, optional
            What a restart has besides points, of the whole run: bodies, impulses on walls, ...
        """
        engine, first = self.simulation._engine, 0
        n = sum(len(rows["id"]) for rows in self._taken)
        self.simulation._buffers = allocate(engine, n)
        while self._taken:
            rows = self._taken.pop(0)
            last = first + len(rows["id"])
            for name, values in rows.items():
                self.simulation._buffers[name][..., first:last] = values
            first = last
        self._guarded(lambda: self.simulation._bind_restored(n, besides or {}))
        if scalars is not None:
            engine.restore({**scalars, "n_points": n})
        return self.counts()

    def _guarded(self, call: Callable[[], None]) -> None:
        try:
            call()
        except RuntimeError as error:
            if self.link.error is not None:
                raise self.link.error from error
            raise

    def advance(self, max_steps: int, until: float) -> dict[str, int]:
        """Make steps; return the counts of the points of this rank."""
        self._orders.clear()
        self._guarded(lambda: self.simulation._make_steps(max_steps, until))
        return self.counts()

    def counts(self) -> dict[str, int]:
        """Return the numbers of points that are here, and that have left or were brought back."""
        scalars = self.simulation._engine.scalars()
        return {name: int(scalars[name]) for name in ("n_points", "dropped", "clamped")}

    def isa(self) -> str:
        """Return the instruction set of the kernels."""
        return self.simulation.isa

    def tally(self) -> None:
        """Make the tally that is due."""
        self._guarded(self.simulation._engine.tally)

    def stable_dt(self) -> float:
        """Return the longest stable time step [s]."""
        return self.simulation._engine.stable_dt()

    def _slots(self, order: str) -> IntArray:
        """Return the slots of the points by "id" or "cell"."""
        if order not in self._orders:
            by_cell = order == "cell"
            simulation = self.simulation
            slots = simulation._engine.cells()[0] if by_cell else simulation._slots()
            self._orders[order] = slots
        return self._orders[order]

    def column(self, name: str, k: int, order: str) -> NDArray:
        """Return a component of a field of the points, in the order of "id" or "cell", as frames
        and checkpoints have it."""
        array = np.atleast_2d(self.simulation._buffers[name])[k]
        return array.take(self._slots(order)).astype(stored_type(array.dtype), copy=False)

    def cells(self) -> IntArray:
        """Return the places of the cells of the points in the order of cells, in this order."""
        _, counts, places = self.simulation._engine.cells()
        return np.repeat(places, counts)

    def _rows(self) -> dict[str, NDArray]:
        """Return all fields of the points in the order of their cells, as a checkpoint has them."""
        slots = self._slots("cell")
        return {
            name: array.take(slots, axis=-1).astype(stored_type(array.dtype), copy=False)
            for name, array in self.simulation._buffers.items()
        }

    def weights(self) -> NDArray[np.int64]:
        """Return the number of points of each block."""
        x = self.simulation._buffers["x"].take(self._slots("cell"), axis=-1)
        _, blocks = self.simulation._engine.places(x, self.plan.edge)
        return np.bincount(blocks, minlength=len(self.plan.owners))

    def traffic(self) -> _core.Traffic | None:
        """Return the number of ghost cells, of cells and of bytes that are sent, and times."""
        return self.simulation._engine.traffic()

    def drive(self, body: int, rates: tuple[float, ...]) -> None:
        """Set the velocities of a body from now on."""
        self.simulation._drive(body, rates)

    def load(self, body: int, load: tuple[float, ...]) -> None:
        """Set the load on a body from now on."""
        self.simulation._load(body, load)

    def patches(self) -> tuple[IntArray, NDArray]:
        """Return places and numbers of the patches whose impulses this rank has."""
        return self.simulation._engine.patches()

    def calm(self) -> IntArray:
        """Return the cells of this rank that are calm, and for how long they are."""
        return self.simulation._engine.calm()

    def _besides_points(self) -> dict[str, NDArray]:
        """Return what a restart has besides points, of the whole run."""
        besides, size = self.simulation._besides_points(), self._communicator.size
        mine = {name: besides[name] for name in SPREAD if name in besides}
        if mine:
            for name, rows in joined(_all_to_all(self._communicator, [mine] * size)).items():
                besides[name] = rows
        return besides

    def sums(self, thorough: bool) -> CellSums:
        """Return the sums of the points of this rank over its cells."""
        return self.simulation._sums(thorough)

    def apply(self, function: Callable[[Any], Any]) -> Any:
        """Return what a function makes of the state of the points of this rank."""
        return function(self.simulation.state)

    def moved(self, owners: NDArray[np.int32]) -> Part:
        """Return this part after blocks have changed their owners."""
        cells, arrays = self.cells(), self._rows()
        _, blocks = self.simulation._engine.places(arrays["x"], self.plan.edge)
        to = owners[blocks]
        size = self._communicator.size
        packets = [
            {name: a[..., to == rank] for name, a in {"cell": cells, **arrays}.items()}
            for rank in range(size)
        ]
        got = _all_to_all(self._communicator, packets)
        all_rows = {name: np.concatenate([p[name] for p in got], axis=-1) for name in got[0]}
        order = np.argsort(all_rows.pop("cell"), kind="stable")
        new = {name: np.ascontiguousarray(a[..., order]) for name, a in all_rows.items()}
        scalars = self.simulation._engine.scalars()
        if not np.isfinite([value for name, value in scalars.items() if "tally" in name]).all():
            # The account of an energy that overflows begins anew, on all ranks alike.
            scalars |= {name: 0.0 for name in scalars if name.startswith("tally_")}
            scalars["tally_time"] = -1.0
        part = Part(self._communicator, replace(self.plan, owners=owners))
        part.take(new)
        part.begin(scalars, self._besides_points())
        return part


def bare(plan: Plan) -> Simulation:
    """Return a simulation without points."""
    simulation: Simulation = object.__new__(Simulation)
    watches = plan.wall_forces, plan.tractions
    simulation._build(plan.scene, plan.mean_mass, plan.machine, *watches)
    return simulation


def joined(parts: list[dict[str, NDArray]]) -> dict[str, NDArray]:
    """Join the arrays of `SPREAD` of all ranks, in the order that one process has."""
    arrays = {
        name: np.concatenate([p[name] for p in parts], axis=SPREAD[name]) for name in parts[0]
    }
    if "calm" in arrays:
        order = np.argsort(arrays["calm"][0], kind="stable")
        arrays["calm"] = arrays["calm"].take(order, axis=1)
    if "patch_places" in arrays:
        places, numbers = in_order(arrays["patch_places"], arrays["patch_numbers"])
        arrays |= {"patch_places": places, "patch_numbers": numbers}
    return arrays


def _all_to_all(communicator: Communicator, packets: list[Any]) -> list[Any]:
    """Send packet k to rank k, and return what the others send, by their ranks."""
    rank = communicator.rank
    got = list(packets)
    for other in range(communicator.size):  # by the order of all pairs, so that none waits for ever
        if rank < other:
            communicator.send(packets[other], other)
        if rank != other:
            got[other] = communicator.receive(other)
        if rank > other:
            communicator.send(packets[other], other)
    return got


def remoteness(error: BaseException) -> int:
    """Order of errors by what they say about their cause: 0 for one that Python code has raised, 1
    for a step that failed, 2 if that was on another rank, or a rank does not answer."""
    if isinstance(error, LostRankError):
        return 2
    if isinstance(error, _core.SimulationError):
        return 2 if "another process" in str(error) else 1
    return 0
