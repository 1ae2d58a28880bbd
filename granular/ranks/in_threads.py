"""Ranks that are threads of one process, to try what ranks do without MPI."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from granular.ranks.communicator import (
    TIMEOUT,
    Communicator,
    LostRankError,
    Message,
    check_timeout,
)
from granular.ranks.worker import serve
from granular.tools.checks import integer


class Hub:
    """Mailboxes of threads that are ranks, and where they meet."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.boxes = {
            (a, b, tag): queue.SimpleQueue[Any]()
            for a in range(size)
            for b in range(size)
            for tag in (1, 2)
        }
        self.barrier = threading.Barrier(size)
        self.ended = False
        self.arrays: list[np.ndarray] = [np.empty(0)] * size


class ThreadCommunicator:
    """A rank that is a thread of this process."""

    def __init__(self, hub: Hub, rank: int, timeout: float) -> None:
        self._hub, self.rank, self.size = hub, rank, hub.size
        self.on_this_machine = hub.size
        self.timeout = timeout

    def _check(self) -> None:
        if self._hub.ended:
            raise LostRankError("the block of granular.ranks.threads has ended, and its ranks")

    def _take(self, source: int, tag: int, patient: bool = False) -> Any:
        self._check()
        try:
            timeout = None if patient else self.timeout
            return self._hub.boxes[source, self.rank, tag].get(timeout=timeout)
        except queue.Empty:
            raise LostRankError(
                f"rank {source} of the run has not answered for {self.timeout:g} s"
            ) from None

    def send(self, value: Any, to: int) -> None:
        self._check()
        self._hub.boxes[self.rank, to, 1].put(value)

    def receive(self, source: int, patient: bool = False) -> Any:
        return self._take(source, 1, patient)

    def exchange(self, messages: Sequence[Message]) -> None:
        for rank, out, _ in messages:
            if len(out):
                self._hub.boxes[self.rank, rank, 2].put(bytes(out))
        for rank, _, into in messages:
            if len(into):
                into[:] = self._take(rank, 2)

    def reduce(self, array: np.ndarray, of: np.ufunc) -> None:
        self._hub.arrays[self.rank] = array.copy()
        self._meet()
        total = of.reduce(np.array(self._hub.arrays), axis=0)
        self._meet()
        array[...] = total

    def _meet(self) -> None:
        try:
            self._hub.barrier.wait(self.timeout)
        except threading.BrokenBarrierError:
            raise LostRankError(
                f"another rank of the run has not answered for {self.timeout:g} s"
            ) from None

    def abort(self) -> None:
        self._hub.barrier.abort()


@contextmanager
def threads(size: int, timeout: float = TIMEOUT) -> Iterator[Communicator]:
    """Ranks that are threads of this process, to try what ranks do without MPI.

    Parameters
    ----------
    size : int
        Number of ranks, at least 1.
    timeout : float
        Time after which a rank counts as lost that does not answer [s], > 0.

    Yields
    ------
    Communicator
        That of rank 0, for ``gr.Simulation(scene, comm=...)``. The other ranks work until the end
        of the block.
    """
    hub = Hub(integer("size", size, 1, 1000))
    check_timeout(timeout)
    others = [
        threading.Thread(target=serve, args=(ThreadCommunicator(hub, rank, timeout),), daemon=True)
        for rank in range(1, size)
    ]
    for thread in others:
        thread.start()
    root = ThreadCommunicator(hub, 0, timeout)
    try:
        yield root
    finally:
        for rank in range(1, size):
            root.send(None, rank)
        for thread in others:
            thread.join(timeout)
        hub.ended = True
