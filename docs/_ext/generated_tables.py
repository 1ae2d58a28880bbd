"""Directives that make tables and help of the reference from the lists in the code.

`scheme-table:: GROUP`, `law-tables::`, `scene-table::` and `command-help:: [WORD ...]`.
"""

from __future__ import annotations

import argparse
import inspect
import re
from collections.abc import Iterable, Sequence
from functools import cache

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

Row = Sequence[str]


def text_nodes(text: str) -> list[nodes.Node]:
    """Text with literals where it has backticks."""
    parts = re.split(r"`+([^`]+)`+", text)
    kinds = (nodes.Text, lambda part: nodes.literal(part, part))
    return [kinds[i % 2](part) for i, part in enumerate(parts) if part]


def table_of(header: Row, rows: Iterable[Row]) -> nodes.table:
    """Table of plain cells; the first column is set as code."""
    group = nodes.tgroup(cols=len(header))
    group += [nodes.colspec(colwidth=1) for _ in header]

    def line(cells: Row, code: bool) -> nodes.row:
        made = nodes.row()
        for i, cell in enumerate(cells):
            inner = [nodes.literal(cell, cell)] if code and i == 0 else text_nodes(cell)
            made += nodes.entry("", nodes.paragraph("", "", *inner))
        return made

    group += nodes.thead("", line(header, code=False))
    group += nodes.tbody("", *[line(row, code=True) for row in rows])
    return nodes.table("", group, classes=["table"])


@cache
def parser_of_command() -> argparse.ArgumentParser:
    """Parser of the command; made before autodoc changes signatures that it is made from."""
    from granular.cli.parser import command_parser

    return command_parser()


def number(value: float | None) -> str:
    return "None" if value is None else f"{value:g}"


class SchemeTable(SphinxDirective):
    """Numbers of a group: name, default, range, unit, description."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        from granular import _core

        rows = [
            (name, number(default), allowed, "" if unit == "1" else unit, text)
            for name, default, allowed, unit, text in _core.scheme_numbers()[self.arguments[0]]
        ]
        return [table_of(("name", "default", "range", "unit", "description"), rows)]


class LawTables(SphinxDirective):
    """Each law that the core has registered, with its parameters."""

    def run(self) -> list[nodes.Node]:
        from granular import _core

        made: list[nodes.Node] = []
        for name, (doc, parameters, in_single) in _core.laws().items():
            section = nodes.section("", nodes.title("", "", nodes.literal(name, name)))
            section["ids"].append(nodes.make_id(f"law-{name}"))
            section += nodes.paragraph("", "", *text_nodes(f"{doc[0].upper()}{doc[1:]}."))
            if in_single:
                section += nodes.paragraph("", "Also in single precision.")
            rows = [(p, "" if unit == "1" else unit, text) for p, unit, text in parameters]
            section += table_of(("parameter", "unit", "description"), rows)
            made.append(section)
        return made


class SceneTable(SphinxDirective):
    """Scene functions with their methods, dimensions aside, and first sentences."""

    def run(self) -> list[nodes.Node]:
        from granular import scenes

        rows = []
        for name, function in scenes.registry.items():
            summary = " ".join((inspect.getdoc(function) or "").partition("\n\n")[0].split())
            methods = ", ".join(method.upper() for method in sorted(function.methods))
            rows.append((f"gr.scenes.{name}", methods, summary))
        return [table_of(("scene", "method", "what it is"), rows)]


class CommandHelp(SphinxDirective):
    """Help of the command, or of one of its subcommands."""

    optional_arguments = 2

    def run(self) -> list[nodes.Node]:
        parser = parser_of_command()
        for word in self.arguments:
            (commands,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
            parser = commands.choices[word]
        parser.formatter_class = lambda prog: argparse.HelpFormatter(prog, width=96)
        text = parser.format_help()
        return [nodes.literal_block(text, text, language="text")]


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("scheme-table", SchemeTable)
    app.add_directive("law-tables", LawTables)
    app.add_directive("scene-table", SceneTable)
    app.add_directive("command-help", CommandHelp)
    parser_of_command()
    return {"parallel_read_safe": True, "parallel_write_safe": True}
