"""HTML tables that represent objects in a notebook."""

from __future__ import annotations

import html
from collections.abc import Mapping

__all__ = ["table"]


def table(title: str, rows: Mapping[str, object]) -> str:
    """HTML table of names and values; text is escaped, floats are given to six digits."""

    def show(value: object) -> str:
        return html.escape(f"{value:.6g}" if isinstance(value, float) else str(value))

    body = "".join(
        f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
        f"<td style='text-align:left'>{show(value)}</td></tr>"
        for name, value in rows.items()
    )
    return f"<table><caption>{html.escape(title)}</caption>{body}</table>"
