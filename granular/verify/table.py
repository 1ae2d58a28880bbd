"""Run checks and print the verification table."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from typing import TextIO

from granular.run.diagnostics import StabilityWarning
from granular.tools.checks import one_of
from granular.verify.rows import Check, Row, checks

_WIDTHS = (40, 60, 14, 18)
_WORDS = {True: "pass", False: "FAIL", None: "-"}


def rows_of(check: Check) -> Iterator[Row]:
    """Rows of a check; if it raises, the last row fails and shows the error."""
    try:
        with warnings.catch_warnings():  # the checks run suspect schemes on purpose
            warnings.simplefilter("ignore", StabilityWarning)
            yield from check.run()
    except (ArithmeticError, RuntimeError, ValueError) as error:
        yield Row(f"{type(error).__name__}: {error}", "stopped", "no error", False)


def failures(name: str) -> list[str]:
    """Failed rows of a check, as text; the tests assert that there are none.

    Raises
    ------
    KeyError
        If there is no such check.
    """
    return [
        f"{row.quantity}: {row.measured}, expected {row.expected}"
        for row in rows_of(checks[name])
        if row.passed is False
    ]


def main(slow: bool = False, out: TextIO | None = None, only: Sequence[str] | None = None) -> int:
    """Print the table: check | quantity | measured | expected | pass.

    Parameters
    ----------
    slow : bool
        Run the long checks as well (about an hour on one core).
    out : text stream, optional
        Stream to print to; standard output by default.
    only : sequence of str, optional
        Names of the checks to run, slow ones included; all by default.

    Returns
    -------
    int
        0 if every bound is met, else 1: the exit status of ``granular verify``.

    Raises
    ------
    ValueError
        If a name is not the name of a check.
    """
    out = sys.stdout if out is None else out
    for name in only or ():
        one_of("only", name, tuple(checks))
    chosen = [c for c in checks.values() if (c.name in only if only else slow or not c.slow)]
    begin, counts = time.perf_counter(), {word: 0 for word in _WORDS.values()}

    def line(*cells: str) -> None:
        padded = (f"{c:<{w}}" for c, w in zip(cells, _WIDTHS, strict=False))
        print(" | ".join([*padded, *cells[len(_WIDTHS) :]]).rstrip(), file=out, flush=True)

    line("check", "quantity", "measured", "expected", "pass")
    line(*("-" * width for width in _WIDTHS), "----")
    for check in chosen:
        for row in rows_of(check):
            counts[_WORDS[row.passed]] += 1
            line(check.name, row.quantity, row.measured, row.expected, _WORDS[row.passed])
    seconds = time.perf_counter() - begin
    print(
        f"{counts['pass']} passed, {counts['FAIL']} failed, {counts['-']} reported; "
        f"{len(chosen)} checks in {seconds:.0f} s",
        file=out,
        flush=True,
    )
    return int(counts["FAIL"] > 0)
