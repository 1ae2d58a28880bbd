"""The ranks of a run as rank 0 sees them: requests, answers, and how they end."""

from __future__ import annotations

import atexit
import itertools
import threading
from collections.abc import Callable, Sequence
from typing import Any

from granular.ranks.communicator import (
    Communicator,
    LostRankError,
    MpiCommunicator,
    communicator,
)
from granular.ranks.part import remoteness
from granular.ranks.worker import is_serving, serve
from granular.run.interrupts import DeferredSignals


class Team:
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

    def ask(
        self, number: int, name: str, arguments: Sequence[tuple], call: Callable[[], Any]
    ) -> list:
        """Ask each rank with arguments of its own, rank 0 by a function; return their answers.

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
        self, number: int, name: str, arguments: Sequence[tuple], call: Callable[[], Any]
    ) -> list:
        if self.lost:
            raise LostRankError("a rank of the run does not answer; start the run again")
        ranks = self.ranks
        answers: list[Any] = [None] * ranks.size
        errors: list[BaseException] = []
        while self.closing:
            self._tell(self.closing.pop(), "close")
        for rank in range(1, ranks.size):
            ranks.send((number, name, arguments[rank]), rank)
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


_TEAMS: dict[int, Team] = {}
"""Teams by the identity of their communicators."""


def team_of(ranks: Communicator) -> Team:
    team = _TEAMS.get(id(ranks))
    if team is None or team.ranks is not ranks:
        team = _TEAMS[id(ranks)] = Team(ranks)
        if isinstance(ranks, MpiCommunicator):  # threads end with their block
            atexit.register(team.end)
    return team


def attend(comm: Any) -> Communicator:
    """Return the communicator of rank 0; any other rank serves it, and exits when it ends."""
    ranks = communicator(comm)
    if ranks.rank:
        serve(ranks)
        raise SystemExit(0)
    team_of(ranks)  # which lets the others end, however this process ends
    return ranks
