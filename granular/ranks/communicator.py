"""Messages between the processes of a run: by MPI, or between threads of one process."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from granular import _core
from granular.tools.arrays import IntArray
from granular.tools.checks import positive

TIMEOUT = 60.0
"""Default time after which a process counts as lost that does not answer within a step [s]."""
LONGEST = 1e6
"""Longest time-out [s]."""
PAUSED = 1.0
"""Most of the time from one check to the next that counts as waiting [s]: a process that was
suspended itself must not take the others for lost."""


def check_timeout(timeout: float) -> float:
    """Return a time-out [s]; ValueError unless it is above 0, and not above 1e6."""
    if positive("timeout", timeout) > LONGEST:
        raise ValueError(f"timeout = {timeout:g} must be <= {LONGEST:g}")
    return timeout


Message = tuple[int, memoryview, memoryview]
"""Rank, what is sent to it, and the space for what comes from it."""


class LostRankError(_core.SimulationError):
    """A process of the run does not answer, so that the run cannot go on.

    Resume its record, of which the last checkpoint is intact.
    """


@runtime_checkable
class Communicator(Protocol):
    """Ranks that share a run; all call the same methods in the same order.

    Attributes
    ----------
    rank, size : int
        Number of this process, from 0, and how many there are.
    on_this_machine : int
        How many of them are on this machine.
    timeout : float
        Time after which a rank counts as lost that does not answer [s].
    """

    rank: int
    size: int
    on_this_machine: int
    timeout: float

    def send(self, value: Any, to: int) -> None:
        """Send an object, which is pickled."""

    def receive(self, source: int, patient: bool = False) -> Any:
        """Receive an object; `LostRankError` after the time-out, unless `patient`."""

    def exchange(self, messages: Sequence[Message]) -> None:
        """Send and receive messages of known sizes; those of size 0 are left out."""

    def reduce(self, array: np.ndarray, of: np.ufunc) -> None:
        """Replace an array by the sum, or the maximum, over all ranks."""

    def abort(self) -> None:
        """End all processes at once: some do not answer."""


class MpiCommunicator:
    """Ranks of a communicator of mpi4py, of which this makes a copy: all ranks have to.

    Parameters
    ----------
    comm : mpi4py.MPI.Comm
        The communicator. The same one gives the same object again, with the new time-out.
    timeout : float
        Time after which a rank counts as lost that does not answer [s], > 0.
    """

    def __new__(cls, comm: Any, timeout: float = TIMEOUT) -> MpiCommunicator:
        if not all(hasattr(comm, name) for name in ("Dup", "py2f", "rank", "size")):
            raise TypeError(
                f"comm = {comm!r} must be a communicator of mpi4py, as MPI.COMM_WORLD, or one of "
                "granular.ranks.threads"
            )
        handle = int(comm.py2f())
        if handle not in _MADE:
            _MADE[handle] = super().__new__(cls)
        return _MADE[handle]

    def __init__(self, comm: Any, timeout: float = TIMEOUT) -> None:
        self.timeout = check_timeout(timeout)
        if hasattr(self, "_comm"):
            return
        from mpi4py import MPI

        self._mpi, self._comm = MPI, comm.Dup()
        self.rank, self.size = int(comm.rank), int(comm.size)
        self.on_this_machine = int(self._comm.Split_type(MPI.COMM_TYPE_SHARED).size)
        self._arrays: list[np.ndarray] = []  # of sums that are not complete

    def _wait(self, done: Callable[[], bool], source: int | None, patient: bool = False) -> None:
        """Wait for something; after a while other processes of this machine get their turn."""
        last, waited, turns, pause = time.monotonic(), 0.0, 0, 0.0
        while not done():
            turns += 1
            if turns % 100:
                continue
            time.sleep(pause)
            now = time.monotonic()
            waited, last = waited + min(now - last, PAUSED), now
            # What takes long is not held up by a pause of a tenth of the time so far.
            pause = min(0.1 * waited, 1e-3) if waited > 1e-3 else 0.0
            if waited > self.timeout and not patient:
                who = "another rank" if source is None else f"rank {source}"
                raise LostRankError(f"{who} of the run has not answered for {self.timeout:g} s")

    def send(self, value: Any, to: int) -> None:
        self._comm.send(value, dest=to, tag=1)

    def receive(self, source: int, patient: bool = False) -> Any:
        self._wait(lambda: self._comm.Iprobe(source=source, tag=1), source, patient)
        return self._comm.recv(source=source, tag=1)

    def exchange(self, messages: Sequence[Message]) -> None:
        byte = self._mpi.BYTE
        requests = [
            self._comm.Irecv([into, byte], source=rank, tag=2)
            for rank, _, into in messages
            if len(into)
        ]
        requests += [
            self._comm.Isend([out, byte], dest=rank, tag=2) for rank, out, _ in messages if len(out)
        ]
        testall = self._mpi.Request.Testall
        self._wait(lambda: testall(requests), None)

    def reduce(self, array: np.ndarray, of: np.ufunc) -> None:
        operation = self._mpi.SUM if of is np.add else self._mpi.MAX
        self._arrays = [array.copy(), np.empty_like(array)]  # which outlive a call that gives up
        request = self._comm.Iallreduce(*self._arrays, op=operation)
        self._wait(request.Test, None)
        array[...] = self._arrays[1]

    def abort(self) -> None:
        self._comm.Abort(1)


class Link:
    """Functions by which the core reaches the other ranks; they return whether they have succeeded.

    Attributes
    ----------
    error : BaseException or None
        Why it has not.
    """

    def __init__(self, communicator: Communicator) -> None:
        self._communicator = communicator
        self.error: BaseException | None = None

    def _try(self, call: Callable[[], None]) -> bool:
        try:
            call()
        except BaseException as error:  # the core passes on only that it has failed
            self.error = error
            return False
        return True

    def exchange(self, messages: Sequence[Message]) -> bool:
        return self._try(lambda: self._communicator.exchange(messages))

    def sum(self, view: memoryview) -> bool:
        numbers: IntArray = np.frombuffer(view, dtype=np.int64)
        return self._try(lambda: self._communicator.reduce(numbers, np.add))

    def largest(self, view: memoryview) -> bool:
        numbers = np.frombuffer(view, dtype=np.float64)
        return self._try(lambda: self._communicator.reduce(numbers, np.maximum))


_MADE: dict[int, MpiCommunicator] = {}
"""Communicators by the handles of those of mpi4py that they are copies of."""


def communicator(comm: Any) -> Communicator:
    """Return the communicator for an argument `comm`, of mpi4py or of `threads`.

    Raises
    ------
    TypeError
        If it is neither.
    """
    if isinstance(comm, Communicator):
        return comm
    made = _MADE.get(int(comm.py2f())) if hasattr(comm, "py2f") else None
    return made or MpiCommunicator(comm)
