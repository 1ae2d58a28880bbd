"""User-defined constitutive laws, in NumPy, compiled by numba, or in C.

The core calls the function of such a law with arrays of some hundred points after the elastic
predictor; see csrc/law/own.inl. Functions are identified by the digest of their source, which
records store.
"""

from __future__ import annotations

import difflib
import hashlib
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from granular.materials.base import Material
from granular.materials.law_functions import (
    MOST_HISTORY,
    MOST_NUMBERS,
    LawFunction,
    from_c,
    from_python,
)
from granular.materials.law_identity import frozen
from granular.tools.checks import check_fields, finite, in_range, kinds_of, one_of, truth
from granular.tools.serializable import Ordered, Serializable
from granular.tools.shown_code import MARK, escaped, marked

LANGUAGES = ("numpy", "numba", "c")
MOST_SHOWN = 4000
"""Characters of a source, and lines of a difference of two, that an error shows."""
MOST_LINES = 12

_FUNCTIONS: dict[str, LawFunction] = {}
"""Functions by the digest of their law; they live as long as the process, as engines use them."""
_SOURCES: dict[tuple[str, str], str] = {}
"""The last source of each language and name that `from_function` was given."""
_TRUSTED: set[str] = set()
"""Digests of the laws in C that the user has given to `from_function` or `trust_code`."""


@dataclass(frozen=True, kw_only=True)
class OwnLaw(Material):
    """Material with a user-defined law; `granular.materials.from_function` makes one.

    Parameters
    ----------
    E, nu, rho_c : float
        See `Material`. They give the elastic predictor and the time step.
    elasticity : {"hypoelastic"}
        The predictor uses the Jaumann rate.
    restitution : float
        Must be 1: elastic damping needs the plastic strain rate, which is not known.
    contact_diameter : float, optional
        Not used.
    name : str
        Name of the law.
    language : {"numpy", "numba", "c"}
        How the source is run.
    source : str
        Source of the function. Runs are resumed with the same source only. C code runs only if it
        was given to `from_function` or allowed by `trust_code`.
    parameters : mapping of str to float
        Numbers that are passed to the function after K and G, in this order; 30 at most.
    history : mapping of str to float
        State variables of every point, with their initial values; 4 at most.
    bears_tension : bool
        True for a material that is never disconnected, such as a solid.
    separation : float
        Logarithm of rho/rho_c below which the law bears no stress, from -1 to 1; 0 for one whose
        densest stress-free state has the density rho_c. The density corrections leave out the
        points that are less dense by more than the `separation_strain` of the scheme, so that a law
        with stress at these densities, such as one that dilates, needs a lower value. Must be 0 if
        it bears tension.
    axisymmetric : bool
        True if the law may run on axisymmetric grids: what it computes from `gradient` contains
        the hoop strain ``gradient[2, 2]``.
    {raises}.
    """

    name: str
    language: str
    source: str
    parameters: Mapping[str, float] = field(default_factory=Ordered)
    history: Mapping[str, float] = field(default_factory=Ordered)
    bears_tension: bool = False
    separation: float = 0.0
    axisymmetric: bool = False

    flow = "own"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.restitution != 1.0:
            raise ValueError(
                f"restitution = {self.restitution} must be 1 with a user-defined law, whose "
                "plastic strain rate is not known"
            )
        if self.elasticity != "hypoelastic":
            raise ValueError(f'elasticity = {self.elasticity!r} must be "hypoelastic" here')
        kinds_of(self, name=str, source=str, parameters=Mapping, history=Mapping)
        one_of("language", self.language, LANGUAGES)
        check_fields(self, in_range, "separation", low=-1.0, high=1.0)
        truth("axisymmetric", self.axisymmetric)
        if truth("bears_tension", self.bears_tension) and self.separation:
            raise ValueError(
                f"separation = {self.separation} must be 0 with bears_tension = True: such a "
                "material is never disconnected"
            )
        for name, most in (("parameters", MOST_NUMBERS), ("history", MOST_HISTORY)):
            given = {key: finite(f"{name}[{key!r}]", v) for key, v in getattr(self, name).items()}
            if len(given) > most:
                raise ValueError(f"{name} = {given} must be {most} numbers at most")
            object.__setattr__(self, name, Ordered(given))

    @property
    def granular(self) -> bool:  # type: ignore[override]  # else of the class
        """True if the material separates in tension."""
        return not self.bears_tension

    @cached_property
    def digest(self) -> str:
        """Digest of the source of the law, which identifies it in records."""
        text = f"{self.language}\n{self.source}".encode()
        return hashlib.blake2b(text, digest_size=16).hexdigest()

    def numbers(self) -> tuple[float, ...]:
        """K, G and the parameters, as they are passed to the function."""
        return (self.K, self.G, *self.parameters.values())

    def function(self) -> LawFunction:
        """Return the function that the core calls.

        Raises
        ------
        ValueError
            If the law was made in another process from a Python function that this one does not
            know, if it is in C and came with a file, or if C source does not compile.
        """
        if self.digest not in _FUNCTIONS:
            if self.language != "c":
                raise ValueError(
                    f"the law {self.name!r} with the source digest {self.digest} is not known in "
                    "this process: call granular.materials.from_function with the same function "
                    f"first{self._difference()}"
                )
            if self.digest not in _TRUSTED:
                raise ValueError(
                    f"the law {self.name!r} is C code that came with a file or a scene. It can do "
                    "whatever you can do, and does not run unless you allow it: read it, and then "
                    "call granular.materials.trust_code(scene), resume with trust_code=True, or "
                    f"give the command --trust-code. {_excerpt(self.source)}"
                )
            _FUNCTIONS[self.digest] = from_c(self.name, self.source)
        return _FUNCTIONS[self.digest]

    def _difference(self) -> str:
        """Text of the differences from the source of a known law of this name."""
        known = _SOURCES.get((self.language, self.name))
        if known is None:
            return ""
        return f"; it differs from the one known here (-) in{difference(known, self.source)}"

    def __getstate__(self) -> tuple[dict[str, Any], bool]:
        """State of a copy, or for another process of a sweep, where the law is trusted as here."""
        return self.__dict__, self.digest in _TRUSTED

    def __setstate__(self, state: tuple[dict[str, Any], bool]) -> None:
        self.__dict__.update(state[0])
        if state[1]:
            _TRUSTED.add(self.digest)


