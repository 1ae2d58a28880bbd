"""Scenes as files: TOML with the numbers of a scene function, or JSON with a whole scene."""

from __future__ import annotations

import inspect
import json
import math
import textwrap
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, cast

from granular import materials
from granular.materials import Material
from granular.model.fill import Fill
from granular.model.scene import BaseScene
from granular.model.typing import AnyScene
from granular.mpm import schemes
from granular.mpm.scene import Scene
from granular.mpm.schemes import CellAveragedDensity, ParticleDensity, Scheme, SmoothedDensity
from granular.scenes._registry import functions, keyword_defaults, suited
from granular.scenes.incline import incline
from granular.sph.gas import Gas
from granular.tools.checks import one_of
from granular.tools.docstrings import described
from granular.tools.files import read_text

SUFFIXES = (".toml", ".json")
"""Suffixes of scene files."""
SECTIONS = ("scene", "arguments", "material", "scheme", "run")
"""Keys of a TOML file of a scene."""
RUN = {
    "until": "Time at which the run stops [s]; by default the duration of the scene.",
    "every": "Time between frames [s].",
    "fields": 'Quantities that frames hold too, as ParaView shows them: ["pressure", "speed"].',
    "precision": 'Precision of frames, "double" or "single", which takes less space.',
    "threads": "Number of threads; by default as many as speed up the run.",
}
"""Keys of the section "run", and what they mean."""
PARTS = ("material", "scheme", "numerics", "method", "release")
"""Arguments of scene functions that have a separate section, or can be given in Python only."""
DENSITIES = {kind.name: kind for kind in (SmoothedDensity, CellAveragedDensity, ParticleDensity)}
EXPLAINED = (Fill, Scene, Gas, incline)
"""Pages to which docstrings of scene functions refer."""
WIDTH = 100


@dataclass(frozen=True)
class SceneFile:
    """A scene that was read from a file, and how it is to be run.

    Attributes
    ----------
    scene : Scene or sph.Scene
    run : dict
        Values of `until`, `every`, `fields`, `precision` and `threads` that the file has.
    """

    scene: AnyScene
    run: Mapping[str, Any] = field(default_factory=dict)


def read_scene(path: str | Path, **numbers: Any) -> SceneFile:
    """Read a scene from a file.

    A TOML file names a scene function and gives its arguments (`granular new` writes one with all
    of them). A JSON file is what `Scene.to_json` returns.

    Parameters
    ----------
    path : path
        Its name ends in ".toml" or ".json".
    **numbers
        Arguments of the scene function and numbers of its material that replace those of a TOML
        file.

    Raises
    ------
    OSError
        If the file cannot be read.
    TypeError, ValueError
        If the file is not valid; the message names the file and the error.
    """
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise ValueError(f"path = {str(path)!r} must end in one of {', '.join(SUFFIXES)}")
    text = read_text(path)
    try:
        if path.suffix == ".json":
            if numbers:
                raise TypeError(f"{', '.join(numbers)} must be given in a TOML file")
            return SceneFile(cast("AnyScene", BaseScene.from_json(text)))
        return _from_tables(tomllib.loads(text), numbers)
    except TypeError as error:
        raise TypeError(f"{path}: {error}") from error
    except ValueError as error:  # including text that is not TOML
        raise ValueError(f"{path}: {error}") from error


