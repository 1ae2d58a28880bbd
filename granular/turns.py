"""One run or step of a simulation at a time: not in its own hooks, not in two threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, TypeVar, cast

__all__ = ["Turns", "alone"]

M = TypeVar("M", bound=Callable[..., Any])


class Turns:
    """Whose turn it is to make steps."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._thread = 0
        self._hook: Callable[..., Any] | None = None

    @contextmanager
    def taken(self, what: str) -> Iterator[None]:
        """Make steps in the body; RuntimeError if something else makes them."""
        if not self._lock.acquire(blocking=False):
            raise RuntimeError(self._refusal(what))
        self._thread = threading.get_ident()
        try:
            yield
        finally:
            self._hook = None
            self._lock.release()

    def call(self, hook: Callable[..., Any], sim: Any) -> None:
        """Call a hook of the run whose turn it is."""
        self._hook = hook
        hook(sim)
        self._hook = None

    def _refusal(self, what: str) -> str:
        if self._thread != threading.get_ident():
            return f"{what}: the simulation makes steps in another thread; wait until they are made"
        by = "a run of it calls back"
        if self._hook is not None:
            name = getattr(self._hook, "__qualname__", type(self._hook).__qualname__)
            by = f"its run has called the hook {name}"
        return (
            f"{what}: the simulation makes steps already, and {by}, which may look at it, but not "
            "step or run it. Call it after the run, in a loop of runs to one time after the other; "
            "or step a copy, Simulation.from_checkpoint(sim.scene, sim.checkpoint())"
        )


def alone(method: M) -> M:
    """Let a method of a simulation, which makes steps, be called only when nothing else does."""

    @wraps(method)
    def call(sim: Any, *args: Any, **options: Any) -> Any:
        with sim._turns.taken(method.__name__):
            return method(sim, *args, **options)

    return cast("M", call)
