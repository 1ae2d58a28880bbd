"""A document with its figures, tables and equations, and what drawing one of them results in."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from granular.tools.checks import one_of

if TYPE_CHECKING:
    from granular.papers.runs import Runs
    from granular.plot.canvas import Picture

State = Literal["drawn", "diagram", "not reproducible"]
Number = float | str
"""A number of a figure; a string says what a number would not, such as "below 20.9"."""


def labelled(tables: Mapping[str, Mapping[str, Number]]) -> dict[str, Number]:
    """Numbers of several tables in one, with the label of the table after each name."""
    return {f"{name}, {label}": n for label, table in tables.items() for name, n in table.items()}


@dataclass(frozen=True)
class Drawn:
    """Result of drawing a figure.

    Attributes
    ----------
    pictures : mapping of str to Picture
        Pictures by their name, which is "" for the figure itself.
    numbers : mapping of str to float or str
        Numbers and verdicts that the figure shows, by their name with unit.
    runs : mapping of str to str
        Verdict on each run, by its name: "ok", or the indicators that are suspect.
    """

    pictures: Mapping[str, Picture]
    numbers: Mapping[str, Number] = field(default_factory=dict)
    runs: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Figure:
    """A figure or table of a document.

    Attributes
    ----------
    name : str
        Number of a figure ("5", "4a"), or that of a table ("table_3").
    title : str
        What it shows.
    state : {"drawn", "diagram", "not reproducible"}
        Whether it is drawn from a computation, is a diagram or photograph without data, or cannot
        be reproduced.
    reason : str
        Why it is not drawn.
    seconds : float
        Processor time of drawing it [s]; nan if it is not drawn.
    paper : mapping of str to float or str
        What the document states, by the names of the numbers in `Drawn`.
    E, quick_E : float or None
        Young's modulus of the runs [Pa] by default, and in coarse ones; None for that of the
        scenes, which cannot be changed.
    schemes : tuple of str
        Names of the schemes that it can be drawn with, the default one first; () for no choice.
    """

    name: str
    title: str
    state: State = "drawn"
    reason: str = ""
    seconds: float = math.nan
    paper: Mapping[str, Number] = field(default_factory=dict)
    E: float | None = None
    quick_E: float | None = None
    schemes: tuple[str, ...] = ()
    function: Callable[[Runs], Drawn] | None = None


@dataclass(frozen=True)
class Equation:
    """An equation of a document, and where the package has it.

    Attributes
    ----------
    number : str
        Number in the document.
    what : str
        What it states.
    places : tuple of str
        Where it is: files of the repository, with the name of a function, constant or parameter
        after a colon ("csrc/law/frictional.h:gr_frictional").
    otherwise : str
        How the package differs from it and why; "" if it is the same.
    """

    number: str
    what: str
    places: tuple[str, ...]
    otherwise: str = ""


class Document:
    """One of the documents.

    Parameters
    ----------
    name, citation : str
        Name in the command, and how to cite it.
    E : float or None
        Young's modulus of the document [Pa].

    Attributes
    ----------
    figures : dict of str to Figure
        By name, in the order of the document.
    equations : list of Equation
    """

    def __init__(self, name: str, citation: str, *, E: float | None = None) -> None:
        self.name, self.citation, self.E = name, citation, E
        self.figures: dict[str, Figure] = {}
        self.equations: list[Equation] = []

    def figure(
        self,
        name: str,
        title: str,
        *,
        seconds: float,
        paper: Mapping[str, Number] | None = None,
        E: float | None = None,
        quick_E: float | None = None,
        schemes: Iterable[str] = (),
    ) -> Callable[[Callable[[Runs], Drawn]], Callable[[Runs], Drawn]]:
        """Register the decorated function as the one that draws a figure."""

        def register(function: Callable[[Runs], Drawn]) -> Callable[[Runs], Drawn]:
            known = Figure(
                name, title, seconds=seconds, paper=paper or {}, E=E, quick_E=quick_E or E,
                schemes=tuple(schemes), function=function,
            )  # fmt: skip
            self._add(known)
            return function

        return register

    def without(self, name: str, title: str, state: State, reason: str = "") -> None:
        """Register a figure that is not drawn."""
        one_of("state", state, ("diagram", "not reproducible"))
        self._add(Figure(name, title, state, reason))

    def _add(self, figure: Figure) -> None:
        if figure.name in self.figures:
            raise ValueError(f"{self.name} has two figures {figure.name!r}")
        self.figures[figure.name] = figure

    def order(self, *names: str) -> None:
        """Order the figures as in the document."""
        if set(names) != self.figures.keys():
            raise ValueError(f"{sorted(set(names) ^ self.figures.keys())} are not in both")
        self.figures = {name: self.figures[name] for name in names}
