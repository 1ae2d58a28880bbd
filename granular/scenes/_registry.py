"""The decorator of scene functions, and the functions that it has registered."""

from __future__ import annotations

import functools
import inspect
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from numbers import Integral, Real
from typing import Any, Literal, ParamSpec, Protocol, TypeVar, cast, overload

from granular import sph
from granular.materials import Material
from granular.mpm import scene as mpm
from granular.mpm import schemes
from granular.scenes._build import Parts, gravity_down
from granular.scenes._stiffness import stiff_enough
from granular.tools.checks import one_of
from granular.tools.docstrings import RAISES

METHODS: dict[str, type[mpm.Scene | sph.Scene]] = {"mpm": mpm.Scene, "sph": sph.Scene}
"""Classes of scenes by their method of solution."""

PARTS = ("duration", "material", "method", "numerics", "scheme", "seed")
"""Arguments that are not recorded as parameters, because the scene has a part of the same name."""

COMMON = (
    (
        "length, width, soil, headroom : float",
        "Length (x) and width (y) of the bed, its depth, and the height above it [m], whole cells\n"
        "    (`width/2` too if `half`).",
    ),
    ("start : float", "Initial position x of the edge [m]."),
    ("half : bool", "If true, only y >= 0 is modelled."),
    ("cell : float", "Cell size [m]."),
    ("spacing : float", "Spacing of the particles [m]."),
    ("points_per_cell, jitter", "See `granular.Fill`."),
    ("points_per_cell", "See `granular.Inflow`."),
    ("gravity, ramp : float", "Magnitude [m/s2], reached from zero within the time `ramp` [s]."),
    ("gravity : float", "Magnitude [m/s2], constant from the start."),
    ("duration : float", "Duration [s]."),
    (
        "material, scheme, seed",
        "See `Scene`. If neither a material nor E is given, E grows with the pressure\n"
        "    ``rho_c g H`` at the foot of the material: it is at least 1000 times as large, or as\n"
        "    many times as in the scene without arguments.",
    ),
    ("material, numerics", "By default as in the thesis."),
    ("numerics", "By default as in the thesis."),
    ("**material_numbers", "Numbers of the material to change, such as `nu`."),
)
"""Descriptions of the arguments that many scene functions have, as they stand in docstrings."""

P = ParamSpec("P")
S_co = TypeVar("S_co", bound="mpm.Scene | sph.Scene", covariant=True)


class SceneFunction(Protocol[P, S_co]):
    """Function that makes a ready scene.

    Attributes
    ----------
    methods : tuple of str
        Methods of solution of its scenes: "mpm", "sph" or both.
    """

    __name__: str
    methods: tuple[str, ...]

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> S_co: ...


functions: dict[str, SceneFunction[..., Any]] = {}
"""Registered functions by name, in the order of their definition."""


@overload
def scene_function(
    method: Literal["mpm"], /
) -> Callable[[Callable[P, Parts]], SceneFunction[P, mpm.Scene]]: ...
@overload
def scene_function(
    method: Literal["sph"], /
) -> Callable[[Callable[P, Parts]], SceneFunction[P, sph.Scene]]: ...
@overload
def scene_function(
    *methods: str,
) -> Callable[[Callable[P, Parts]], SceneFunction[P, mpm.Scene | sph.Scene]]: ...
def scene_function(*methods: str) -> Callable[[Callable[P, Parts]], SceneFunction[P, Any]]:
    """Register a scene function and complete it.

    The function takes keyword arguments only, all with a default. One of them is `material`, and
    the last is ``**material_numbers``. It returns the parts of the scene that it sets itself. The
    decorated function differs from it in six ways.

    - It returns a scene with the name of the function. Parts that the function does not return are
      its arguments of the same name (`PARTS`); its `gravity` is directed downwards and grows within
      the time `ramp`, if there is this argument. Where there are two methods, the argument `method`
      chooses the class of the scene.
    - Numbers of the material may be given as keywords: ``column_collapse(E=1e7)`` is
      ``column_collapse(material=m.replace(E=1e7))``, m being the material given or the default one.
      The function itself receives the changed material only, so that everything that it derives
      from the material follows. A keyword that is an argument of the function is never taken for a
      number of the material.
    - Unless E is given, or a material, it is as large as the load of the scene requires
      (`granular.scenes._stiffness`).
    - A function with the scheme `schemes.default` takes `schemes.suited_to` the material in its
      place, unless a scheme is given.
    - The arguments, defaults included, are added to the `parameters` of the scene, except `PARTS`
      and numbers of the material. Parameters that the function itself has set take precedence:
      it sets those that it derives or rounds, and `duration` if that of the scene is another.
    - In its docstring ``{common}`` stands for the descriptions of those arguments among `COMMON`
      that the docstring does not describe itself, and for `RAISES`.

    Parameters
    ----------
    *methods : {"mpm", "sph"}
        Methods of solution of the scenes that it makes.

    Raises
    ------
    TypeError, ValueError
        When the decorated function is called: for keywords that neither the function nor the
        material has, and for numbers of the material that the function itself sets.
    """
    for method in methods:
        one_of("method", method, METHODS)

    def decorate(function: Callable[P, Parts]) -> SceneFunction[P, Any]:
        signature = inspect.signature(function)
        defaults = keyword_defaults(signature)

        def make(**given: Any) -> Any:
            parts: Parts = function(**given)  # type: ignore[call-arg]
            arguments = defaults | given
            kind = METHODS[arguments.get("method", methods[0])]
            taken = {name: arguments[name] for name in PARTS if name in arguments}
            taken = {part.name: taken[part.name] for part in fields(kind) if part.name in taken}
            if taken.get("numerics", ...) is None:
                del taken["numerics"]
            whole = {"name": function.__name__} | taken | parts
            if "gravity" not in whole:
                ramp = arguments.get("ramp", 0.0)
                whole["gravity"] = gravity_down(whole["grid"].dim, arguments["gravity"], ramp)
            return kind(**whole)

        @functools.wraps(function)
        def made_with(**keywords: Any) -> Any:
            given = {name: value for name, value in keywords.items() if name in defaults}
            numbers = {name: value for name, value in keywords.items() if name not in defaults}
            if numbers:
                material = given.get("material", defaults["material"])
                given["material"] = _changed(function.__name__, material, numbers, tuple(defaults))
            if defaults.get("scheme") is schemes.default and "scheme" not in given:
                given["scheme"] = suited(defaults | given)
            scene = make(**given)
            if "material" not in keywords and "E" not in numbers:
                material = given.get("material", defaults["material"])
                if stiffer := stiff_enough(make, scene, material):
                    given["material"] = stiffer
                    scene = make(**given)
            if numbers:
                _check_unchanged(function.__name__, given["material"], scene.material, numbers)
            arguments = {
                name: _plain(value)
                for name, value in (defaults | given).items()
                if name not in PARTS
            }
            return scene.replace(parameters=arguments | dict(scene.parameters))

        registered = cast("SceneFunction[P, Any]", made_with)
        registered.methods = methods
        registered.__doc__ = _completed(inspect.getdoc(function) or "", signature)
        kinds = " | ".join("Scene" if name == "mpm" else f"{name}.Scene" for name in methods)
        made_with.__signature__ = signature.replace(return_annotation=kinds)  # type: ignore[attr-defined]
        functions[function.__name__] = registered
        return registered

    return decorate