def function_of(path: str | Path) -> Callable[..., AnyScene] | None:
    """Scene function that a TOML file names; None if there is none, which `read_scene` reports."""
    try:
        return functions.get(tomllib.loads(read_text(path))["scene"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _from_tables(tables: Mapping[str, Any], numbers: Mapping[str, Any]) -> SceneFile:
    """Make the scene that a TOML file describes, with some other numbers."""
    _known("the file", tables, SECTIONS)
    if "scene" not in tables:
        raise ValueError('scene = "..." must name a scene, see `granular list`')
    function = functions[one_of("scene", tables["scene"], tuple(functions))]
    sections = {name: tables.get(name, {}) for name in SECTIONS[1:]}
    for name, section in sections.items():
        if not isinstance(section, dict):
            raise TypeError(f"{name} = {section!r} must be a table, [{name}]")
    _known("[run]", sections["run"], tuple(RUN))
    defaults = keyword_defaults(inspect.signature(function))
    for name, value in numbers.items():
        place = "arguments" if name in defaults else "material"
        sections[place] = sections[place] | {name: value}
    _known("[arguments]", sections["arguments"], [name for name in defaults if name not in PARTS])
    given = {name: _plain(value) for name, value in sections["arguments"].items()}
    given |= _material(defaults["material"], sections["material"])
    if sections["scheme"]:
        if "scheme" not in defaults:
            raise ValueError(f"[scheme] must not be given: {function.__name__} has no scheme")
        base = defaults["scheme"]
        if base is schemes.default:
            base = suited(defaults | given)
        given["scheme"] = _scheme(base, sections["scheme"])
    return SceneFile(function(**given), sections["run"])


def _known(where: str, given: Mapping[str, Any], names: Sequence[str]) -> None:
    for name in given:
        if name not in names:
            raise ValueError(f"{where} has {name!r}, must be one of {', '.join(names)}")


def _plain(value: Any) -> Any:
    """Lists as tuples."""
    return tuple(_plain(part) for part in value) if isinstance(value, list) else value


def _material(default: Any, numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Keywords for the material: numbers of the scene's material, or another one with its law."""
    rest = dict(numbers)
    law = rest.pop("law", None)
    if law is None:
        _known("[material]", rest, ["law", *(part.name for part in fields(default))])
        return rest
    kinds = (kind for kind in vars(materials).values() if isinstance(kind, type))
    laws = {k.__name__: k for k in kinds if issubclass(k, Material) and k is not Material}
    kind = laws[one_of("law", law, tuple(laws))]
    _known("[material]", rest, [part.name for part in fields(kind)])
    return {"material": kind(**rest)}


def _scheme(default: Scheme, numbers: Mapping[str, Any]) -> Scheme:
    """Scheme of the file, given as changes to the scheme of the scene."""
    rest = {name: value for name, value in numbers.items() if not isinstance(value, dict)}
    parts = {name: value for name, value in numbers.items() if isinstance(value, dict)}
    _known("[scheme]", numbers, [part.name for part in fields(Scheme)])
    if "density" in parts:
        kind = type(default.density)
        if "name" in parts["density"]:
            kind = DENSITIES[one_of("name", parts["density"].pop("name"), tuple(DENSITIES))]
        _known("[scheme.density]", parts["density"], [part.name for part in fields(kind)])
        rest["density"] = kind(**parts["density"])
    if "fluidity" in parts:
        names = [part.name for part in fields(default.fluidity)]
        _known("[scheme.fluidity]", parts["fluidity"], names)
        rest["fluidity"] = default.fluidity.replace(**parts["fluidity"])
    return default.replace(**rest)


def changed(scene: AnyScene, assignments: Sequence[str]) -> AnyScene:
    """Return a scene with some of its numbers changed, wherever they are.

    Parameters
    ----------
    scene : Scene or sph.Scene
    assignments : sequence of str
        Each ``key=value``, with the key in the JSON of the scene, its parts joined by dots and
        counted from 0 in lists, such as ``scheme.cfl=0.3`` or ``bodies.0.friction=0.4``; the value
        as in TOML.

    Raises
    ------
    ValueError
        If a key or value is not valid; the message names it.
    """
    if not assignments:
        return scene
    data = json.loads(scene.to_json())
    for assignment in assignments:
        place, equals, text = assignment.partition("=")
        if not equals:
            raise ValueError(f"{assignment!r} must be KEY=VALUE, such as scheme.cfl=0.3")
        *way, last = place.strip().split(".")
        part: Any = data["scene"]
        for name in way:
            part = part[_key(place, part, name)]
        part[_key(place, part, last)] = _value(text.strip())
    return type(scene).from_json(json.dumps(data))


def _key(place: str, part: Any, name: str) -> str | int:
    """Key of a part of a scene, in a dictionary or a list."""
    if isinstance(part, list):
        if not name.isdecimal() or int(name) >= len(part):
            raise ValueError(f"{place}: {name!r} must be a number from 0 to {len(part) - 1}")
        return int(name)
    known = [key for key in part if key != "type"] if isinstance(part, dict) else []
    if name not in known:
        raise ValueError(f"{place}: {name!r} must be one of {', '.join(known) or 'nothing'}")
    return name


def _value(text: str) -> Any:
    """Value of an assignment; text that is not TOML is a number as Python writes it, or a word."""
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        try:
            value = float(text)
        except ValueError:
            return text
    if isinstance(value, float) and math.isinf(value):
        return {"type": "float", "value": str(value)}
    return value


# ---- the file that a user fills in ----


def template(name: str) -> str:
    """Return a TOML file of a scene, with all numbers, their defaults, and what they mean.

    Parameters
    ----------
    name : str
        Name of the scene function.

    Raises
    ------
    TypeError, ValueError
        If there is no such scene.
    """
    function = functions[one_of("name", name, tuple(functions))]
    summary = (inspect.getdoc(function) or "").partition("\n\n")[0]
    defaults = keyword_defaults(inspect.signature(function))
    lines = [*_comment(summary), "#", f"# granular run {name}.toml", ""]
    lines += [f'scene = "{name}"', "", "[arguments]"]
    arguments = {key: value for key, value in defaults.items() if key not in PARTS}
    of_scene, of_material = explanations(function)
    lines += _entries(arguments, of_scene)
    material = defaults["material"]
    kind = type(material)
    lines += ["", "[material]"]
    lines += _comment(
        f'Another law is chosen by law = "...", with all of its numbers; here '
        f"{kind.__name__}, {_first_line(kind)}"
    )
    lines += _entries(_numbers(material, defaults, function().material), of_material)
    scheme = defaults.get("scheme")
    if scheme is not None:
        lines += ["", "[scheme]"]
        lines += _entries(_field_values(scheme), described(Scheme), active=False)
        lines += ["", "[scheme.density]"]
        lines += _comment(_first_line(type(scheme.density)))
        density = _field_values(scheme.density)
        lines += _entries(density, described(type(scheme.density)), active=False)
    lines += ["", "[run]", *_entries(dict.fromkeys(RUN), RUN)]
    return "\n".join(lines) + "\n"


def explanations(function: Callable[..., Any]) -> tuple[dict[str, str], dict[str, str]]:
    """Descriptions of the keywords of a scene function, and of those of its material."""
    material = inspect.signature(function).parameters["material"].default
    return described(function, *EXPLAINED), described(type(material))


def _numbers(material: Any, defaults: Mapping[str, Any], used: object) -> dict[str, Any]:
    """Numbers of a material; None for those that follow from others or that the scene sets."""
    given = material.arguments() if isinstance(material, Material) else vars(material)
    names = [part.name for part in fields(material) if part.name not in defaults]
    is_other = type(used) is not type(
        material
    )  # the material of another method is made from this one
    return {
        name: given.get(name)
        if is_other or getattr(used, name) == getattr(material, name)
        else None
        for name in names
    }


def _first_line(documented: object) -> str:
    return (inspect.getdoc(documented) or "").partition("\n")[0]


def _field_values(part: Any) -> dict[str, Any]:
    """Values of the fields of a scheme or density, without parts of it."""
    values = {entry.name: getattr(part, entry.name) for entry in fields(part)}
    return {
        key: value
        for key, value in values.items()
        if not hasattr(value, "replace") or isinstance(value, str)
    }


def _entries(
    values: Mapping[str, Any], texts: Mapping[str, str], *, active: bool = True
) -> Iterator[str]:
    """Lines of a section; an entry without a default, or not `active`, is commented out.

    Entries that share a text stand together below it.
    """
    before = None
    for name, value in values.items():
        text = texts.get(name, "")
        if not text or text != before:
            yield ""
            yield from _comment(text)
        before = text
        written = _written(value)
        mark = "" if active and written else "# "
        yield f"{mark}{name} = {written or '...'}"


def _comment(text: str) -> list[str]:
    return [f"# {line}" for line in textwrap.wrap(" ".join(text.split()), WIDTH - 2)]


def _written(value: Any) -> str:
    """Value as TOML writes it; empty for None and values that TOML cannot write."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, tuple | list):
        return f"[{', '.join(map(_written, value))}]"
    return ""
