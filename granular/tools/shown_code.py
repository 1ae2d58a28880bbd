"""Source code of others as text that can be read: each line with a mark, without hidden
characters."""

from __future__ import annotations

MARK = "    | "
"""Text before each line of a source, so that the lines of a message itself differ from those."""


def escaped(text: str) -> str:
    """Text in which characters that a terminal interprets, or does not show, are replaced by their
    codes.

    Such are control characters, those that turn the direction of writing, and spaces of no or of
    other widths. Line feeds and tabs stay.
    """
    return "".join(
        c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text
    )


def marked(text: str) -> str:
    """Escaped text with the mark before each line."""
    return "\n".join(MARK + line for line in escaped(text).split("\n"))
