"""Cases of other authors: their data, the comparison of a run with them, and the table."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.resources import files
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np

from granular.run.diagnostics import StabilityWarning
from granular.tools.arrays import Array
from granular.tools.checks import one_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FOLDER = files("granular.verify") / "data"


@dataclass(frozen=True)
class Data:
    """A file of published numbers.

    Attributes
    ----------
    notes : tuple of str
        Its header: source, units, uncertainties.
    columns : mapping of str to ndarray
        The numbers, by the name of the column, which has the unit; nan where there is none.
    """

    notes: tuple[str, ...]
    columns: Mapping[str, Array]

    def __getitem__(self, name: str) -> Array:
        return self.columns[name]


def load(name: str) -> Data:
    """Read a file of `granular/verify/data` by its name without the suffix.

    Raises
    ------
    ValueError
        If there is no such file.
    """
    known = sorted(entry.name[:-4] for entry in FOLDER.iterdir() if entry.name.endswith(".csv"))
    lines = (FOLDER / f"{one_of('name', name, known)}.csv").read_text("utf-8").splitlines()
    notes = tuple(line[1:].strip() for line in lines if line.startswith("#"))
    head, *rows = (line.split(",") for line in lines if not line.startswith("#"))
    numbers = np.array(rows, dtype=float)
    return Data(notes, dict(zip(head, numbers.T, strict=True)))


@dataclass(frozen=True)
class Comparison:
    """A number of this package and of the reference.

    Attributes
    ----------
    quantity : str
        Name and unit.
    ours : float
        Number of the run.
    reference : float or pair of float
        The other number, or the ends of the band in which it lies.
    tolerance : str
        Largest difference allowed, as text; empty if the row is only reported.
    passed : bool or None
        None for a row that is only reported.
    """

    quantity: str
    ours: float
    reference: float | Sequence[float]
    tolerance: str = ""
    passed: bool | None = None


def near(
    quantity: str,
    ours: float,
    reference: float | tuple[float, float],
    share: float,
    gate: bool = True,
) -> Comparison:
    """Row for a relative difference of at most `share`; without `gate` it is only reported.

    If the reference is a band, by its ends, the difference is that from the nearer end, and none
    inside.
    """
    ends = np.atleast_1d(reference)
    low, high = float(ends.min()), float(ends.max())
    passed = bool(low - share * abs(low) <= ours <= high + share * abs(high))
    return Comparison(quantity, ours, reference, f"{share:.0%}", passed if gate else None)


def below(quantity: str, ours: float, bound: float, gate: bool = True) -> Comparison:
    """Row for an error that must not exceed `bound`; without `gate` it is only reported."""
    passed = bool(ours <= bound)
    return Comparison(quantity, ours, 0.0, f"{bound:g}", passed if gate else None)


@dataclass
class Outcome:
    """Result of a case.

    Attributes
    ----------
    rows : list of Comparison
    curves : dict
        Data of the picture, as lists of numbers by name.
    core_seconds : float
        Processor time of the runs [s].
    """

    rows: list[Comparison] = field(default_factory=list)
    curves: dict[str, Any] = field(default_factory=dict)
    core_seconds: float = 0.0

    @contextmanager
    def timed(self) -> Iterator[None]:
        """Add the processor time of the block."""
        begin = time.process_time()
        try:
            yield
        finally:
            self.core_seconds += time.process_time() - begin


@dataclass(frozen=True)
class Case:
    """A registered case: `run(quick)` makes its outcome, `picture(outcome)` a figure of it."""

    name: str
    run: Callable[[bool], Outcome]
    picture: Callable[[Outcome], Figure]

    @property
    def doc(self) -> str:
        """First line of the docstring of the function."""
        return (self.run.__doc__ or "").partition("\n")[0]

    def outcome(self, quick: bool = False) -> Outcome:
        """Run it, without the warnings of suspect schemes, which are run on purpose."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StabilityWarning)
            return self.run(quick)


cases: dict[str, Case] = {}
"""The cases by name, in the order of the table."""


def case(picture: Callable[[Outcome], Figure]) -> Callable[[Callable], Callable]:
    """Register a function `run(quick)` under its name, with the function that draws its outcome."""

    def register(run: Callable[[bool], Outcome]) -> Callable[[bool], Outcome]:
        cases[run.__name__] = Case(run.__name__, run, picture)
        return run

    return register


WORDS = {True: "met", False: "not met", None: "reported"}


def cells_of(row: Comparison) -> list[str]:
    """Texts of a row: quantity, ours, reference, tolerance, verdict."""
    reference = " to ".join(f"{end:.4g}" for end in np.atleast_1d(row.reference))
    return [row.quantity, f"{row.ours:.4g}", reference, row.tolerance, WORDS[row.passed]]


def main(names: Sequence[str] = (), *, quick: bool = False, out: TextIO | None = None) -> int:
    """Run cases and print their rows and costs.

    Parameters
    ----------
    names : sequence of str
        Cases to run; all if empty.
    quick : bool
        Coarse runs of seconds, to check that the case works; their rows are those of coarse cells.
    out : text stream, optional
        Stream to print to; standard output by default.

    Returns
    -------
    int
        0 if every tolerance is met, else 1.

    Raises
    ------
    ValueError
        If a name is not the name of a case.
    """
    out = sys.stdout if out is None else out
    for name in names:
        one_of("case", name, tuple(cases))
    missed = 0
    for name in names or cases:
        outcome = cases[name].outcome(quick)
        print(f"{name}: {cases[name].doc}", file=out)
        for row in outcome.rows:
            quantity, *rest = cells_of(row)
            print(f"  {quantity:<52}" + "".join(f" {text:>14}" for text in rest), file=out)
            missed += row.passed is False
        print(f"  {outcome.core_seconds:.1f} core-seconds", file=out, flush=True)
    return int(missed > 0)