def difference(source: str, other: str) -> str:
    """Lines in which two sources differ, each on a separate line."""
    lines = difflib.unified_diff(source.splitlines(), other.splitlines(), n=0, lineterm="")
    changes = [line for line in [*lines][2:] if not line.startswith("@@")]
    more = ["..."] if len(changes) > MOST_LINES else []
    return "".join(f"\n{escaped(line)}" for line in changes[:MOST_LINES] + more)


def _excerpt(source: str) -> str:
    """Text of a source, or its beginning and how to see all of it."""
    size = len(source)
    if size <= MOST_SHOWN:
        return f"It is:\n{marked(source)}"
    return (
        f"It has {size} characters, too many to show here. Read all of it: "
        "print(granular.materials.code_of(scene)), where the scene is that of "
        "granular.open(path).scene or granular.scenes.read_scene(path).scene. Only the first "
        f"{MOST_SHOWN} are:\n{marked(source[:MOST_SHOWN])}\n"
        f"{MARK}[cut here: {size - MOST_SHOWN} characters more are not shown]"
    )


def code_of(scene: Any) -> str:
    """Return the code in C of the laws of a scene, to be read before `trust_code`.

    Control characters and other invisible ones are replaced by their codes, and each line of code
    has a mark before it.

    Parameters
    ----------
    scene : Scene
        A scene from a file or a record, such as ``gr.open(path).scene``; or a material.

    Returns
    -------
    str
        Empty if it has no such law.

    Raises
    ------
    TypeError
        If it is neither.
    """
    return "\n".join(f"law {law.name!r}:\n{marked(law.source)}" for law in _in_c(scene))


def trust_code(scene: Any) -> None:
    """Allow the code in C that came with a scene to run in this process.

    Such code is a part of scenes with a law that was made by `from_function` from source in C. It
    has all your permissions: read it first, as `code_of` returns it.

    Parameters
    ----------
    scene : Scene
        A scene from a file or a record, such as ``gr.open(path).scene``; or a material.

    Raises
    ------
    TypeError
        If it is neither.
    """
    _TRUSTED.update(law.digest for law in _in_c(scene))


