"""Scenes and their parts as JSON, without rounding."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from importlib import import_module
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from granular.tools.checks import integer, one_of
from granular.tools.description import Description

FORMAT = 1
"""Version of the JSON format; older versions are read, newer ones refused."""

ARRAYS = ("<f8", "<f4", "<i4", "|b1")
"""Types of the arrays in the JSON."""
MOST_BYTES = 2**34
"""Largest size of an array in the JSON."""

Value = bool | int | float | str | None | tuple["Value", ...]


class Parameters(Mapping[str, Any]):
    """An immutable, hashable mapping of plain values: the arguments of a scene function.

    Raises
    ------
    TypeError
        For keys that are not strings, and values that are not numbers, strings, booleans, None,
        or tuples of them.
    ValueError
        For NaN.
    """

    __slots__ = ("_items",)

    def __init__(self, items: Mapping[str, Any] | Sequence[tuple[str, Any]] = ()) -> None:
        self._items = tuple((key, self._plain(key, value)) for key, value in dict(items).items())

    @classmethod
    def _plain(cls, key: object, value: Any) -> Value:
        if not isinstance(key, str):
            raise TypeError(f"parameters: the name {key!r} must be a string")
        if isinstance(value, np.generic):
            value = value.item()
        if isinstance(value, (tuple, list)):
            return tuple(cls._plain(key, entry) for entry in value)
        if isinstance(value, float) and math.isnan(value):
            raise ValueError(f"parameters: {key} = nan must be a number")
        if value is not None and not isinstance(value, (bool, int, float, str)):
            raise TypeError(f"parameters: {key} = {value!r} must be a plain value")
        return value

    def __getitem__(self, key: str) -> Any:
        for name, value in self._items:
            if name == key:
                return value
        raise KeyError(key)

    def __iter__(self) -> Iterator[str]:
        return (name for name, _ in self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __hash__(self) -> int:
        return hash(frozenset(self._items))

    def __repr__(self) -> str:
        return repr(dict(self._items))


class Ordered(Parameters):
    """Parameters that are read by position: equal only if their order is, too."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mapping):
            return NotImplemented
        return [*self.items()] == [*other.items()]

    def __hash__(self) -> int:
        return hash(self._items)


