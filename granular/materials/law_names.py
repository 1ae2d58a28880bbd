"""Names in the code of a user-defined law, and values that are identified by their name alone.

These are the values that installed packages and Python define. A law may contain them by name and
version, except those that return another value at each call, or read data outside of the process.
"""

from __future__ import annotations

import dis
import sys
import sysconfig
from collections.abc import Iterator
from enum import Enum
from functools import cache
from importlib import metadata
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

Chain = tuple[str, ...]
"""Names of the attributes of a global value, each of the one before."""

REFUSED_BUILTINS = (
    *("eval", "exec", "compile", "globals", "locals", "vars", "open", "input", "getattr"),
    *("breakpoint", "setattr", "delattr", "__import__", "__builtins__", "__loader__", "__spec__"),
)
"""Built-in names by which code accesses objects that its text does not name."""
CHANCE = ("random", "_random", "secrets", "time", "datetime", "uuid", "numpy.random")
"""Modules whose functions return another value at each call, which is no part of a law."""
OUTSIDE = (
    *("os", "posix", "nt", "posixpath", "ntpath", "sys", "io", "_io", "pathlib", "shutil"),
    *("glob", "tempfile", "socket", "_socket", "subprocess", "ctypes", "_ctypes", "mmap"),
    *("builtins", "importlib", "inspect", "gc", "pickle", "_pickle", "shelve", "sqlite3"),
    *("urllib", "http", "threading", "_thread", "multiprocessing", "numpy.ctypeslib"),
)
"""Modules with which code reaches files, the environment, or any object."""
READING = (
    *(f"numpy.{name}" for name in ("load", "fromfile", "loadtxt", "genfromtxt", "memmap")),
    *("numpy.fromregex", "numpy.DataSource", "numpy.geterr", "numpy.seterr"),
    *("operator.attrgetter", "operator.methodcaller"),
    *("_operator.attrgetter", "_operator.methodcaller"),
)
"""Functions and classes that do so in modules that are allowed otherwise."""
FRAMES = ("gi_frame", "gi_code", "f_globals", "f_builtins", "f_locals", "f_back")
"""Attributes that give access to all names of a module, besides those with two underscores."""
FOLDERS = {"site-packages", "dist-packages"}
"""Names of the folders of installed packages."""


# ---- names in code ----

SKIPPED = ("EXTENDED_ARG", "CACHE", "PUSH_NULL")


def codes_within(code: CodeType) -> Iterator[CodeType]:
    """Code of all functions within a code, and of those within them."""
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield constant
            yield from codes_within(constant)


def chains_of(name: str, code: CodeType) -> dict[str, set[Chain]]:
    """Names of the global values that a code reads, and the attributes that it takes of each.

    Raises
    ------
    ValueError
        If the code changes objects outside of it, or uses attributes by which it could access any
        object.
    """
    chains: dict[str, set[Chain]] = {}
    for part in (code, *codes_within(code)):
        chain: list[str] = []  # that of the instructions before, empty if there is none
        for step in dis.get_instructions(part):
            if step.opname in SKIPPED:
                continue
            argument = str(step.argval)
            _check_step(name, step.opname, argument)
            if chain and step.opname not in ("LOAD_ATTR", "LOAD_METHOD"):
                chains.setdefault(chain[0], set()).add(tuple(chain[1:]))
                chain = []
            if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
                chain = [argument]
            elif chain:
                chain.append(argument)
    return chains


def _check_step(name: str, kind: str, argument: str) -> None:
    """Refuse an instruction whose effect the text and the values of a law do not determine."""
    if kind in ("STORE_GLOBAL", "DELETE_GLOBAL"):
        raise ValueError(f"{name} must not change the global {argument}: take history=")
    if kind == "IMPORT_NAME":
        raise ValueError(f"{name} must not import {argument}: import it outside, before")
    if kind == "LOAD_BUILD_CLASS":
        raise ValueError(f"{name} must not define a class")
    if kind in ("STORE_ATTR", "DELETE_ATTR"):
        raise ValueError(f"{name} must not change the attribute {argument}: take history=")
    if kind in ("LOAD_ATTR", "LOAD_METHOD", "LOAD_SUPER_ATTR") and (
        argument in FRAMES or (argument.startswith("__") and argument.endswith("__"))
    ):
        raise ValueError(f"{name} must not use the attribute {argument}, as it can reach anything")
    if kind in ("LOAD_GLOBAL", "LOAD_NAME") and argument in REFUSED_BUILTINS:
        raise ValueError(f"{name}: {argument} must not be used, as it can reach anything")


