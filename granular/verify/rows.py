"""Rows of the verification table, and the registry of the checks that yield them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes
    ----------
    quantity : str
        What was measured.
    measured, expected : str
        The number and its bound, as printed.
    passed : bool or None
        None for a number that is only reported, next to a published one if there is any.
    """

    quantity: str
    measured: str
    expected: str
    passed: bool | None


@dataclass(frozen=True)
class Check:
    """A registered check: a function that yields rows, and a flag that is true if it is slow.

    The function can be called without arguments. Those of `granular.verify.density_correction`
    take a scheme as an optional one.
    """

    name: str
    slow: bool
    run: Callable[..., Iterable[Row]]

    @property
    def doc(self) -> str:
        """First line of the docstring of the function."""
        return (self.run.__doc__ or "").partition("\n")[0]


checks: dict[str, Check] = {}
"""The checks by name, in the order of the table."""


def check(*, slow: bool = False) -> Callable[[Callable], Callable]:
    """Register a function under its name."""

    def register(function: Callable[[], Iterable[Row]]) -> Callable[[], Iterable[Row]]:
        checks[function.__name__] = Check(function.__name__, slow, function)
        return function

    return register


def at_most(quantity: str, value: float, bound: float) -> Row:
    """A row that passes if value <= bound; nan fails."""
    return Row(quantity, f"{value:.4g}", f"<= {bound:.4g}", bool(value <= bound))


def at_least(quantity: str, value: float, bound: float) -> Row:
    """A row that passes if value >= bound; nan fails."""
    return Row(quantity, f"{value:.4g}", f">= {bound:.4g}", bool(value >= bound))


def within(quantity: str, value: float, centre: float, margin: float) -> Row:
    """A row that passes if value differs from `centre` by at most `margin`."""
    passed = bool(abs(value - centre) <= margin)
    return Row(quantity, f"{value:.5g}", f"{centre:.5g} +- {margin:.3g}", passed)


def holds(quantity: str, truth: bool, expected: str = "yes") -> Row:
    """A row for a condition, which passes if `truth` is true."""
    return Row(quantity, "yes" if truth else "no", expected, bool(truth))


def report(quantity: str, value: str, other: str) -> Row:
    """A row that reports a number next to another one, without a bound."""
    return Row(quantity, value, other, None)
