"""Table of results: a JSON file with a head and one row per line, written after every case."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from shared import commit, write

import granular as gr
from accuracy.cases import Case
from granular.record.provenance import cpu_name


def head() -> dict[str, Any]:
    """Machine and build, on which the times in a table depend."""
    build = gr.show_config()
    return {"machine": cpu_name(), "compiler": build["compiler"], "isa": build["isa"]}


class Table:
    """Rows of results, each with its commit, from which a stopped benchmark continues.

    A row that is deleted from the file is run again. Thus the rows of a scheme that has changed can
    be renewed while the others remain.

    Parameters
    ----------
    path : Path
        File, which is read if it exists.
    draw : bool
        True if no row is added, so that the machine does not matter.

    Raises
    ------
    ValueError
        If the file is of another machine or build, whose times cannot be compared.
    """

    def __init__(self, path: Path | None, draw: bool = False) -> None:
        self.path = path
        self.head, self.commit = head(), commit()
        self.rows: list[dict[str, Any]] = []
        if path and path.exists():
            stored = json.loads(path.read_text())
            if stored["head"] != self.head and not draw:
                raise ValueError(
                    f"{path} is of {stored['head']}, this is {self.head}: give another --out"
                )
            self.rows = stored["rows"]

    def holds(self, case: Case) -> bool:
        """True if the case has been run, or left out."""
        key = case.row()
        return any(all(row[name] == key[name] for name in key) for row in self.rows)

    def run(
        self,
        cases: Iterable[Any],
        run: Callable[[Any], Mapping[str, Any]],
        report: Callable[[Mapping[str, Any]], str],
    ) -> list[dict[str, Any]]:
        """Run the cases that the file does not hold yet, and report each; all rows."""
        for case in cases:
            if not self.holds(case):
                self.add(run(case))
                print(report(self.rows[-1]), flush=True)
        return self.rows

    def add(self, row: Mapping[str, Any]) -> None:
        """Append a row and write the file, atomically."""
        self.rows.append(dict(row) | {"commit": self.commit})
        write(self.path, {"head": self.head, "rows": self.rows})