def _in_c(scene: Any) -> list[OwnLaw]:
    """Laws in C of a scene or a material."""
    if not isinstance(scene, (Serializable, Material)):
        raise TypeError(f"scene = {scene!r} must be a scene or a material")
    materials = getattr(scene, "materials", (scene,))
    return [law for law in materials if isinstance(law, OwnLaw) and law.language == "c"]


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
    separation: float = 0.0,
    axisymmetric: bool = False,
) -> OwnLaw:
    """Make a material with a user-defined constitutive law.

    Parameters
    ----------
    update : callable or str
        ``update(dt, parameters, gradient, log_density, stress, shear_rate, history)``, which
        changes the last three in place for n points at once, or the source of a C function `update`
        (see Notes). The arrays are

        - `dt`: time step [s];
        - `parameters` (32,): K and G [Pa], the numbers given here, in their order, then zeros;
        - `gradient` (3, 3, n): increment L dt of the velocity gradient. In a plane the third row
          and column are 0, but for the hoop strain v_r dt/r in ``[2, 2]`` on an axisymmetric grid;
        - `log_density` (n,): ln(rho/rho_c) at the end of the step;
        - `stress` (4 or 6, n): xx, yy, zz, xy (and yz, xz) [Pa, tension positive], on entry the
          trial stress of the elastic predictor, on return the stress at the end of the step;
        - `shear_rate` (n,): 0 on entry, the plastic shear rate [1/s] on return;
        - `history` (4, n): the state variables of a point, in the order given here.
    parameters : mapping of str to float, optional
        Numbers of the law, 30 at most.
    history : mapping of str to float, optional
        State variables of every point, 4 at most, and their values at the start. A state has them
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
    separation : float
        Logarithm of rho/rho_c below which the law bears no stress, from -1 to 1: of a law with
        p = K max(log_density - a, 0) it is a. See `OwnLaw`.
    axisymmetric : bool
        True if the law may run on axisymmetric grids, where what it computes from `gradient` must
        contain the hoop strain. A law that only reduces the trial stress may.

    Raises
    ------
    TypeError, ValueError
        For wrong arguments, a function whose source cannot be read, that has default values or uses
        variables of an enclosing function, a method, one that reads what cannot be a part of the
        law (see Notes), and C source that does not compile, has variables that last from call to
        call, or includes other than headers of the language.
    ModuleNotFoundError
        Without numba, if it is to compile: ``pip install 'granular-flow[laws]'``.

    Notes
    -----
    The points include disconnected ones: stress-free points with a log_density below 0. The
    function determines the pressure and the separation of the material, and `separation` passes the
    latter to the scheme. The laws of the package use ``p = K log_density`` where log_density >= 0,
    and no stress elsewhere.

    The points also include spare slots. Their numbers are finite, and their results are not used. A
    function must treat each point independently, or the result depends on the number of threads.

    The law is the function with everything that it reads: numbers, strings, arrays, and tuples,
    lists and dictionaries of them; your own functions, for which the same holds; and, by name and
    version, objects of installed packages. It runs as a copy with copies of these values: later
    changes of them have no effect, and a function with other values is another law.

    An exception in the function ends the run and is raised there. The function is then called a
    second time with the same points, in case the exception came from elsewhere.

    The C function is ``void update(int64_t n, int64_t dim, double dt, const double *parameters,
    const double *gradient, const double *log_density, double *stress, double *shear_rate, double
    *history)``; component c of an array begins at c n, and that of `gradient` in row i and column j
    at (3 i + j) n.
    """
    kinds = {None: "numpy", "numba": "numba"}
    function: Any = None
    if isinstance(update, str):
        if compiler is not None:
            raise ValueError(f"compiler = {compiler!r} must be None for C source")
        language, source, called = "c", textwrap.dedent(update), name or "update"
    else:
        if not callable(update):
            raise TypeError(f"update = {update!r} must be a function or the source of one in C")
        language = kinds[one_of("compiler", compiler, tuple(kinds))]
        source, function = frozen(update)
        called = name or function.__name__
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
        separation=separation,
        axisymmetric=axisymmetric,
    )
    _SOURCES[language, called] = source
    if language == "c":
        trust_code(law)
        law.function()
    elif law.digest not in _FUNCTIONS:
        _FUNCTIONS[law.digest] = from_python(function, language)
    return law
