"""Functions that the core can call for user-defined laws; see csrc/law/own.inl."""

from __future__ import annotations

import ctypes
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from granular.tools.extras import imported

MOST_NUMBERS = 30
"""Largest number of parameters besides K and G, as in csrc/law/law.h."""
MOST_HISTORY = 4
"""Largest number of variables of the history of a point, as in csrc/law/law.h."""
CAPSULE = b"granular.own_law"


class LawFunction:
    """A function that the core can call, with the objects that it needs.

    No exception can pass through the core: the first one is stored. The core repeats a call that
    was not completed, so that an exception from elsewhere, such as a time limit, does no damage.
    """

    def __init__(self, address: int | None, *references: object, called: object = None) -> None:
        new = ctypes.pythonapi.PyCapsule_New
        new.restype, new.argtypes = (
            ctypes.py_object,
            (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p),
        )
        self.capsule: object = new(address, CAPSULE, None)
        self.failure: BaseException | None = None
        self._references = references
        self._called = called  # the object that Python names where it can only report an exception

    def keeps(self, lost: sys.UnraisableHookArgs) -> bool:
        """Keep an exception that could only be reported, if it was in a call of this function."""
        if self._called is None:
            return False
        message = lost.err_msg or ""  # Python 3.13 names the function there
        if lost.object != self._called and repr(self._called) not in message:
            return False
        self.failure = self.failure or lost.exc_value
        return True

    def take_failure(self) -> BaseException | None:
        """Return the stored exception, if there is one, and clear it."""
        failure, self.failure = self.failure, None
        return failure


@contextmanager
def keeping_exceptions(functions: Sequence[LawFunction]) -> Iterator[None]:
    """Store exceptions that functions cannot store themselves and Python only reports.

    This concerns functions compiled by numba, and functions of Python before their first line,
    where exceptions set by another thread, such as a time limit, are raised.
    """
    before = sys.unraisablehook

    def report(lost: sys.UnraisableHookArgs) -> None:
        if not any([function.keeps(lost) for function in functions]):
            before(lost)

    sys.unraisablehook = report
    try:
        yield
    finally:
        sys.unraisablehook = before


def from_python(update: Callable[..., None], language: str) -> LawFunction:
    """Make a function that the core can call from one of Python."""
    return _by_numba(update) if language == "numba" else _for_numpy(update)


RETURNS = (
    "the law {!r} returned {}: it must change stress, shear_rate and history in place, as by "
    "stress[:] = ..., and return None"
)

# ---- NumPy ----

_SIGNATURE = ctypes.CFUNCTYPE(
    None, ctypes.c_int64, ctypes.c_int64, ctypes.c_double, *(ctypes.c_void_p,) * 7
)


def _view(address: int, *shape: int) -> np.ndarray:
    """Array of the numbers at an address."""
    size = math.prod(shape)
    return np.ctypeslib.as_array((ctypes.c_double * size).from_address(address)).reshape(shape)


def _for_numpy(update: Callable[..., object]) -> LawFunction:
    def call(
        n: int, dim: int, dt: float, numbers: int, gradient: int, c: int, stress: int, rate: int,
        history: int, done: int,
    ) -> None:  # fmt: skip
        try:
            returned = update(
                dt,
                _view(numbers, MOST_NUMBERS + 2),
                _view(gradient, 3, 3, n),
                _view(c, n),
                _view(stress, 4 if dim == 2 else 6, n),
                _view(rate, n),
                _view(history, MOST_HISTORY, n),
            )
            if returned is not None:
                raise TypeError(RETURNS.format(update.__name__, type(returned).__name__))
            ctypes.c_int64.from_address(done).value = 1
        except BaseException as error:
            made.failure = made.failure or error

    callback = _SIGNATURE(call)
    made = LawFunction(ctypes.cast(callback, ctypes.c_void_p).value, callback, called=call)
    return made


# ---- numba ----


CALLED_BY_NUMBA = "<numba.core.cpu.CPUContext>"
"""Object that numba names when it reports an exception."""