class Serializable(Description):
    """A scene that can be written as JSON: a frozen dataclass of registered parts."""

    def to_json(self) -> str:
        """Return the scene as ASCII JSON, from which `from_json` makes an equal one.

        Floats keep all their bits.

        Raises
        ------
        TypeError
            For a region or material of a class that is not registered. For a user-defined region
            use `Mask.of(region.contains, ...)`.
        """
        return json.dumps({"format": FORMAT, "scene": _encode(self)}, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Make a scene from the JSON that `to_json` returned.

        Raises
        ------
        ValueError
            If the text is not a scene, a part of it is out of range, or its format is newer.
        """
        try:
            data = json.loads(text, parse_constant=_refuse_constant)
            if not isinstance(data, dict) or set(data) != {"format", "scene"}:
                raise ValueError("must hold format and scene")
            if integer("format", data["format"], 1) > FORMAT:
                raise ValueError(f"format = {data['format']} is newer than {FORMAT}")
            scene = _decode(data["scene"])
        except (
            TypeError,
            ValueError,
            KeyError,
            OverflowError,
            RecursionError,
            zlib.error,
        ) as error:
            raise ValueError(f"not the JSON of a scene: {error}") from error
        if not isinstance(scene, cls):
            raise ValueError(f"not the JSON of a scene but of {type(scene).__name__}")
        return scene


class ComparedByContent:
    """Base of dataclasses that hold arrays: equal if all fields are, arrays to the last bit."""

    @cached_property
    def digest(self) -> str:
        """Digest of all that is in the fields."""
        hasher = hashlib.blake2b(type(self).__name__.encode(), digest_size=20)
        for name, value in arguments_of(self).items():
            if isinstance(value, np.ndarray):
                hasher.update(f"{name}{value.dtype.str}{value.shape}".encode())
                hasher.update(np.ascontiguousarray(value).data)
            else:
                content = value.digest if isinstance(value, ComparedByContent) else repr(value)
                hasher.update(f"{name}={content}".encode())
        return hasher.hexdigest()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self is other or self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        texts = []
        for name, value in arguments_of(self).items():
            is_array = isinstance(value, np.ndarray)
            texts.append(f"{name}=array of {value.shape}" if is_array else f"{name}={value!r}")
        return f"{type(self).__name__}({', '.join(texts)})"


_PARTS: dict[str, type] = {"Parameters": Parameters}
"""Classes of the parts of scenes, by their tag in the JSON."""
_TAGS: dict[type, str] = {Parameters: "Parameters"}


def register(*kinds: type, prefix: str = "") -> None:
    """Allow classes as parts of scenes; the tag of a class is `prefix` and its name.

    Tags stand in records and must never change.
    """
    for kind in kinds:
        _PARTS[prefix + kind.__name__] = kind
        _TAGS[kind] = prefix + kind.__name__


def _encode(value: Any) -> Any:
    """Convert to plain JSON values.

    Floats are written by `repr`, the shortest text that reads back to the same bits.
    """
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {"type": "float", "value": repr(value)}
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, tuple):
        return [_encode(entry) for entry in value]
    if isinstance(value, np.ndarray):
        packed = base64.b64encode(zlib.compress(value.tobytes(), 1)).decode()
        dtype = one_of("dtype", value.dtype.str, ARRAYS)
        return {"type": "array", "dtype": dtype, "shape": list(value.shape), "data": packed}
    if isinstance(value, Parameters):
        items = [[key, _encode(entry)] for key, entry in value.items()]
        return {"type": "Parameters", "items": items}
    kind = type(value)
    if kind not in _TAGS:
        known = ", ".join(part.__name__ for part in _PARTS.values())
        raise TypeError(
            f"{value!r} cannot be written: its class must be one of {known}; for a user-defined "
            "region use granular.Mask.of(region.contains, lower, upper, spacing)"
        )
    return {"type": _TAGS[kind]} | {n: _encode(entry) for n, entry in arguments_of(value).items()}


def arguments_of(part: Any) -> dict[str, Any]:
    """Arguments that make an equal part of a scene: its fields, but a material knows its own."""
    if hasattr(part, "arguments"):
        return part.arguments()
    return {f.name: getattr(part, f.name) for f in fields(part)}


def _decode(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_decode(entry) for entry in value)
    if not isinstance(value, dict):
        return value
    rest = dict(value)
    tag = rest.pop("type")
    if tag == "float":
        return float(one_of("float", rest["value"], ("inf", "-inf")))
    if tag == "array":
        return _decode_array(**rest)
    if tag not in _PARTS and str(tag).startswith("sph."):
        # Parts of SPH are registered once they are imported, which `import granular` puts off.
        import_module("granular.sph")
    if tag not in _PARTS:
        raise ValueError(f"type {tag!r} must be one of {list(_PARTS)}")
    return _PARTS[tag](**{name: _decode(entry) for name, entry in rest.items()})


def _decode_array(dtype: str, shape: list[int], data: str) -> NDArray[Any]:
    kind = np.dtype(one_of("dtype", dtype, ARRAYS))
    counts = [integer("shape", n, 0, MOST_BYTES) for n in shape]
    size = math.prod(counts) * kind.itemsize
    if size > MOST_BYTES:
        raise ValueError(f"shape = {shape} must have at most {MOST_BYTES} bytes")
    inflater = zlib.decompressobj()
    packed = base64.b64decode(data, validate=True)
    unpacked = inflater.decompress(packed, size + 1)  # no more, whatever the file contains
    if len(unpacked) != size:
        raise ValueError(f"data must hold {size} bytes for the shape {shape}")
    return np.frombuffer(unpacked, dtype=kind).reshape(counts)


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} must not be in the JSON of a scene")
