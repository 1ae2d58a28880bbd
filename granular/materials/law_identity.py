"""Identity of user-defined laws in Python: their text, and all that they read elsewhere.

The text of a function does not determine its result alone, because it names values, helpers and
modules. A law is the text of its function and of all helpers, with the values that they read. It
runs as a copy that reads copies of these values, so that it cannot change.
"""

from __future__ import annotations
import __future__

import builtins
import hashlib
import inspect
import sys
import textwrap
from collections.abc import Callable, Iterator
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from granular.materials.law_names import (
    Chain,
    chains_of,
    check_in_place,
    codes_within,
    name_of_installed,
    refuse_module,
)

PLAIN = (type(None), bool, int, float, complex, str, bytes, range, type(Ellipsis))
"""Types of values that their `repr` determines."""
SHOWN_VALUES = 16
"""Largest number of values of an array that are written; of others it is their digest."""
SHOWN_TEXT = 300
"""Largest number of characters of a value that are written."""
UNCHANGEABLE = 1 << 8
"""Flag of classes whose attributes cannot be set, Py_TPFLAGS_IMMUTABLETYPE of CPython."""
FUTURE = sum({getattr(__future__, name).compiler_flag for name in __future__.all_feature_names})
ADVICE = "give it as parameters=, or define it in the function"


def frozen(update: Callable[..., None]) -> tuple[str, Callable[..., None]]:
    """Return the text that identifies a function, and a copy of it that cannot be changed.

    Raises
    ------
    ValueError
        Naming a value that the function reads but that cannot be a part of it, or a result that it
        does not change in place.
    """
    law = _Law()
    copy = law.of_function("update", update)
    check_in_place("update", getattr(copy, "py_func", copy).__code__)
    return "\n".join(law.lines()), copy


class _Law:
    """Functions of a law, in the order of their discovery, and the lines that describe them."""

    def __init__(self) -> None:
        self._texts: list[list[str]] = []
        self._copies: dict[int, tuple[int, Any, Any]] = {}
        # by the id of a function: its number, its copy, and itself, so that the id is not reused

    def lines(self) -> Iterator[str]:
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
        for used, chains in sorted(chains_of(name, plain.__code__).items()):
            if used in plain.__globals__:
                value = plain.__globals__[used]
                values[used], reading = self._of_named(f"{name}: {used}", used, value, chains)
                lines += reading
            elif not hasattr(builtins, used):
                raise ValueError(f"{name}: {used} is not defined: {ADVICE}")

    # ---- values that they read ----

    def _of_named(
        self, where: str, name: str, value: Any, chains: set[Chain]
    ) -> tuple[Any, list[str]]:
        """Copy of a global value, or of an attribute of a module, and the lines that describe it.

        Of a module it is a stand-in with copies of the attributes that are used, so that the law
        can access no others.
        """
        if not isinstance(value, ModuleType):
            copy, text = self._of_value(where, value)
            if callable(value) and chains != {()} and not _is_unchangeable(value):
                raise ValueError(
                    f"{where} is a function or a class of Python, whose attributes can be changed: "
                    "they must not be used"
                )
            return copy, [f"# {name} = {text}"]
        refuse_module(where, value.__name__)
        if () in chains:
            raise ValueError(
                f"{where} is a module, of which only attributes can be used: import what you need "
                "from it"
            )
        stand_in, lines = ModuleType(value.__name__), []
        for attribute in sorted({chain[0] for chain in chains}):
            if not hasattr(value, attribute):
                raise ValueError(f"{where}.{attribute} is not defined: {ADVICE}")
            copy, reading = self._of_named(
                f"{where}.{attribute}",
                f"{name}.{attribute}",
                getattr(value, attribute),
                {chain[1:] for chain in chains if chain[0] == attribute},
            )
            setattr(stand_in, attribute, copy)
            lines += reading
        return stand_in, lines

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
        if name := name_of_installed(where, value):
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
        results = [self._of_value(where, part, within) for part in parts]
        copies, texts = [copy for copy, _ in results], [text for _, text in results]
        if kind in (set, frozenset):
            texts.sort()
        return (slice(*copies) if kind is slice else kind(copies)), _short(
            f"{kind.__name__}({', '.join(texts)})"
        )


# ---- values ----


def _is_unchangeable(value: Any) -> bool:
    """Return whether the attributes of a function or class cannot be set, as of those made in C."""
    return isinstance(value, np.ufunc) or (
        isinstance(value, type) and bool(value.__flags__ & UNCHANGEABLE)
    )


def _short(text: str) -> str:
    """Text of a value, or its beginning and its digest."""
    if len(text) <= SHOWN_TEXT:
        return text
    return f"{text[:40]}... ({len(text)} characters, {_digest(text.encode())})"


def _digest(data: bytes) -> str:
    return f"digest {hashlib.blake2b(data, digest_size=16).hexdigest()}"


def _is_number(dtype: np.dtype) -> bool:
    """Return whether numbers of a type use all their bytes; a long double has padding."""
    return dtype.kind in "biufc" and dtype.itemsize <= (16 if dtype.kind == "c" else 8)


def _of_array(array: np.ndarray) -> tuple[np.ndarray, str]:
    """Read-only copy of an array, in one order, and the text that determines it."""
    copy = np.array(array, order="C")
    copy.setflags(write=False)
    data = copy.tobytes()
    text = repr(copy.tolist()) if copy.size <= SHOWN_VALUES else _digest(data)
    return copy, f"array of {copy.dtype.str}, {copy.shape}: {text}"


# ---- functions ----


def _is_compiled(function: Any) -> bool:
    """Return whether a function is one that numba compiles when it is called."""
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
    """Refuse properties of a function that its text does not show."""
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
        # The whole file: the names of the module affect how code is compiled.
        file = "".join(inspect.findsource(code)[0])
        made = compile(file, "law", "exec", code.co_flags & FUTURE, dont_inherit=True)
    except (OSError, TypeError, SyntaxError) as error:
        raise ValueError(
            f"{name} = {function!r} must be a function of a file or of a notebook's cell: its "
            "source cannot be read"
        ) from error
    place = (code.co_name, code.co_firstlineno)
    alike = [
        other for other in codes_within(made) if (other.co_name, other.co_firstlineno) == place
    ]
    if len(alike) != 1 or _content_of(alike[0]) != _content_of(code):
        raise ValueError(
            f"{name} = {function!r} must be the function that its source shows, alone in its line: "
            "was the file changed after it was imported?"
        )
    return textwrap.dedent(text)


def _content_of(code: CodeType) -> tuple[Any, ...]:
    """All parts of a code object that determine its result."""
    constants = []
    for value in code.co_consts:
        if isinstance(value, CodeType):
            constants.append(repr(_content_of(value)))
        elif isinstance(value, frozenset):
            constants.append(repr(sorted(map(repr, value))))
        else:
            constants.append(repr(value))
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    counts = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount)
    return code.co_code, constants, names, counts
