"""Identity of laws of the user's own in Python: their text, and all that they read elsewhere.

The text of functions does not determine what they compute: it names values, helpers and modules. A
law is the text of its function and of all helpers, with the values that they read. It runs as a
copy that reads copies of these values, so that it stays what its text says.
"""

from __future__ import annotations
import __future__

import builtins
import dis
import hashlib
import inspect
import sys
import textwrap
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

__all__ = ["frozen"]

PLAIN = (type(None), bool, int, float, complex, str, bytes, range, type(Ellipsis))
"""Types of values that their `repr` determines."""
REFUSED_BUILTINS = (
    *("eval", "exec", "compile", "globals", "locals", "vars", "open", "input"),
    *("breakpoint", "setattr", "delattr", "__import__"),
)
"""Built-in functions with which code reaches what its text does not name."""
REFUSED_MODULES = ("random", "secrets", "time", "datetime", "uuid", "numpy.random")
"""Modules whose functions return another value at each call, which is no part of a law."""
SHOWN_VALUES = 16
"""Largest number of values of an array that are written; of others it is their digest."""
SHOWN_TEXT = 300
"""Largest number of characters of a value that are written."""
FUTURE = sum({getattr(__future__, name).compiler_flag for name in __future__.all_feature_names})
ADVICE = "give it as parameters=, or define it in the function"


def frozen(update: Callable[..., None]) -> tuple[str, Callable[..., None]]:
    """Return the text that identifies a function, and a copy of it that nothing can change.

    Raises
    ------
    ValueError
        Naming what the function reads that cannot be a part of it.
    """
    law = _Law()
    copy = law.of_function("update", update)
    return "\n".join(law.told()), copy


class _Law:
    """Functions of a law, in the order in which they are found, and the lines that tell of them."""

    def __init__(self) -> None:
        self._texts: list[list[str]] = []
        self._copies: dict[int, tuple[int, Any, Any]] = {}
        # by the id of a function: its number, its copy, and itself, so that the id stays its own

    def told(self) -> Iterator[str]:
        for number, lines in enumerate(self._texts):
            yield from [f"# function {number}:"] * (number > 0) + lines

    # ---- functions ----

    def of_function(self, name: str, function: Any) -> Any:
        """Return the copy of a function, of Python or compiled by numba; both are noted."""
        if id(function) not in self._copies:
            self._freeze(name, function)
        return self._copies[id(function)][1]

    def _freeze(self, name: str, function: Any) -> None:
        plain = function.py_func if _is_compiled(function) else function
        _check_plain(name, plain)
        lines = [_text_of(name, plain).rstrip()]
        copy: Any = FunctionType(plain.__code__, {"__builtins__": builtins}, plain.__name__)
        values = copy.__globals__
        if plain is not function:
            copy = _compiled_alike(name, function, copy)
            lines.append(f"# numba: {_options_of(function)}")
        self._copies[id(function)] = len(self._texts), copy, function
        self._texts.append(lines)
        for used, attributes in sorted(_globals_of(name, plain.__code__).items()):
            if used in plain.__globals__:
                value = plain.__globals__[used]
                values[used], text = self._of_global(f"{name}: {used}", value, attributes)
                lines += text.replace("$", used).splitlines()
            elif not hasattr(builtins, used):
                raise ValueError(f"{name}: {used} is not defined: {ADVICE}")
            elif used in REFUSED_BUILTINS:
                raise ValueError(f"{name}: {used} must not be used, as it can reach anything")

    # ---- what they read ----

    def _of_global(self, where: str, value: Any, attributes: set[str] | None) -> tuple[Any, str]:
        """Copy of a global value, and the lines that tell of it, with $ for its name."""
        if not isinstance(value, ModuleType):
            copy, text = self._of_value(where, value)
            return copy, f"# $ = {text}"
        for name in {value.__name__, *(f"{value.__name__}.{name}" for name in attributes or ())}:
            _refuse_chance(where, name)
        if version := _installed(value.__name__):
            return value, f"# $ = module {value.__name__} {version}".rstrip()
        if not attributes:
            raise ValueError(
                f"{where} is a module of your own, of which only attributes can be used: import "
                "what you need from it"
            )
        stand_in, lines = ModuleType(value.__name__), []
        for name in sorted(attributes):
            if not hasattr(value, name):
                raise ValueError(f"{where}.{name} is not defined: {ADVICE}")
            copy, text = self._of_value(f"{where}.{name}", getattr(value, name))
            setattr(stand_in, name, copy)
            lines.append(f"# $.{name} = {text}")
        return stand_in, "\n".join(lines)

    def _of_value(self, where: str, value: Any, within: tuple[int, ...] = ()) -> tuple[Any, str]:
        """Copy of a value, and the text that determines it."""
        kind = type(value)
        if kind in PLAIN:
            return value, _short(repr(value))
        if isinstance(value, np.generic) and _is_number(value.dtype):
            return value, f"{value.dtype.name}({value.tobytes().hex()}, {value.item()!r})"
        if kind is np.ndarray and _is_number(value.dtype):
            return _of_array(value)
        if isinstance(value, np.dtype) and _is_number(value):
            return value, f"dtype {value.str}"
        if name := _name_of_installed(value):
            _refuse_chance(where, getattr(value, "__module__", ""))
            return value, name
        if _is_compiled(value) or kind is FunctionType:
            copy = self.of_function(f"{where}", value)
            return copy, f"function {self._copies[id(value)][0]}"
        if kind in (tuple, list, frozenset, set, dict, slice) and id(value) not in within:
            return self._of_many(where, value, (*within, id(value)))
        raise ValueError(
            f"{where} = {_short(repr(value))} must be a plain value, an array of numbers, a "
            f"function, or of an installed package: {ADVICE}"
        )

    def _of_many(self, where: str, value: Any, within: tuple[int, ...]) -> tuple[Any, str]:
        kind = type(value)
        if kind is dict:
            pairs = [
                [self._of_value(where, part, within) for part in item] for item in value.items()
            ]
            text = ", ".join(f"{key}: {entry}" for (_, key), (_, entry) in pairs)
            return {key: entry for (key, _), (entry, _) in pairs}, _short(f"{{{text}}}")
        parts = (value.start, value.stop, value.step) if kind is slice else value
        found = [self._of_value(where, part, within) for part in parts]
        copies, texts = [copy for copy, _ in found], [text for _, text in found]
        if kind in (set, frozenset):
            texts.sort()
        return (slice(*copies) if kind is slice else kind(copies)), _short(
            f"{kind.__name__}({', '.join(texts)})"
        )