def _by_numba(update: Callable[..., None]) -> LawFunction:
    numba = imported("numba", "laws")
    inner: Any = update if hasattr(update, "py_func") else numba.njit(update)
    numbers, integers = (
        numba.types.CPointer(kind) for kind in (numba.types.float64, numba.types.int64)
    )
    integer, real = numba.types.int64, numba.types.float64
    most, states = MOST_NUMBERS + 2, MOST_HISTORY

    @numba.cfunc(numba.types.void(integer, integer, real, *(numbers,) * 6, integers))
    def call(n, dim, dt, numbers, gradient, c, stress, rate, history, done):  # type: ignore[no-untyped-def]
        inner(
            dt,
            numba.carray(numbers, (most,)),
            numba.carray(gradient, (3, 3, n)),
            numba.carray(c, (n,)),
            numba.carray(stress, (2 * dim, n)),
            numba.carray(rate, (n,)),
            numba.carray(history, (states, n)),
        )
        done[0] = 1

    for made in inner.overloads.values():
        if made.signature.return_type != numba.types.none:
            raise TypeError(RETURNS.format(update.__name__, made.signature.return_type))
    return LawFunction(call.address, call, called=CALLED_BY_NUMBA)


# ---- C ----

PARAMETERS = (
    "int64_t n, int64_t dim, double dt, const double *parameters, const double *gradient, "
    "const double *log_density, double *stress, double *shear_rate, double *history"
)
BEFORE = "#include <math.h>\n#include <stdint.h>\n#line 1\n"
AFTER = f"""
#line 1 "granular"
void update({PARAMETERS});
__attribute__((visibility("default"))) void granular_law({PARAMETERS}, int64_t *done)
{{
    update(n, dim, dt, parameters, gradient, log_density, stress, shear_rate, history);
    *done = 1;
}}
"""
FLAGS = (
    *("-shared", "-fPIC", "-fvisibility=hidden"),
    *("-Werror=implicit-function-declaration", "-Werror=date-time"),
    *("-O3", "-march=native", "-fopenmp-simd"),
    *("-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
)
"""Flags of the compiler; none of them changes a result, whatever instructions the machine has."""
ENVIRONMENT = ("PATH", "HOME", "TMPDIR", "LD_LIBRARY_PATH", "SDKROOT", "DEVELOPER_DIR")
"""Environment variables of the compiler; others, such as CPATH, can change the meaning of a
source."""
HEADERS = ("math", "stdint", "stddef", "stdbool", "string", "float", "limits", "complex", "tgmath")
"""Headers that a source may include: headers of the language without state."""
QUOTED = "|".join(rf"{q}(?:\\.|[^{q}\\\n])*{q}" for q in "\"'")
"""Strings and characters of C."""
PASSING_BY = (
    *(r"##", r"%:%:", r"\b_Pragma\b", r"\b__has_include\w*", r"\b__has_embed\b"),
    *(r"\basm\b", r"\b__asm\w*", r'\b(?:u8|[uUL])?R"'),
)
"""Words that a source must not have: they read files, or hide others from the checks below."""
DIRECTIVES = (
    *("define", "undef", "if", "ifdef", "ifndef", "elif", "else", "endif"),
    *("error", "pragma", ""),
)
MOST_TOLD = 3000
"""Number of characters of the messages of the compiler that are shown."""


def _without_comments(source: str) -> str:
    """Source with its lines joined where they go on in the next one, without comments."""
    joined = re.sub(r"\\[ \t\v\f\r]*\n", "", source)
    comment_or_string = rf"/\*.*?\*/|//[^\n]*|{QUOTED}"
    return re.sub(comment_or_string, lambda t: " " if t[0][0] == "/" else t[0], joined, flags=re.S)


def _check_words(name: str, source: str) -> None:
    """Refuse C source with words by which it would evade the other checks."""
    code = re.sub(QUOTED, '""', _without_comments(source))
    if word := re.search("|".join(PASSING_BY), code):
        raise ValueError(
            f"the C source of the law {name!r} must not have {word[0]}: with it, what the source "
            "says would not be all that it does"
        )


def _check_includes(name: str, source: str) -> None:
    """Refuse C source that is not all of the law."""
    for line in _without_comments(source).splitlines():
        directive = re.match(r"\s*(?:#|%:)\s*(\w*)\s*(.*)", line)
        if not directive or directive[1] in DIRECTIVES:
            continue
        if directive[1] != "include" or directive[2].strip() not in {f"<{h}.h>" for h in HEADERS}:
            raise ValueError(
                f"the C source of the law {name!r} has {line.strip()!r}: it must be all of the "
                f"law, so that it may include <math.h> and the like only, {', '.join(HEADERS)}"
            )


def _check_variables(name: str, source: str) -> None:
    """Refuse variables that last from call to call; those hidden in macros are not detected."""
    code = re.sub(r"^\s*(?:#|%:)[^\n]*", "", _without_comments(source), flags=re.M)
    for variable in _lasting(code):
        raise ValueError(
            f"the C source of the law {name!r} has the variable {variable!r}, which lasts from "
            "call to call, so that results would depend on the threads: take history=, or make it "
            "const"
        )


def _lasting(code: str) -> list[str]:
    """Declarations of variables outside of functions, and of static ones, that are not const."""
    outside, depth = [""], 0
    for part in re.split(r"([{};])", code):
        if part == "{":
            depth += 1
        elif part == "}":
            depth -= 1
            if depth == 0 and "=" not in outside[-1]:  # the end of a function or a type
                kind = re.match(r"\s*(?:typedef|struct|union|enum)\b", outside[-1])
                outside[-1] = outside[-1] if kind else ""
        elif depth == 0 and part == ";":
            outside.append("")
        elif depth == 0:
            outside[-1] += part
    declared = [" ".join(part.partition("=")[0].split()) for part in outside]
    variables = [
        text
        for text in declared
        if text
        and not re.search(r"\bconst\b|\(", text)
        and not re.match(r"(?:typedef|_Static_assert|static_assert)\b", text)
        and not re.fullmatch(r"(?:struct|union|enum)\b\s*\w*", text)
    ]
    inner = re.findall(r"\bstatic\b[^;{}()=]*[;=]", code)
    return variables + [text.strip("; =") for text in inner if not re.search(r"\bconst\b", text)]


def from_c(name: str, source: str) -> LawFunction:
    """Compile C source by the system's compiler, and load it.

    Raises
    ------
    ValueError
        If there is no compiler, or the source does not compile to a function `update`.
    """
    _check_words(name, source)
    _check_includes(name, source)
    with tempfile.TemporaryDirectory(prefix="granular-law-") as folder:
        text, path = Path(folder, "law.c"), Path(folder, "law.so")
        text.write_text(BEFORE + source + AFTER, encoding="utf-8")
        command = [*_compiler(), *FLAGS, "-o", str(path), str(text), "-lm"]
        environment = {key: os.environ[key] for key in ENVIRONMENT if key in os.environ}
        try:
            ran = subprocess.run(
                command,
                capture_output=True,
                text=True,
                env=environment | {"LC_ALL": "C"},
                check=False,
            )
            if ran.returncode:
                raise OSError(ran.stderr.replace(str(text), "law.c").strip()[:MOST_TOLD])
            _check_variables(name, source)
            library = ctypes.CDLL(str(path))
            address = ctypes.cast(library.granular_law, ctypes.c_void_p).value
        except (OSError, AttributeError) as error:
            raise ValueError(
                f"the C source of the law {name!r} must compile, and define void update("
                f"{PARAMETERS}): {error}"
            ) from error
    return LawFunction(address, library)


def _compiler() -> list[str]:
    """Command of the C compiler, from the variable CC, else the usual one."""
    usual = (os.environ.get("CC"), sysconfig.get_config_var("CC"), "cc", "gcc", "clang")
    for words in (shlex.split(command) for command in usual if command):
        if words and shutil.which(words[0]):
            return [word for word in words if not word.startswith("-")]  # no flags but ours
    raise ValueError("there is no C compiler: install one, or name it in the variable CC")