def check_in_place(name: str, code: CodeType) -> None:
    """Refuse a law that binds the name of a result to another array, which has no effect."""
    results, before = code.co_varnames[4:7], ""
    for step in dis.get_instructions(code):
        if step.opname in SKIPPED:
            continue
        if step.opname.startswith("STORE_"):
            stored = step.argval if isinstance(step.argval, tuple) else (step.argval,)
            bound = {*stored[: 1 + step.opname.count("STORE", 1)]} & {*results}
            if bound and not before.endswith("="):  # as that of stress *= 2
                raise ValueError(
                    f"{name} must change {bound.pop()} in place, as by {results[0]}[:] = ..., and "
                    "not give its name to another array"
                )
        before = step.argrepr if step.opname == "BINARY_OP" else ""


# ---- installed packages ----


def refuse_module(where: str, name: str) -> None:
    """Refuse a module, or a function of one, whose values are no part of a law."""
    if _is_within(name, CHANCE):
        raise ValueError(
            f"{where}: {name} must not be used: the law would be another one at each call"
        )
    if _is_within(name, (*OUTSIDE, *READING)):
        raise ValueError(
            f"{where}: {name} must not be used, as it accesses data outside of the law, such as "
            "files: read it outside, before"
        )


def _is_within(name: str, refused: tuple[str, ...]) -> bool:
    return any(name == other or name.startswith(f"{other}.") for other in refused)


def name_of_installed(where: str, value: Any) -> str:
    """Name and version under which an installed package, or Python, has a value; else an empty
    text.

    Raises
    ------
    ValueError
        If a law must not have it.
    """
    if isinstance(value, Enum):
        kind = name_of_installed(where, type(value))
        return kind and f"{value.name} of {kind}"
    if isinstance(value, np.ufunc):
        modules = ["numpy", "scipy.special"]
    else:
        modules = [getattr(value, "__module__", None) or ""]
    names = getattr(value, "__qualname__", None) or getattr(value, "__name__", "")
    for module in modules:
        target: Any = sys.modules.get(module) if isinstance(module, str) else None
        for name in str(names).split("."):
            target = getattr(target, name, None)
        if target is None or target is not value or not _defines(module, value):
            continue
        if version := version_of(module):
            if module != "builtins":
                refuse_module(where, f"{module}.{names}")
            elif names in REFUSED_BUILTINS:
                raise ValueError(f"{where}: {names} must not be used, as it can reach anything")
            return f"{module}.{names} {version}"
    return ""


def _defines(module: str, value: Any) -> bool:
    """Return whether a function belongs to a module and was not only assigned there."""
    if not isinstance(value, FunctionType):
        return True
    origin = str(value.__globals__.get("__name__", ""))
    return origin.partition(".")[0] == module.partition(".")[0] and bool(version_of(origin))


def version_of(module: str) -> str:
    """Version of the installed package of a module, or of Python; empty for code of the user.

    The location of the file decides, because a module of the user may have the name of another one.
    """
    owner = sys.modules.get(module)
    if not isinstance(owner, ModuleType):
        return ""
    top = module.partition(".")[0]
    file = getattr(owner, "__file__", None)
    if file is None:
        spec = getattr(owner, "__spec__", None)
        by_user = spec is None or spec.origin not in ("built-in", "frozen")
        return "" if by_user or top not in sys.stdlib_module_names else "of Python"
    path = Path(file).resolve()
    if top == "granular" or FOLDERS & {*path.parts}:
        return _distributed(top)
    of_python = top in sys.stdlib_module_names and _is_in_library(path)
    return "of Python" if of_python else ""


@cache
def _distributed(top: str) -> str:
    """Version of the distribution of a package; empty if a file was only put among them."""
    try:
        return metadata.version(top)
    except metadata.PackageNotFoundError:
        names = metadata.packages_distributions().get(top, [])
        return metadata.version(names[0]) if names else ""


@cache
def _is_in_library(path: Path) -> bool:
    """Return whether a file is in the folder of the standard library."""
    folders = (sysconfig.get_path(name) for name in ("stdlib", "platstdlib"))
    places = [Path(folder) for folder in folders if folder]
    places.append(Path(sys.base_prefix, "DLLs"))  # of Windows
    return any(path.is_relative_to(place.resolve()) for place in places)