# ---- values ----


def _refuse_chance(where: str, module: str) -> None:
    if module in REFUSED_MODULES:
        raise ValueError(
            f"{where}: {module} must not be used: the law would be another one at each call"
        )


def _short(text: str) -> str:
    """Text of a value, or its beginning and its digest."""
    if len(text) <= SHOWN_TEXT:
        return text
    return f"{text[:40]}... ({len(text)} characters, {_digest(text.encode())})"


def _digest(data: bytes) -> str:
    return f"digest {hashlib.blake2b(data, digest_size=16).hexdigest()}"


def _is_number(dtype: np.dtype) -> bool:
    """Return if the bytes of numbers of a type are all theirs; a long double has some to spare."""
    return dtype.kind in "biufc" and dtype.itemsize <= (16 if dtype.kind == "c" else 8)


def _of_array(array: np.ndarray) -> tuple[np.ndarray, str]:
    """Read-only copy of an array, in one order, and the text that determines it."""
    copy = np.array(array, order="C")
    copy.setflags(write=False)
    data = copy.tobytes()
    text = repr(copy.tolist()) if copy.size <= SHOWN_VALUES else _digest(data)
    return copy, f"array of {copy.dtype.str}, {copy.shape}: {text}"


def _installed(module: str) -> str:
    """Version of the installed package of a module, or of Python; empty for the user's own."""
    top = module.partition(".")[0]
    if top in sys.stdlib_module_names:
        return "of Python"
    places = getattr(sys.modules.get(top), "__file__", None) or ""
    if top != "granular" and not {"site-packages", "dist-packages"} & {*Path(places).parts}:
        return ""
    try:
        return metadata.version(top)
    except metadata.PackageNotFoundError:
        return str(getattr(sys.modules[top], "__version__", "of no version"))


def _name_of_installed(value: Any) -> str:
    """Name by which an installed package, or Python, has a value; empty if none has."""
    if isinstance(value, np.ufunc):
        modules = ["numpy", "scipy.special"]
    else:
        modules = [getattr(value, "__module__", None) or ""]
    names = getattr(value, "__qualname__", None) or getattr(value, "__name__", "")
    for module in modules:
        found: Any = sys.modules.get(module) if isinstance(module, str) else None
        for name in str(names).split("."):
            found = getattr(found, name, None)
        if found is not None and found is value and (version := _installed(module)):
            return f"{module}.{names} {version}"
    return ""


# ---- functions ----


def _is_compiled(function: Any) -> bool:
    """Return if a function is one that numba compiles when it is called."""
    numba = sys.modules.get("numba")
    return numba is not None and isinstance(function, numba.core.registry.CPUDispatcher)


