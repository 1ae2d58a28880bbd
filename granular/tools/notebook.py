"""Notebooks: whether one runs, and the HTML that represents objects in it."""

from __future__ import annotations

import base64
import html
import io
import sys
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


pictures: dict[str, Callable[[Any], Figure]] = {}
"""Functions that draw an object for a notebook, by its kind. `granular` registers them, because
`granular.plot` imports the modules of scenes and not the other way round."""


def in_notebook() -> bool:
    """True if the code runs in a kernel of Jupyter, which shows objects below the code."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython else None
    return getattr(shell, "kernel", None) is not None


def embedded(content: bytes, kind: str) -> str:
    """URL that holds the content of a file of a MIME type."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def image(figure: Figure) -> str:
    """HTML of a picture that is part of the page."""
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=80)
    return f"<img alt='picture' src='{embedded(content.getvalue(), 'image/png')}'>"


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
