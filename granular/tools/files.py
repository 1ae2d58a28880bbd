"""Files that are given by their paths."""

from __future__ import annotations

import os
import stat
from pathlib import Path

KINDS = (
    (stat.S_ISDIR, "folder"),
    (stat.S_ISFIFO, "pipe"),
    (stat.S_ISSOCK, "socket"),
    (stat.S_ISCHR, "device"),
    (stat.S_ISBLK, "device"),
)


def check_file(path: str | os.PathLike) -> Path:
    """Return a path if it leads to a file, which may be empty; a pipe would be waited for forever.

    Raises
    ------
    OSError
        If there is no such file, or no permission; an IsADirectoryError for a folder.
    ValueError
        If it leads to a pipe, a socket or a device.
    """
    path = Path(path)
    mode = path.stat().st_mode
    for is_one, kind in KINDS:
        if is_one(mode):
            error = IsADirectoryError if kind == "folder" else ValueError
            raise error(f"path = {str(path)!r} must be a file, is a {kind}")
    return path


def read_text(path: str | os.PathLike) -> str:
    """Read a file of text in UTF-8, with or without a byte order mark.

    Raises
    ------
    OSError, ValueError
        As `check_file`, and if it is not in UTF-8; with the position of the first wrong byte.
    """
    raw = check_file(path).read_bytes()
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        raise ValueError(
            f"path = {str(path)!r} must be text in UTF-8, has the byte 0x{raw[error.start]:02x} at "
            f"byte {error.start}, in line {line}"
        ) from None
