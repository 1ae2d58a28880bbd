"""Show short defaults, bars of absolute values and docstrings of constants in autodoc."""

from __future__ import annotations

import inspect
import re
import sys
from typing import Any

from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer
from sphinx.util import logging

log = logging.getLogger(__name__)


def text_below(name: str, value: Any) -> list[str]:
    """Docstring below the assignment of a constant, in the module of the package that has one."""
    last = name.rpartition(".")[2]
    for module_name, module in list(sys.modules.items()):
        source = getattr(module, "__name__", "")
        if module_name != source or not source.startswith("granular."):
            continue
        if vars(module).get(last) is value:
            lines = ModuleAnalyzer.for_module(source).find_attr_docs().get(("", last))
            if lines:
                return list(lines)
    log.warning("%s has no docstring", name)
    return []


def process(_: Sphinx, what: str, name: str, value: Any, __: Any, lines: list[str]) -> None:
    if what == "data":
        lines[:] = text_below(name, value)
    # |x| is an absolute value and not a substitution, x_ the begin of a name and not a target
    lines[:] = [line if "``" in line else re.sub(r"(?<!\\)\|", r"\\|", line) for line in lines]
    lines[:] = [line if "`" in line else re.sub(r"(?<=\w)_(?!\w)", r"\\_", line) for line in lines]


class Shown:
    """A default value that is shown as a text."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return self.text


def short(value: Any) -> Any:
    """A default value: the name of a ready material or scheme, and long ones without arguments."""
    import granular
    from granular.tools.description import Description

    for module in (granular.schemes, granular.materials, granular.sph):
        for name, known in vars(module).items():
            # other names may be of plain values: False is `typing.TYPE_CHECKING`
            if value is known and isinstance(value, Description):
                return Shown(f"{module.__name__.rpartition('.')[2]}.{name}")
    if len(repr(value)) > 40:
        return Shown(f"{type(value).__name__}(...)")
    return value


def shorten(_: Sphinx, what: str, __: str, value: Any, ___: Any, text: str, ____: Any) -> Any:
    """Signature of a function or class without types, and with defaults in short."""
    if what not in ("function", "class", "method") or not text or len(text) < 20:
        return None
    import granular.mpm

    if value is granular.Simulation:  # its signature only dispatches to the method of the scene
        value = granular.mpm.simulation.Simulation
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):
        return None
    empty = inspect.Parameter.empty
    parameters = [
        p.replace(annotation=empty, default=p.default if p.default is empty else short(p.default))
        for p in signature.parameters.values()
        if p.name != "self"
    ]
    return str(inspect.Signature(parameters)), None


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", process, priority=100)  # before numpydoc
    app.connect("autodoc-process-signature", shorten)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
