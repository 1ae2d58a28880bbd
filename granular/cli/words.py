"""Words of the command: keywords of scenes and their materials, and values from text."""

from __future__ import annotations

import argparse
import inspect
import math
import re
from collections.abc import Callable
from dataclasses import fields
from typing import Any, get_type_hints

BY_SCENE, UNSET = "chosen by the scene", "none"
"""Default of a keyword of a scene and of its material that is None."""

OWN_OPTIONS = ("material", "scheme", "numerics")
"""Arguments of scene functions that have separate options."""
ARRAYS = ("release",)
"""Arguments of scene functions that are arrays, which only Python can give."""

Keyword = tuple[str, Callable[[str], Any], Any]
"""Name, converter from text, and default of a keyword."""


def number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if math.isnan(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number")
    return value


def duration(text: str) -> float:
    """Seconds of a time such as 3h50m, 45m or 600s."""
    parts = re.fullmatch(r"(?:(\d+)h)?(?:(\d+)m)?(?:(\d+)s?)?", text)
    hours, minutes, rest = (int(part or 0) for part in parts.groups()) if parts else (0, 0, 0)
    seconds = 3600 * hours + 60 * minutes + rest
    if not seconds:
        raise argparse.ArgumentTypeError(f"{text!r} is not a time above 0, such as 3h50m or 600s")
    return float(seconds)


def whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def numbers(text: str) -> tuple[float, ...]:
    return tuple(number(part) for part in text.split(","))


def names(text: str) -> tuple[str, ...]:
    return tuple(text.split(","))


def truth(text: str) -> bool:
    try:
        return {"yes": True, "no": False}[text]
    except KeyError:
        raise argparse.ArgumentTypeError(f"{text!r} is not yes or no") from None


METAVARS = {number: "X", whole: "N", numbers: "X,Y", str: "NAME", truth: "yes|no"}
"""Placeholders of values in the help, by converter."""


def converter(hint: Any) -> Callable[[str], Any]:
    """Converter from text to a type, or to the first of several alternatives."""
    kinds: dict[str, Callable[[str], Any]] = {
        "float": number,
        "int": whole,
        "str": str,
        "tuple": numbers,
        "bool": truth,
    }
    options = [option for option in getattr(hint, "__args__", ()) if option is not type(None)]
    # tuple[float, float] has arguments too, which are not alternatives.
    if getattr(hint, "__origin__", None) is tuple or not options:
        options = [hint]
    return kinds[options[0].__name__]


def keywords_of(function: Callable[..., Any]) -> list[Keyword]:
    """Keywords of a scene function, from its signature."""
    from granular.scenes._registry import keyword_defaults

    hints = get_type_hints(function)
    return [
        (name, converter(hints[name]), default)
        for name, default in keyword_defaults(inspect.signature(function)).items()
        if name not in (*OWN_OPTIONS, *ARRAYS)
    ]


def material_keywords(function: Callable[..., Any]) -> list[Keyword]:
    """Numbers of the default material of a scene function, except its own keywords."""
    parameters = inspect.signature(function).parameters
    material = parameters["material"].default
    hints = get_type_hints(type(material))
    return [
        (field.name, converter(hints[field.name]), getattr(material, field.name))
        for field in fields(material)
        if field.name not in parameters
    ]


def summary(function: Callable[..., Any]) -> str:
    """First paragraph of the docstring in one line."""
    return " ".join((inspect.getdoc(function) or "").partition("\n\n")[0].split())


def default_text(value: Any, none: str) -> str:
    """Default value in the help; `none` stands for None."""
    if isinstance(value, tuple):
        return ",".join(f"{part:g}" for part in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.12g}"
    return none if value is None else f"{value}"
