"""Directive that makes a table of a report from the results of a benchmark.

`{result-table} RESULT [TABLE]` reads `benchmarks/results/RESULT.json` and renders the table of this
name among those that `tables(results)` of the script gives. The script is the file of the
benchmarks with the name of the result; what follows a hyphen in it names a variant, as in
`speed-avx2`. Without a name it renders the only table of the script. Below stands where, when and
by what command the results were measured.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def script_of(result: str) -> ModuleType:
    """Script that has written a result."""
    if str(BENCHMARKS) not in sys.path:
        sys.path.insert(0, str(BENCHMARKS))
    from shared import module

    return module(result.partition("-")[0])


def line_of(stamp: dict[str, Any]) -> str:
    """Markdown of when, where and how a result was measured."""
    isa = "".join(f", {isa}" for isa in [stamp.get("build", {}).get("isa")] if isa)
    where = f"processor {stamp['processor']}{isa}"
    return f"Result of {stamp['date']}, commit {stamp['commit']}, {where}: `{stamp['command']}`"


class ResultTable(SphinxDirective):
    """Table of a benchmark and its stamp."""

    required_arguments = 1
    optional_arguments = 1
    final_argument_whitespace = True

    def run(self) -> list[nodes.Node]:
        result, *rest = self.arguments
        name = rest[0] if rest else None
        path = BENCHMARKS / "results" / f"{result}.json"
        if not path.is_file():
            raise self.error(f"there is no result benchmarks/results/{path.name}")
        results: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        script = script_of(result)
        tables = script.tables(results)
        if name is None and len(tables) == 1:
            (name,) = tables
        if name not in tables:
            raise self.error(f"{result} has the tables {', '.join(tables)}, not {name}")
        self.env.note_dependency(str(path))
        self.env.note_dependency(str(script.__file__))
        stamp = results.get("stamps", {}).get(name, results["stamp"])
        made = nodes.container(classes=["result-table"])
        for lines, kind in ((tables[name], "table"), ([line_of(stamp)], "stamp")):
            part = nodes.container(classes=[f"result-{kind}"])
            self.state.nested_parse(StringList(list(lines), str(path)), self.content_offset, part)
            made += part.children if kind == "table" else part
        return [made]


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("result-table", ResultTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
