"""Ranks other than 0, which do what rank 0 asks for until it ends."""

from __future__ import annotations

import pickle
import signal
import threading
from typing import Any

from granular.ranks.communicator import Communicator
from granular.ranks.part import Part

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)
"""Signals by which a run is ended: rank 0 takes them for all."""


def serve(communicator: Communicator) -> None:
    """Do what rank 0 asks for: make parts of runs, and call their methods.

    A request is (number of the part, name, arguments); None is the last. The answer is (True,
    result) or (False, error).
    """
    if threading.current_thread() is threading.main_thread():
        for number in ENDING:
            signal.signal(number, signal.SIG_IGN)
    parts: dict[int, Part] = {}
    going = True
    while going:
        try:
            request = communicator.receive(0, patient=True)
            going = request is not None
            answer = True, _do(communicator, parts, *request) if going else None
        except Exception as error:  # also of what cannot be unpickled here
            answer = False, _sendable(error)
        if going:
            communicator.send(answer, 0)


def _do(
    communicator: Communicator, parts: dict[int, Part], number: int, name: str, arguments: tuple
) -> Any:
    if name == "build":
        parts[number] = Part(communicator, *arguments)
        return parts[number].counts()
    if name == "close":
        parts.pop(number, None)
        return None
    if name == "moved":
        parts[number] = parts[number].moved(*arguments)
        return parts[number].counts()
    return getattr(parts[number], name)(*arguments)


def _sendable(error: Exception) -> Exception:
    """Return an error that can be sent to another process."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
