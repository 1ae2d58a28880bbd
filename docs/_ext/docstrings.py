"""Docstrings for Sphinx: bars of absolute values, and the text below a module's constant."""

from __future__ import annotations

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
            found = ModuleAnalyzer.for_module(source).find_attr_docs().get(("", last))
            if found:
                return list(found)
    log.warning("%s has no docstring", name)
    return []


def process(_: Sphinx, what: str, name: str, value: Any, __: Any, lines: list[str]) -> None:
    if what == "data":
        lines[:] = text_below(name, value)
    # |x| is an absolute value, not a substitution of reStructuredText
    lines[:] = [line if "``" in line else re.sub(r"(?<!\\)\|", r"\\|", line) for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", process, priority=100)  # before numpydoc
    return {"parallel_read_safe": True, "parallel_write_safe": True}
