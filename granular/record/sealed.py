"""Sealed headers: texts in JSON with a digest, of which the files of an unfinished record consist.

A header is stored as

    MAGIC, length of the header (8 bytes), digest of the header (32 bytes), header (JSON), END

These files are not HDF5, which takes 15 ms for such a file whatever its content.
"""

import json
import struct
from collections.abc import Mapping
from typing import Any

from granular.record.layout import seal

MAGIC = b"\x89granul\n"
"""Beginning of a header; its first byte does not occur in JSON of ASCII."""
END = b"\n"
"""End of a header, which JSON without indentation does not contain."""
START = struct.Struct("<8sq32s")


def sealed(header: Mapping[str, Any]) -> bytes:
    """Return the bytes of a header."""
    text = json.dumps(header).encode("ascii")
    return START.pack(MAGIC, len(text), seal(text)) + text + END


def is_whole(raw: memoryview) -> bool:
    """True if a header lies at the beginning of some bytes, as long as it says that it is."""
    if len(raw) < START.size:
        return False
    magic, length, _ = START.unpack(raw[: START.size])
    return bool(magic == MAGIC and 0 <= length < len(raw) - START.size)


def is_beginning(raw: memoryview) -> bool:
    """True if some bytes are a part of a header, as left by a writer that is killed in a write."""
    if not MAGIC.startswith(bytes(raw[: len(MAGIC)])):
        return False
    return len(raw) < START.size or not (is_whole(raw) or END in bytes(raw[START.size :]))


def unsealed(raw: memoryview) -> tuple[dict[str, Any], int]:
    """Return the header at the beginning of some bytes, and its end; ValueError if damaged."""
    if not is_whole(raw):
        raise ValueError("not a header of a record")
    _, length, digest = START.unpack(raw[: START.size])
    end = START.size + length
    text = bytes(raw[START.size : end])
    if seal(text) != digest or raw[end] != END[0]:
        raise ValueError("a header does not match its digest")
    return json.loads(text), end + len(END)


def whole(value: object) -> int:
    """Return a number of a header that counts something; ValueError if it is none."""
    if type(value) is not int or value < 0:
        raise ValueError(f"{value!r} is not a whole number")
    return value