def suited(arguments: Mapping[str, Any]) -> schemes.Scheme:
    """Scheme that suits the material of a scene function, and its cells if it has them."""
    cell = arguments.get("cell")
    known = cell if isinstance(cell, Real) else 0.0
    return schemes.suited_to(arguments["material"], cell=float(known))


def _completed(doc: str, signature: inspect.Signature) -> str:
    """Replace ``{common}`` in the docstring of a scene function."""
    heads = re.findall(r"^\**([\w, ]+?)(?: :.*)?\n    ", doc, re.MULTILINE)
    parameters = signature.parameters
    described, lines = set(", ".join(heads).split(", ")), []
    for head, text in COMMON:
        names = set(head.partition(" :")[0].removeprefix("**").split(", "))
        if names <= set(parameters) - described:
            if (
                "points_per_cell" in names
                and signature.parameters["points_per_cell"].default is None
            ):
                text = f"{text.removesuffix('.')}; by default 2 along an edge of a cell."
            lines += [head, f"    {text}"]
            described |= names
    return doc.replace("{common}", "\n".join([*lines, RAISES]))


def keyword_defaults(signature: inspect.Signature) -> dict[str, Any]:
    """Keywords of a scene function with their defaults, without numbers of the material."""
    kind = inspect.Parameter.KEYWORD_ONLY
    return {name: p.default for name, p in signature.parameters.items() if p.kind is kind}


def material_numbers(material: object) -> tuple[str, ...]:
    """Names of the numbers of a material.

    Raises
    ------
    TypeError
        If it is not a material.
    """
    if not isinstance(material, Material | sph.Viscoplastic):
        raise TypeError(f"material = {material!r} must be a Material or a Viscoplastic")
    return tuple(field.name for field in fields(material))


def _changed(
    name: str, material: Any, numbers: Mapping[str, Any], keywords: tuple[str, ...]
) -> Material | sph.Viscoplastic:
    """Material with some numbers changed."""
    known = material_numbers(material)
    for keyword in numbers:
        if keyword not in known:
            free = (number for number in known if number not in keywords)
            raise TypeError(
                f"{name}() has no keyword {keyword!r}: its own are {', '.join(keywords)}; those of "
                f"its material, {type(material).__name__}, are {', '.join(free)}"
            )
    return material.replace(**numbers)


def _check_unchanged(name: str, changed: object, used: object, numbers: Mapping[str, Any]) -> None:
    """Refuse numbers of the material that the scene function itself sets."""
    if type(used) is not type(changed):
        return  # the material of the other method, made from the changed one
    for number, value in numbers.items():
        if (chosen := getattr(used, number)) != getattr(changed, number):
            raise ValueError(
                f"{number} = {value} must not be given: {name} sets it, here to {chosen}"
            )


def _plain(value: Any) -> Any:
    """Numbers of other types, such as fractions, as floats, and paths as strings."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return float(value) if isinstance(value, Real) and not isinstance(value, Integral) else value
