"""The common part of docstrings, and descriptions of arguments for help and files of scenes."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Mapping
from types import FunctionType, MappingProxyType

RAISES = """
Raises
------
TypeError, ValueError
    Naming argument, value and allowed range"""
"""Last part of many docstrings, which end this sentence; there it is written ``{raises}``."""

_SECTION = re.compile(r"\n\n?(\w[\w ]*)\n---+\n")

_HEAD = re.compile(r"^\**(\w[\w, *]*?)(?: : .*)?$")

_SEE = "See `"

_ENTRY = re.compile(r"^(?=\S)", re.MULTILINE)


def complete(package: str, common: Mapping[str, str] = MappingProxyType({})) -> None:
    """Complete the docstrings of the modules of a package that are imported.

    ``{raises}`` stands for `RAISES`. In functions whose docstring has sections, an argument that
    they do not describe is one of `common`, or has its type alone; and what they return, if there
    is no section for it, has the type of the annotation.

    Parameters
    ----------
    package : str
        Its name.
    common : mapping of str to str
        Type and description of arguments that many functions have, by their names.
    """
    for name, module in list(sys.modules.items()):
        if f"{name}.".startswith(f"{package}."):
            for part in list(vars(module).values()):
                if getattr(part, "__module__", None) == name:
                    _complete(part, common)


def _complete(part: object, common: Mapping[str, str]) -> None:
    """Complete the docstring of a function, or of a class and its methods."""
    part = getattr(part, "__func__", part)
    if isinstance(part, type):
        for member in vars(part).values():
            _complete(member, common)
    if not isinstance(part, FunctionType | type | property) or not part.__doc__:
        return
    of_function = isinstance(part, FunctionType) and "---" in part.__doc__
    if not of_function and "{raises}" not in part.__doc__:
        return  # most of them: what is not changed costs no time of the import
    doc = inspect.cleandoc(part.__doc__).replace("\n{raises}", f"\n{RAISES}")
    if isinstance(part, FunctionType) and of_function:
        summary, *rest = _SECTION.split(doc)
        sections = dict(zip(rest[::2], rest[1::2], strict=True))
        annotations = _annotations(part)
        result = _in_words(annotations.pop("return", inspect.Signature.empty))
        first = {"Parameters": _arguments(sections.pop("Parameters", ""), annotations, common)}
        if not sections.keys() & {"Returns", "Yields"} and result != "None":
            first["Returns"] = result
        texts = ((name, text) for name, text in (first | sections).items() if text)
        doc = summary + "".join(f"\n\n{name}\n{'-' * len(name)}\n{text}" for name, text in texts)
    part.__doc__ = doc


def _annotations(function: FunctionType) -> dict[str, object]:
    """Annotations of the arguments in their order, and of what is returned, as "return"."""
    if hasattr(function, "__wrapped__") or hasattr(function, "__signature__"):
        signature = inspect.signature(function)
        annotated = {name: given.annotation for name, given in signature.parameters.items()}
        return annotated | {"return": signature.return_annotation}
    # as inspect.signature, which takes ten times as long
    code = function.__code__
    names, n = list(code.co_varnames), code.co_argcount
    after = n + code.co_kwonlyargcount
    arbitrary = [names[after]] if code.co_flags & inspect.CO_VARARGS else []
    last = after + len(arbitrary)
    keywords = names[last : last + bool(code.co_flags & inspect.CO_VARKEYWORDS)]
    ordered = (*names[:n], *arbitrary, *names[n:after], *keywords, "return")
    given = function.__annotations__
    return {name: given.get(name, inspect.Signature.empty) for name in ordered}


def _arguments(text: str, annotations: Mapping[str, object], common: Mapping[str, str]) -> str:
    """Section of the arguments of a function, with those that it does not describe."""
    entries = [entry.rstrip() for entry in _ENTRY.split(text) if entry.strip()]
    heads = [entry.partition("\n")[0].partition(" :")[0] for entry in entries]
    known = [head.replace("*", "").split(", ") for head in heads]
    place = 0
    for name, annotation in annotations.items():
        index = next((i for i, names in enumerate(known) if name in names), None)
        if index is not None:
            place = index + 1
        elif name not in ("self", "cls") and not name.startswith("_"):
            kind = common.get(name) or _in_words(annotation)
            entries.insert(place, f"{name} : {kind}")
            known.insert(place, [name])
            place += 1
    return "\n".join(entries)


def _in_words(annotation: object) -> str:
    """Annotation as it is written."""
    if isinstance(annotation, str):
        return annotation
    return getattr(annotation, "__name__", "") or inspect.formatannotation(annotation)


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
