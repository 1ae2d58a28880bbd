"""Constitutive laws of the user's own, in NumPy, compiled by numba, or in C.

The core calls the function of such a law with arrays of some hundred points after the elastic
predictor; see csrc/law/own.inl. Functions are known in this process by the digest of their source,
with which records are marked.
"""

from __future__ import annotations

import ctypes
import hashlib
import inspect
import math
import tempfile
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib import import_module, util
from pathlib import Path
from typing import Any

import numpy as np

from granular.checks import finite, kinds_of, one_of, truth
from granular.materials.base import Material
from granular.serializable import Parameters

__all__ = ["OwnLaw", "from_function"]

LANGUAGES = ("numpy", "numba", "c")
MOST_NUMBERS = 30
"""Largest number of parameters besides K and G, that of csrc/law/law.h."""
MOST_HISTORY = 4
"""Largest number of variables of the history of a point, that of csrc/law/law.h."""
CAPSULE = b"granular.own_law"
DECLARATION = """
void update(int64_t n, int64_t dim, double dt, const double *parameters, const double *gradient,
            const double *log_density, double *stress, double *shear_rate, double *history);
"""
FLAGS = (
    *("-O3", "-march=native", "-fopenmp-simd"),
    *("-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
)
"""Flags of the compiler; none of them changes a result, whatever instructions the machine has."""


class _Function:
    """A function that the core can call, with all that it needs to live."""

    def __init__(self, address: int, *references: object) -> None:
        new = ctypes.pythonapi.PyCapsule_New
        new.restype, new.argtypes = (
            ctypes.py_object,
            (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p),
        )
        self.capsule: object = new(address, CAPSULE, None)
        self.failure: BaseException | None = None
        self._references = references


_FUNCTIONS: dict[str, _Function] = {}
"""Functions by the digest of their law; they live as long as the process, as engines use them."""


@dataclass(frozen=True, kw_only=True)
class OwnLaw(Material):
    """Material with a law of the user's own; `granular.materials.from_function` makes one.

    Parameters
    ----------
    E, nu, rho_c : float
        See `Material`. They give the elastic predictor and the time step.
    elasticity : {"hypoelastic"}
        The predictor is that of the Jaumann rate.
    restitution : float
        Must be 1: damping needs the plastic strain rate, which is not known.
    contact_diameter : float, optional
        Not used.
    name : str
        Name of the law.
    language : {"numpy", "numba", "c"}
        How the source is run.
    source : str
        Source of the function. Runs are resumed with the same source only.
    parameters : mapping of str to float
        Numbers that the function is given after K and G; 30 at most.
    history : mapping of str to float
        Variables that every point keeps, with their initial values; 4 at most.
    bears_tension : bool
        True for a material that is never disconnected, such as a solid.

    Raises
    ------
    TypeError, ValueError
        Naming argument, value and allowed range.
    """

    name: str
    language: str
    source: str
    parameters: Mapping[str, float] = field(default_factory=Parameters)
    history: Mapping[str, float] = field(default_factory=Parameters)
    bears_tension: bool = False

    flow = "own"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.restitution != 1.0:
            raise ValueError(
                f"restitution = {self.restitution} must be 1 with a law of one's own, whose "
                "plastic strain rate is not known"
            )
        if self.elasticity != "hypoelastic":
            raise ValueError(f'elasticity = {self.elasticity!r} must be "hypoelastic" here')
        kinds_of(self, name=str, source=str, parameters=Mapping, history=Mapping)
        one_of("language", self.language, LANGUAGES)
        truth("bears_tension", self.bears_tension)
        for name, most in (("parameters", MOST_NUMBERS), ("history", MOST_HISTORY)):
            given = {key: finite(f"{name}[{key!r}]", v) for key, v in getattr(self, name).items()}
            if len(given) > most:
                raise ValueError(f"{name} = {given} must be {most} numbers at most")
            object.__setattr__(self, name, Parameters(given))

    @property
    def granular(self) -> bool:  # type: ignore[override]  # else of the class
        """True if the material separates in tension."""
        return not self.bears_tension

    @cached_property
    def digest(self) -> str:
        """Digest of the source of the law, by which records know it."""
        told = f"{self.language}\n{self.source}".encode()
        return hashlib.blake2b(told, digest_size=16).hexdigest()

    def numbers(self) -> tuple[float, ...]:
        """K, G and the parameters, as the function is given them."""
        return (self.K, self.G, *self.parameters.values())

    def function(self) -> _Function:
        """Return the function that the core calls.

        Raises
        ------
        ValueError
            If the law was made in another process from a Python function that this one does not
            know, or C source does not compile.
        """
        if self.digest not in _FUNCTIONS:
            if self.language != "c":
                raise ValueError(
                    f"the law {self.name!r} with the source digest {self.digest} is not known in "
                    "this process: call granular.materials.from_function with the same function "
                    "first"
                )
            _FUNCTIONS[self.digest] = _compiled(self.name, self.source, self.digest)
        return _FUNCTIONS[self.digest]


def from_function(
    update: Callable[..., None] | str,
    *,
    parameters: Mapping[str, float] | None = None,
    history: Mapping[str, float] | None = None,
    compiler: str | None = None,
    name: str | None = None,
    E: float = 1e6,
    nu: float = 0.3,
    rho_c: float = 1500.0,
    bears_tension: bool = False,
) -> OwnLaw:
    """Make a material with a constitutive law of one's own.

    Parameters
    ----------
    update : callable or str
        ``update(dt, parameters, gradient, log_density, stress, shear_rate, history)``, which
        changes the last three in place for n points at once, or the source of a C function `update`
        (see Notes). The arrays are

        - `dt`: time step [s];
        - `parameters` (32,): K and G [Pa], the numbers given here, in their order, then zeros;
        - `gradient` (dim, dim, n): increment L dt of the velocity gradient;
        - `log_density` (n,): ln(rho/rho_c) at the end of the step;
        - `stress` (4 or 6, n): xx, yy, zz, xy (and yz, xz) [Pa, tension positive], on entry the
          trial stress of the elastic predictor, on return the stress at the end of the step;
        - `shear_rate` (n,): 0 on entry, the plastic shear rate [1/s] on return;
        - `history` (4, n): the variables that a point keeps, in the order given here.
    parameters : mapping of str to float, optional
        Numbers of the law, 30 at most.
    history : mapping of str to float, optional
        Variables that every point keeps, 4 at most, and their values at the start. A state has them
        as `history`, shape (n, 4).
    compiler : {None, "numba"}, optional
        How a callable is run: None as it is, with NumPy; "numba" compiled, for which loops over the
        points are as good as arrays. Must be None for C source.
    name : str, optional
        Name of the law; by default that of the function.
    E, nu, rho_c : float
        See `Material`.
    bears_tension : bool
        True for a material that is never disconnected, such as a solid.

    Returns
    -------
    OwnLaw

    Raises
    ------
    TypeError, ValueError
        For wrong arguments, a function whose source cannot be read, that has default values or uses
        variables of an enclosing function, a method, and C source that does not compile.
    ModuleNotFoundError
        Without numba, or cffi for C: ``pip install 'granular[laws]'``.

    Notes
    -----
    Points far from contact are among those given: stress-free ones with a log_density below 0.
    What the pressure is, and when material separates, is for the function to decide; the laws here
    take ``p = K log_density`` where log_density >= 0, and no stress elsewhere.

    Spare places are among the points, too. Their numbers are finite, and what becomes of them does
    not matter. A function must treat each point by itself, or the result depends on the number of
    threads.

    The C function is ``void update(int64_t n, int64_t dim, double dt, const double *parameters,
    const double *gradient, const double *log_density, double *stress, double *shear_rate, double
    *history)``; component c of an array begins at c n.
    """
    kinds = {None: "numpy", "numba": "numba"}
    if isinstance(update, str):
        if compiler is not None:
            raise ValueError(f"compiler = {compiler!r} must be None for C source")
        language, source, called = "c", textwrap.dedent(update), name or "update"
    else:
        if not callable(update):
            raise TypeError(f"update = {update!r} must be a function or the source of one in C")
        language = kinds[one_of("compiler", compiler, tuple(kinds))]
        source, called = _source_of(update), name or update.__name__
    law = OwnLaw(
        E=E,
        nu=nu,
        rho_c=rho_c,
        name=called,
        language=language,
        source=source,
        parameters={} if parameters is None else parameters,
        history={} if history is None else history,
        bears_tension=bears_tension,
    )
    if language == "c":
        law.function()
    elif law.digest not in _FUNCTIONS:
        assert not isinstance(update, str)
        make = _for_numpy if language == "numpy" else _by_numba
        _FUNCTIONS[law.digest] = make(update)
    return law


def _source_of(update: Callable[..., None]) -> str:
    """Source of a function, which must be all that determines it, and the global numbers in it."""
    function = getattr(update, "py_func", update)  # of what numba has compiled
    if inspect.ismethod(function) or getattr(function, "__defaults__", None):
        raise ValueError(
            f"update = {update!r} must be a plain function without default values, which are no "
            "part of its source: give them as parameters"
        )
    names = getattr(getattr(function, "__code__", None), "co_freevars", ())
    if names:
        raise ValueError(
            f"update = {update!r} must not use variables of an enclosing function, {names}, which "
            "are no part of its source: give them as parameters"
        )
    try:
        source = textwrap.dedent(inspect.getsource(function))
    except (OSError, TypeError) as error:
        raise ValueError(
            f"update = {update!r} must be a function of a file or of a notebook's cell: its source "
            "cannot be read"
        ) from error
    used = inspect.getclosurevars(function).globals if inspect.isfunction(function) else {}
    kinds = (int, float, complex, np.number)
    told = [
        f"# {name} = {used[name]!r}\n" for name in sorted(used) if isinstance(used[name], kinds)
    ]
    return source + "".join(told)


_POINTER = ctypes.c_void_p
_SIGNATURE = ctypes.CFUNCTYPE(
    None, ctypes.c_int64, ctypes.c_int64, ctypes.c_double, *(_POINTER,) * 6
)


def _view(address: int, *shape: int) -> np.ndarray:
    """Array of the numbers at an address."""
    size = math.prod(shape)
    return np.ctypeslib.as_array((ctypes.c_double * size).from_address(address)).reshape(shape)


def _for_numpy(update: Callable[..., None]) -> _Function:
    """Let the core call a Python function.

    An exception cannot pass through the core: it is kept, and the stress becomes nan, so that the
    run stops.
    """

    def call(
        n: int, dim: int, dt: float, numbers: int, gradient: int, c: int, stress: int, rate: int,
        history: int,
    ) -> None:  # fmt: skip
        target = _view(stress, 4 if dim == 2 else 6, n)
        try:
            update(
                dt,
                _view(numbers, MOST_NUMBERS + 2),
                _view(gradient, dim, dim, n),
                _view(c, n),
                target,
                _view(rate, n),
                _view(history, MOST_HISTORY, n),
            )
        except BaseException as error:
            found.failure = found.failure or error
            target[:] = np.nan

    callback = _SIGNATURE(call)
    address = ctypes.cast(callback, ctypes.c_void_p).value
    assert address is not None
    found = _Function(address, callback)
    return found


def _by_numba(update: Callable[..., None]) -> _Function:
    """Compile a Python function to one that the core can call."""
    numba = _needed("numba")
    inner = numba.njit(update)
    pointer = numba.types.CPointer(numba.types.float64)
    integer, real = numba.types.int64, numba.types.float64
    most, kept = MOST_NUMBERS + 2, MOST_HISTORY

    @numba.cfunc(numba.types.void(integer, integer, real, *(pointer,) * 6))
    def call(n, dim, dt, numbers, gradient, c, stress, rate, history):  # type: ignore[no-untyped-def]
        inner(
            dt,
            numba.carray(numbers, (most,)),
            numba.carray(gradient, (dim, dim, n)),
            numba.carray(c, (n,)),
            numba.carray(stress, (2 * dim, n)),
            numba.carray(rate, (n,)),
            numba.carray(history, (kept, n)),
        )

    return _Function(call.address, call)


def _compiled(name: str, source: str, digest: str) -> _Function:
    """Compile C source by the system's compiler."""
    cffi = _needed("cffi")
    ffi, module = cffi.FFI(), f"law_{digest}"
    ffi.cdef(DECLARATION)
    header = "#include <math.h>\n#include <stdint.h>\n"
    ffi.set_source(module, header + source, extra_compile_args=list(FLAGS))
    with tempfile.TemporaryDirectory(prefix="granular-law-") as folder:
        try:
            path = ffi.compile(tmpdir=folder)
        except (cffi.VerificationError, OSError) as error:
            raise ValueError(f"the C source of the law {name!r} must compile: {error}") from error
        spec = util.spec_from_file_location(module, Path(path))
        assert spec is not None and spec.loader is not None
        loaded = util.module_from_spec(spec)
        spec.loader.exec_module(loaded)
    address = int(loaded.ffi.cast("intptr_t", loaded.ffi.addressof(loaded.lib, "update")))
    return _Function(address, loaded)


def _needed(package: str) -> Any:
    """Import a package of the extra "laws"."""
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error}: this needs {package}: pip install 'granular[laws]'"
        ) from error
