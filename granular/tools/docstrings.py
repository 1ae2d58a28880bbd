"""The common part of docstrings, and descriptions of arguments for help and files of scenes."""

from __future__ import annotations

import inspect
import re
import sys
from types import FunctionType

RAISES = """
Raises
------
TypeError, ValueError
    Naming argument, value and allowed range"""
"""Last part of many docstrings, which end this sentence; there it is written ``{raises}``."""

_HEAD = re.compile(r"^\**(\w[\w, *]*?)(?: : .*)?$")

_SEE = "See `"


def complete(package: str) -> None:
    """Put `RAISES` into the docstrings of the modules of a package that are imported."""
    for name, module in list(sys.modules.items()):
        if f"{name}.".startswith(f"{package}."):
            for part in list(vars(module).values()):
                if getattr(part, "__module__", None) == name:
                    _complete(part)


def _complete(part: object) -> None:
    """Complete the docstring of a function, or of a class and its methods."""
    part = getattr(part, "__func__", part)
    if isinstance(part, type):
        for member in vars(part).values():
            _complete(member)
    doc = part.__doc__
    if isinstance(part, FunctionType | type | property) and doc and "{raises}" in doc:
        part.__doc__ = re.sub(
            r"\n( *)\{raises\}", lambda m: "\n" + RAISES.replace("\n", f"\n{m[1]}"), doc
        )


def described(documented: object, *others: object) -> dict[str, str]:
    """Descriptions of the arguments of a function or class, each in one line.

    The arguments of the classes that a class is derived from are included.

    Parameters
    ----------
    documented : function or class
        Its docstring has a section "Parameters" in the style of NumPy.
    *others : function or class
        Where descriptions are looked up that the docstring replaces by a reference.
    """
    descriptions: dict[str, str] = {}
    for part in reversed(getattr(documented, "__mro__", (documented,))):
        for name, text in _parameters(inspect.cleandoc(part.__doc__ or "")).items():
            if name not in descriptions or not text.startswith(_SEE):
                descriptions[name] = text
    elsewhere: dict[str, str] = {}
    for other in others:
        elsewhere |= {name: text for name, text in described(other).items() if text}
    return {
        name: elsewhere.get(name, "") if text.startswith(_SEE) else text
        for name, text in descriptions.items()
    }


def _parameters(doc: str) -> dict[str, str]:
    """Names and descriptions of the section "Parameters" of a docstring."""
    _, _, section = doc.partition("Parameters\n----------\n")
    descriptions: dict[str, str] = {}
    names: list[str] = []
    lines: list[str] = []
    # A line that is underlined begins the next section.
    for line in [*re.split(r"\n\n?\w+\n---+", section)[0].splitlines(), "end"]:
        head = _HEAD.match(line)
        if head is None:
            lines.append(line.strip())
            continue
        text = " ".join(filter(None, lines))
        descriptions |= dict.fromkeys(names, text)
        names, lines = head[1].replace("*", "").split(", "), []
    return descriptions
