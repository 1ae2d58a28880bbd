"""Directives that list what `granular.papers` has of a document.

`paper-figures NAME` makes the table of its figures and tables, and `paper-equations NAME` that of
its equations.
"""

from __future__ import annotations

import math

from docutils import nodes
from generated_tables import table_of
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class PaperFigures(SphinxDirective):
    """Figures and tables: name, what it shows, state and cost."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        from granular.papers import document

        rows = []
        for one in document(self.arguments[0]).figures.values():
            state = f"{one.state}: {one.reason}" if one.reason else one.state
            cost = "" if math.isnan(one.seconds) else f"{max(one.seconds, 1):.0f} s"
            rows.append((one.name, one.title, state, cost))
        return [table_of(("figure", "what it shows", "state", "one core"), rows)]


class PaperEquations(SphinxDirective):
    """Equations: number, what it states, where it is, and what is otherwise."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        from granular.papers import document

        rows = [
            (
                one.number,
                one.what,
                ", ".join(f"`{place}`" for place in one.places),
                one.otherwise or "the same",
            )
            for one in document(self.arguments[0]).equations
        ]
        return [table_of(("equation", "what it states", "place", "here"), rows)]


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("paper-figures", PaperFigures)
    app.add_directive("paper-equations", PaperEquations)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