def _options_of(function: Any) -> dict[str, Any]:
    """Options with which numba compiles a function."""
    options = {key: value for key, value in function.targetoptions.items() if value is not None}
    return {
        key: sorted(value) if isinstance(value, set) else value
        for key, value in sorted(options.items())
    }


def _compiled_alike(name: str, function: Any, copy: FunctionType) -> Any:
    """Copy of a function that numba compiles with the same options."""
    options = _options_of(function)
    if options.get("parallel"):
        raise ValueError(f"{name} must not be compiled with parallel=True: the core has threads")
    if not function._can_compile:
        raise ValueError(f"{name} must not be compiled for given types: leave them to numba")
    for key, value in options.items():
        if not isinstance(value, (bool, str, list)):
            raise ValueError(f"{name} must not be compiled with {key}={value!r}")
    options = {k: set(v) if isinstance(v, list) else v for k, v in options.items()}
    return sys.modules["numba"].jit(**options)(copy)


def _check_plain(name: str, function: Any) -> None:
    """Refuse what the text of a function does not show."""
    if not isinstance(function, FunctionType) or function.__defaults__ or function.__kwdefaults__:
        raise ValueError(
            f"{name} = {function!r} must be a plain function without default values, which are no "
            "part of its source: give them as parameters"
        )
    if names := function.__code__.co_freevars:
        raise ValueError(
            f"{name} = {function!r} must not use variables of an enclosing function, {names}, "
            "which are no part of its source: give them as parameters"
        )
    if function.__dict__:
        raise ValueError(f"{name} = {function!r} must have no attributes, {[*function.__dict__]}")
    if function.__code__.co_flags & (inspect.CO_GENERATOR | inspect.CO_COROUTINE):
        raise ValueError(f"{name} = {function!r} must be a plain function, without yield or await")


def _text_of(name: str, function: FunctionType) -> str:
    """Source of a function, which must be that of the code which runs."""
    code = function.__code__
    try:
        text = inspect.getsource(code)
        # The whole file: what the names of the module are is a part of how code is compiled.
        file = "".join(inspect.findsource(code)[0])
        made = compile(file, "law", "exec", code.co_flags & FUTURE, dont_inherit=True)
    except (OSError, TypeError, SyntaxError) as error:
        raise ValueError(
            f"{name} = {function!r} must be a function of a file or of a notebook's cell: its "
            "source cannot be read"
        ) from error
    place = (code.co_name, code.co_firstlineno)
    alike = [other for other in _codes(made) if (other.co_name, other.co_firstlineno) == place]
    if len(alike) != 1 or _told_of(alike[0]) != _told_of(code):
        raise ValueError(
            f"{name} = {function!r} must be the function that its source shows, alone in its line: "
            "was the file changed after it was imported?"
        )
    return textwrap.dedent(text)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Code of all functions within a code, and of those within them."""
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield constant
            yield from _codes(constant)


def _told_of(code: CodeType) -> tuple[Any, ...]:
    """All of a code that determines what it does."""
    constants = []
    for value in code.co_consts:
        if isinstance(value, CodeType):
            constants.append(repr(_told_of(value)))
        elif isinstance(value, frozenset):
            constants.append(repr(sorted(map(repr, value))))
        else:
            constants.append(repr(value))
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount)
    return code.co_code, constants, names, counts


SKIPPED = ("EXTENDED_ARG", "CACHE", "PUSH_NULL")
CHANGING = ("STORE_GLOBAL", "DELETE_GLOBAL")


def _globals_of(name: str, code: CodeType) -> dict[str, set[str] | None]:
    """Names of the global values that a code reads, and of the attributes of each.

    The attributes are None if the value itself is used, too.
    """
    found: dict[str, set[str] | None] = {}
    for part in (code, *_codes(code)):
        steps = [step for step in dis.get_instructions(part) if step.opname not in SKIPPED]
        for step, following in zip(steps, [*steps[1:], None], strict=True):
            told = str(step.argval)
            if step.opname in CHANGING:
                raise ValueError(f"{name} must not change the global {told}: take history=")
            if step.opname == "IMPORT_NAME":
                raise ValueError(f"{name} must not import {told}: import it outside, before")
            if step.opname == "LOAD_BUILD_CLASS":
                raise ValueError(f"{name} must not define a class")
            if not step.opname.startswith("LOAD_GLOBAL") and step.opname != "LOAD_NAME":
                continue
            attributes = found.setdefault(told, set())
            if following is None or following.opname not in ("LOAD_ATTR", "LOAD_METHOD"):
                found[told] = None
            elif attributes is not None:
                attributes.add(following.argval)
    return found
