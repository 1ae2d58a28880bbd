"""Signals that wait while a simulation is at work.

Python runs the handler of a signal in the main thread between any two instructions: within a
function that the core or HDF5 has called, through which no exception can pass, and between
assignments that belong together, too. An exception of the handler, such as Ctrl-C, an alarm or a
time limit, would be lost there, or leave an incomplete step or record.
"""

from __future__ import annotations

import threading

# Those of `signal` make enumerations, which takes 20 times as long, more than a small step does.
from _signal import getsignal, signal  # type: ignore[import-not-found]
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from signal import SIG_DFL, Signals, raise_signal, valid_signals
from types import FrameType
from typing import Any, Self

NUMBERS = tuple(sorted(int(number) for number in valid_signals()))


ENDING = [int(Signals[name]) for name in ("SIGTERM", "SIGUSR1") if name in Signals.__members__]
"""Signals by which batch systems end a job, with a warning of some time."""


@contextmanager
def ending_as_ctrl_c() -> Iterator[None]:
    """Let signals of batch systems raise KeyboardInterrupt in a block, as Ctrl-C does.

    Those for which the program has set a handler, or which it ignores, are left to it; so are all
    in other threads than the main one.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, _: FrameType | None) -> None:
        raise KeyboardInterrupt(Signals(number).name)

    replaced = [number for number in ENDING if getsignal(number) == int(SIG_DFL)]
    try:
        for number in replaced:
            signal(number, end)
        yield
    finally:
        for number in replaced:
            if getsignal(number) is end:
                signal(number, int(SIG_DFL))


class DeferredSignals:
    """A block in which Python handlers of signals do not run.

    Signals are noted, and their handlers called when the block ends, or before by `deliver`. As by
    the system, a signal is noted once until it is delivered. Exceptions of a handler leave the
    block or `deliver`. Blocks may be nested. In other threads than the main one, which run no
    handlers, nothing is done.
    """

    def __init__(self) -> None:
        self._is_main = threading.current_thread() is threading.main_thread()
        self._holds = False
        self._handlers: dict[int, Callable[[int, FrameType | None], Any]] = {}
        self._noted: dict[int, FrameType | None] = {}

    def __enter__(self) -> Self:
        self._hold()
        return self

    def __exit__(self, *_: object) -> None:
        try:
            self._release()
        finally:
            self._call()

    def deliver(self) -> None:
        """Call the handlers of the signals so far."""
        if self._noted:
            with self.released():
                self._call()

    @contextmanager
    def released(self) -> Iterator[None]:
        """Let handlers run within a part of the block; signals from before go on waiting."""
        self._release()
        try:
            yield
        finally:
            self._hold()

    def _hold(self) -> None:
        if not self._is_main:
            return
        self._holds = True
        try:
            for number in NUMBERS:
                handler = getsignal(number)
                if callable(handler):
                    self._handlers[number] = handler
                    signal(number, self._note)
        except BaseException:  # of a handler that was not replaced yet
            self._release()
            raise

    def _release(self) -> None:
        self._holds = False
        try:
            for number, handler in tuple(self._handlers.items()):
                if getsignal(number) == self._note:
                    signal(number, handler)
                del self._handlers[number]
        except BaseException:  # of a handler that is back: the others have to follow
            self._release()
            raise

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._holds:
            self._noted.setdefault(number, frame)
        else:  # on the way back
            self._handlers[number](number, frame)

    def _call(self) -> None:
        """Call the handlers that are there now for the signals noted, all of them."""
        if not self._noted:
            return
        number = next(iter(self._noted))
        frame = self._noted.pop(number)
        try:
            handler = getsignal(number)
            if callable(handler):
                handler(number, frame)
            else:  # another handler has removed it
                raise_signal(number)
        finally:
            self._call()
