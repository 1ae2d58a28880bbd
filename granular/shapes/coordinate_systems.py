"""Units of a coordinate system, from its text: WKT (1, 2 or ESRI's) or the keywords of ARC/INFO."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

LENGTHS = {
    **dict.fromkeys(("m", "metre", "meter", "metres", "meters"), 1.0),
    **dict.fromkeys(("km", "kilometre", "kilometer", "kilometres", "kilometers"), 1e3),
    **dict.fromkeys(("dm", "decimetre", "decimeter", "decimetres", "decimeters"), 0.1),
    **dict.fromkeys(("cm", "centimetre", "centimeter", "centimetres", "centimeters"), 0.01),
    **dict.fromkeys(("mm", "millimetre", "millimeter", "millimetres", "millimeters"), 1e-3),
    **dict.fromkeys(("ft", "foot", "feet", "international foot", "foot (international)"), 0.3048),
    **dict.fromkeys(
        ("us-ft", "us_ft", "ftus", "us survey foot", "us survey feet", "foot_us", "survey foot"),
        1200 / 3937,
    ),
}
"""Metres in a unit of length, by its name in lower case."""

STRETCHED = (
    *("mercator", "equirectangular", "plate_carree", "equidistant_cylindrical"),
    *("cylindrical_equal_area", "sinusoidal", "mollweide"),
)
"""Projections of the whole world, whose lengths depend on the latitude or the direction."""
TRUE_AT_A_LINE = ("transverse", "oblique", "gauss")
"""Kinds of the Mercator projection that keep lengths near a line that is chosen."""

GEOGRAPHIC = ("GEOGCS", "GEOGCRS", "GEOGRAPHICCRS", "GEODCRS", "GEODETICCRS", "BASEGEOGCRS")
PROJECTED = ("PROJCS", "PROJCRS", "PROJECTEDCRS", "LOCAL_CS", "ENGCRS", "ENGINEERINGCRS")
VERTICAL = ("VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS")
TOKEN = re.compile(r'"(?:[^"]|"")*"|[^\s\[\](),"]+|[\[\](),]')


class UnclearUnits(ValueError):
    """A text that does not define its unit of length, which the user may know."""


@dataclass(frozen=True)
class Units:
    """Metres in a unit of the coordinates and of the heights; None where that is not specified."""

    horizontal: float | None = None
    vertical: float | None = None


@dataclass(frozen=True)
class _Node:
    """KEYWORD[value, value, ...], whose values are texts and further nodes."""

    keyword: str
    values: list[str | _Node] = field(default_factory=list)

    def nodes(self, *keywords: str) -> list[_Node]:
        return [v for v in self.values if isinstance(v, _Node) and v.keyword in keywords]

    def texts(self) -> list[str]:
        return [v for v in self.values if isinstance(v, str)]


def units_of(text: str) -> Units:
    """Read the units of a coordinate system.

    Raises
    ------
    UnclearUnits
        If the text is not understood, or its lengths depend on the latitude; with the reason.
    ValueError
        If its coordinates are no lengths, or its heights point down.
    """
    if re.match(r"\s*projection\s+\w+", text, re.IGNORECASE):
        return _of_keywords(text)
    nodes = _parsed(text)
    if not nodes:
        raise UnclearUnits(f"its coordinate system is not understood: {text[:60]!r}")
    horizontal = vertical = None
    for node in nodes:
        if node.keyword in VERTICAL:
            vertical = _of_heights(node)
        else:
            horizontal, heights = _of_places(node)
            vertical = heights if heights is not None else vertical
    return Units(horizontal, vertical)


def _parsed(text: str) -> list[_Node]:
    """Nodes of the outermost level; those of a compound or bound system in its place."""
    root = _Node("")
    stack, word = [root], ""
    for token in TOKEN.findall(text):
        if token in ("[", "("):
            stack.append(_Node(word.upper()))
            word = ""
        elif token in ("]", ")", ","):
            if word:
                stack[-1].values.append(word.strip('"'))
            word = ""
            if token != "," and len(stack) > 1:
                node = stack.pop()
                stack[-1].values.append(node)
        else:
            word = token
    nodes = [value for value in root.values if isinstance(value, _Node)]
    for wrapper in ("BOUNDCRS", "SOURCECRS", "COMPD_CS", "COMPOUNDCRS"):
        inner = [node for one in nodes if one.keyword == wrapper for node in one.values]
        others = [node for node in inner if isinstance(node, _Node) and node.values]
        known = (*GEOGRAPHIC, *PROJECTED, *VERTICAL, "GEOCCS", "SOURCECRS", "COMPD_CS")
        others = [node for node in others if node.keyword in (*known, "COMPOUNDCRS")]
        nodes = [node for node in nodes if node.keyword != wrapper] + others
    return nodes


def _of_places(node: _Node) -> tuple[float, float | None]:
    """Metres in a unit of the coordinates of a system, and of heights if these are among them."""
    name = node.texts()[0] if node.texts() else "?"
    if node.keyword in GEOGRAPHIC:
        raise ValueError(f"its coordinates are degrees ({name})")
    if node.keyword not in PROJECTED:
        raise ValueError(f"its coordinate system {name} ({node.keyword}) is no map")
    conversions = [c for part in node.nodes("CONVERSION") for c in part.nodes("METHOD")]
    for projection in (*node.nodes("PROJECTION"), *conversions):
        kind = "_".join(projection.texts()[:1]).lower().replace(" ", "_")
        if any(word in kind for word in STRETCHED) and not any(w in kind for w in TRUE_AT_A_LINE):
            raise UnclearUnits(
                f"its lengths depend on the latitude ({name}, by the projection "
                f"{projection.texts()[0]})"
            )
    axes = [unit for axis in node.nodes("AXIS") for unit in axis.nodes("LENGTHUNIT", "UNIT")]
    units = node.nodes("UNIT", "LENGTHUNIT") or axes
    if not units:
        raise UnclearUnits(f"its coordinate system {name} names no unit of length")
    height = None
    if len(node.nodes("AXIS")) == 3:
        vertical = node.nodes("AXIS")[2].nodes("LENGTHUNIT", "UNIT")
        height = _metres(vertical[0] if vertical else units[0])
    return _metres(units[0]), height


def _of_heights(node: _Node) -> float | None:
    """Metres in a unit of a vertical system."""
    down = any("DOWN" in map(str.upper, axis.texts()) for axis in node.nodes("AXIS"))
    down |= any(p.texts() == ["Direction", "-1.0"] for p in node.nodes("PARAMETER"))
    if down:
        raise ValueError("its heights are depths, which point down")
    axes = [unit for axis in node.nodes("AXIS") for unit in axis.nodes("LENGTHUNIT", "UNIT")]
    units = node.nodes("UNIT", "LENGTHUNIT") or axes
    return _metres(units[0]) if units else None


def _metres(unit: _Node) -> float:
    texts = unit.texts()
    try:
        metres = float(texts[1])
    except (IndexError, ValueError):
        metres = LENGTHS.get(texts[0].lower() if texts else "", 0.0)
    if not 0.0 < metres < float("inf"):
        raise UnclearUnits(f"its unit of length {', '.join(texts)} is not understood")
    return metres


def _of_keywords(text: str) -> Units:
    """Units in the form of ARC/INFO: lines of a keyword and its value."""
    pairs = (line.split(None, 1) for line in text.splitlines())
    entries = {pair[0].lower(): pair[1].strip().lower() for pair in pairs if len(pair) == 2}
    unit, heights = entries.get("units", ""), entries.get("zunits", "no")
    if entries["projection"].startswith("geographic") or unit in ("dd", "dms", "ds", "radians"):
        raise ValueError("its coordinates are degrees")
    for name in (unit, *([] if heights == "no" else [heights])):
        if name not in LENGTHS:
            raise UnclearUnits(f"its unit of length {name!r} is not understood")
    return Units(LENGTHS[unit], None if heights == "no" else LENGTHS[heights])
