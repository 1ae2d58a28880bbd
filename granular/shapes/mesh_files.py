"""Surfaces of triangles from files."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granular.tools.arrays import Array

FORMATS = ("stl", "obj", "ply", "off")
"""Formats that hold triangles alone: no archives that unpack to more, no references to follow."""
ALL_WHOLE = 2**23
"""Single number from which all are whole numbers, rounded or not."""
MOST_BYTES = 10**9
"""Largest size of a file: 20 million triangles of a binary STL."""


def read_surface(path: str | os.PathLike[str]) -> tuple[Array, NDArray[np.int32], float]:
    """Return vertices, of which none are equal, triangles, and the rounding of coordinates.

    Triangles of two equal vertices are left out. The rounding is half the distance of single
    numbers at the largest coordinate, 0 if the coordinates are not rounded to such.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        Naming the path, for any fault of the file.
    """
    name = f"path = {str(path)!r}"
    content, ending = _content(Path(path), name)
    trimesh = _trimesh()
    try:
        # without its path a file can refer to no other
        surface = trimesh.load_mesh(io.BytesIO(content), file_type=ending, process=False)
        given, triangles = np.asarray(surface.vertices, dtype=float), np.asarray(surface.faces)
    except IndexError as error:
        raise ValueError(f"{name} has triangles of vertices that it does not hold") from error
    except Exception as error:  # of any kind: files are of any kind
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise ValueError(f"{name} cannot be read as {ending.upper()}: {reason}") from error
    if given.ndim != 2 or triangles.ndim != 2 or not triangles.size:
        raise ValueError(f"{name} must hold a surface of triangles")
    if triangles.min() < 0 or triangles.max() >= len(given):
        raise ValueError(f"{name} has triangles of vertices that it does not hold")
    if not np.isfinite(given).all():
        raise ValueError(f"{name} has vertices that are not finite")
    vertices, same = np.unique(given, axis=0, return_inverse=True)
    faces = same.reshape(-1)[triangles]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    if not len(faces):
        raise ValueError(f"{name} must hold triangles of three different vertices")
    return vertices, faces.astype(np.int32), _rounding(vertices)


def _content(path: Path, name: str) -> tuple[bytes, str]:
    """Bytes and format of a file, after checks of its kind and size."""
    ending = path.suffix.lower().removeprefix(".")
    if ending not in FORMATS:
        raise ValueError(f"{name} must end in one of .{', .'.join(FORMATS)}: convert it")
    if path.exists() and not path.is_file():  # of a pipe or a device there is no end
        raise ValueError(f"{name} must be a file")
    with path.open("rb") as file:
        content = file.read(MOST_BYTES + 1)
    if not 0 < len(content) <= MOST_BYTES:
        size = "no" if not content else f"more than {MOST_BYTES}"
        raise ValueError(f"{name} has {size} bytes, must have 1 to {MOST_BYTES}")
    return content, ending


def _rounding(vertices: Array) -> float:
    single = vertices.astype(np.float32)
    largest = abs(single).max()
    whole = largest < ALL_WHOLE and (vertices == np.rint(vertices)).all()
    if (single != vertices).any() or whole:
        return 0.0
    return 0.5 * float(np.spacing(largest))


def _trimesh() -> Any:
    try:
        import trimesh
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error}: files of triangles need trimesh: pip install granular-flow[meshes]"
        ) from error
    return trimesh
