"""Ranks other than 0, which do what rank 0 asks for until it ends."""

from __future__ import annotations

import pickle
import signal
import threading
from typing import Any

from granular.ranks.communicator import Communicator, LostRankError
from granular.ranks.part import Part

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
"""Signals by which a run is ended: rank 0 takes them for all."""


_THREAD = threading.local()


def is_serving() -> bool:
    """True in a thread, or a process, that serves rank 0."""
    return getattr(_THREAD, "serves", False)


def serve(communicator: Communicator) -> None:
    """Do what rank 0 asks for: make parts of runs, and call their methods.

    A request is (number of the part, name, arguments); None is the last. The answer is (True,
    result) or (False, error).
    """
    if threading.current_thread() is threading.main_thread():
        for number in ENDING:
            signal.signal(number, signal.SIG_IGN)
    _THREAD.serves = True
    parts: dict[int, Part] = {}
    going = True
    while going:
        try:
            request = communicator.receive(0, patient=True)
            going = request is not None
            answer = True, _do(communicator, parts, *request) if going else None
        except BaseException as error:  # also of what cannot be unpickled here, and SystemExit
            answer = False, _sendable(error)
        if going:
            try:
                _answer(communicator, answer)
            except LostRankError:  # rank 0 has ended without waiting for it
                return


def _do(
    communicator: Communicator, parts: dict[int, Part], number: int, name: str, arguments: tuple
) -> Any:
    if name == "build":
        parts[number] = Part(communicator, *arguments)
        return parts[number].isa()
    if name == "close":
        parts.pop(number, None)
        return None
    if name == "moved":
        parts[number] = parts[number].moved(*arguments)
        return parts[number].counts()
    return getattr(parts[number], name)(*arguments)


def _answer(communicator: Communicator, answer: tuple[bool, Any]) -> None:
    """Send an answer, or why it cannot be sent."""
    try:
        communicator.send(answer, 0)
    except LostRankError:
        raise
    except Exception as error:  # it cannot be pickled
        communicator.send((False, _sendable(error)), 0)


def _sendable(error: BaseException) -> Exception:
    """Return an error that can be sent to another process."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error if isinstance(error, Exception) else RuntimeError(repr(error))
