"""One run or step of a simulation at a time: not in its own hooks, not in two threads."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

M = TypeVar("M", bound=Callable[..., Any])


class Turns:
    """Whose turn it is to make steps."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._thread = 0
        self._hook: Callable[..., Any] | None = None

    def take(self, what: str) -> threading.Lock:
        """Return the lock that is held while steps are made; RuntimeError if it is held already.

        Use it in a separate `with`: a signal that arrives when a function has taken a lock, but
        not yet returned, would leave it locked for ever.
        """
        if self._lock.locked():
            raise RuntimeError(self._refusal(what))
        return self._lock

    def begin(self) -> None:
        """Note who holds the lock."""
        self._thread, self._hook = threading.get_ident(), None

    def call(self, hook: Callable[..., Any], sim: Any) -> Any:
        """Call a hook of the run whose turn it is, and return what it does."""
        self._hook = hook
        answer = hook(sim)
        self._hook = None
        return answer

    def _refusal(self, what: str) -> str:
        if self._thread != threading.get_ident():
            return f"{what}: the simulation makes steps in another thread; wait until they are made"
        by = "a run of it calls back"
        if self._hook is not None:
            by = f"its run has called the hook {name_of(self._hook)}"
        return (
            f"{what}: the simulation makes steps already, and {by}, which may read it, but not "
            "step or run it. Call it after the run, in a loop of runs to one time after the other; "
            "or step a copy, Simulation.from_checkpoint(sim.scene, sim.checkpoint())"
        )


def name_of(hook: Callable[..., Any]) -> str:
    """Name of a hook for messages."""
    return getattr(hook, "__qualname__", None) or type(hook).__qualname__.lstrip("_")


def alone(method: M) -> M:
    """Let a method of a simulation that makes steps be called only while no other one does."""

    @wraps(method)
    def call(sim: Any, *args: Any, **options: Any) -> Any:
        with sim._turns.take(method.__name__):
            sim._turns.begin()
            return method(sim, *args, **options)

    return cast("M", call)
