"""Numbers of schemes, as the core declares them: defaults, ranges, units and meanings.

The stub next to this file tells type checkers and editors of them. Its lines are those of `stub`,
which a test compares.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field, make_dataclass
from inspect import cleandoc
from textwrap import fill
from typing import Any, ClassVar

from granular import _core
from granular.tools.checks import check_fields, in_range, integer
from granular.tools.description import Description

_NUMBERS = _core.scheme_numbers()
_CLASSES = {
    "particle": "ParticleNumbers",
    "smoothed": "SmoothedNumbers",
    "cell_averaged": "CellAveragedNumbers",
    "fluidity": "FluidityNumbers",
    "scheme": "SchemeNumbers",
}
"""Names of the classes of the groups of numbers."""
_SET_ONCE_MADE = ("tpic_decay",)
"""Numbers without a default that a scheme always has, from its density."""


def _kind(default: float | None, allowed: str) -> str:
    """Type of a number that is declared."""
    return "int" if allowed.startswith("integer") else "float"


def _check(name: str, value: Any, default: float | None, allowed: str) -> Any:
    """Check that a number lies in its declared range, such as "[0, 1)" or "integer [1, 5]"."""
    if value is None and default is None:
        return None
    low, high = (float(end) for end in allowed.removeprefix("integer ")[1:-1].split(","))
    if allowed.startswith("integer"):
        return integer(name, value, int(low), int(high))
    ends = {"open_low": "(" in allowed, "open_high": ")" in allowed}
    return in_range(name, value, low, high, **ends)


def _documented(doc: str, group: str) -> str:
    """Insert the parameters of a group into a docstring in place of ``{numbers}``."""
    lines = []
    for name, default, allowed, unit, text in _NUMBERS[group]:
        kind = "int" if allowed.startswith("integer") else "float"
        optional = " or None" if default is None else f", default {default:g}"
        lines.append(f"{name} : {kind}{optional}")
        text = f"{text} Range: {allowed}{'' if unit == '1' else ' ' + unit}."
        lines.append(fill(text, 96, initial_indent=" " * 4, subsequent_indent=" " * 4))
    return cleandoc(doc).replace("{numbers}", "\n".join(lines))


class Numbers(Description):
    """Base class of the classes made from declared numbers."""

    units: ClassVar[Mapping[str, str]]
    """Units of the declared numbers by name."""
    _group: ClassVar[str]

    def __init_subclass__(cls, **_: Any) -> None:
        if cls.__doc__ and "{numbers}" in cls.__doc__:
            cls.__doc__ = _documented(cls.__doc__, cls._group)

    def __post_init__(self) -> None:
        for name, default, allowed, _, _ in _NUMBERS[self._group]:
            check_fields(self, _check, name, default=default, allowed=allowed)

    def numbers(self) -> dict[str, Any]:
        """Return the declared numbers by name."""
        return {name: getattr(self, name) for name in self.units}


def _declared(group: str, name: str) -> Any:
    """Make a frozen dataclass of the numbers that the core declares for a group."""
    members = []
    for number, default, allowed, _, _ in _NUMBERS[group]:
        value = int(default) if _kind(default, allowed) == "int" else default
        members.append((number, _kind(default, allowed), field(default=value)))
    units = {number: unit for number, _, _, unit, _ in _NUMBERS[group]}
    space = {"_group": group, "units": units, "__module__": __name__}
    return make_dataclass(
        name, members, bases=(Numbers,), namespace=space, frozen=True, kw_only=True
    )


ParticleNumbers, SmoothedNumbers, CellAveragedNumbers, FluidityNumbers, SchemeNumbers = (
    _declared(group, name) for group, name in _CLASSES.items()
)


def stub() -> Iterator[str]:
    """Lines of the stub."""
    yield "# Made by granular.mpm.scheme_numbers.stub"
    yield "from collections.abc import Mapping"
    yield "from dataclasses import dataclass"
    yield "from typing import Any, ClassVar, Self"
    yield ""
    yield "class Numbers:"
    yield "    units: ClassVar[Mapping[str, str]]"
    yield "    def __post_init__(self) -> None: ..."
    yield "    def replace(self, **changes: Any) -> Self: ..."
    yield "    def numbers(self) -> dict[str, Any]: ..."
    for group, name in _CLASSES.items():
        yield ""
        yield "@dataclass(frozen=True, kw_only=True)"
        yield f"class {name}(Numbers):"
        for number, default, allowed, _, _ in _NUMBERS[group]:
            optional = " | None" if default is None and number not in _SET_ONCE_MADE else ""
            yield f"    {number}: {_kind(default, allowed)}{optional} = ..."
