"""Layout of a record on disk: names, versions, limits, digests, and the error that they raise.

The finished file::

    /VTKHDF                 PolyData with Steps, as ParaView reads it; frames are stored here once
        Points              (rows, 3)  x, with z = 0 in 2D; attribute ``columns`` = dim
        PointData/<field>   (rows,) or (rows, k)
        Vertices, Lines, Polygons, Strips, Steps
    /granular               attributes ``format``, ``record``, ``seal``
        scene, provenance   JSON
        step, dt, mass      one value per frame
        digest              (frames, 32) digest of the content of each frame
        samples/<name>      values of the monitor at each frame, nan if it did not sample
                            it, and the numbers of rigid bodies (body<index>_<number>) and walls
                            (wall<index>_<number>)
        gas                 in scenes with a gas, the frames of its particles in the same form: a
                            group VTKHDF, and step, dt, mass and digest of the frames with gas
        patches             of simulations with tractions, the patches of walls and bodies, likewise
        checkpoint          the newest restart state (optional)

Every frame begins on a chunk boundary, so that its columns are stored as they are packed.
The rows between the end of a frame and the next boundary are not used.
"""

import errno
import hashlib
import math
import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, Protocol, overload

import h5py
import numpy as np

FORMAT = 4
"""Version of the format; files of another version are refused."""

OTHERS = ("gas", "patches")
"""Names of the sets of points besides the material that a frame may have."""

LIBVER = ("v110", "v110")
"""Version of HDF5 objects: in 1.10 all metadata have checksums, and ParaView can read it."""

DIGEST_SIZE = 32
MAX_CHUNK_ROWS = 65536
MAX_COLUMNS = 64
MAX_CHUNK_BYTES = 1 << 26
# Deflate cannot shrink by more than a factor of 1032; data that claim more would exhaust memory.
MAX_DEFLATE = 1100
PIPELINE = (h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE)
"""Filters of a packed dataset, in this order; a repeated filter would multiply what it unpacks."""
DTYPES = ("<f8", "<i8")
FIELD_DTYPES = (*DTYPES, "<f4")
"""Types of the fields of points; all else is stored in double precision."""
TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")


class RecordError(ValueError):
    """Error for a record that is damaged, of another program, or newer than this version.

    The message names the file and the fault.
    """


DAMAGED = "damaged record"
_CODE = re.compile(r"errno = ([1-9]\d*)")
"""Error of the system in a message of HDF5, which has no other place for it."""
_NO_MEMORY = re.compile(r"memory allocation failed|(can't|unable to) allocate", re.IGNORECASE)


@contextmanager
def reading(path: Path, what: str = DAMAGED) -> Iterator[None]:
    """Turn any exception of a malformed file into a `RecordError` that says `what` is wrong.

    An error of the system is no damage: an OSError with a code is raised unchanged, and so is a
    MemoryError. HDF5 has other exceptions for both, with the code in the message.
    """
    try:
        yield
    except (RecordError, MemoryError):
        raise
    except Exception as error:
        system = _system_error(path, error)
        if system is error:
            raise
        if system is not None:
            raise system from error
        cause: object = error
        if isinstance(error, KeyError) and error.args:
            cause = error.args[0]  # without quotation marks
            what = "not a granular record, or damaged" if what == DAMAGED else what
        raise RecordError(f"{path}: {what}: {cause or type(error).__name__}") from error


def _system_error(path: Path, error: Exception) -> Exception | None:
    """Return the error of the system that an exception stands for; None if it is none."""
    match = _CODE.search(str(error))
    code = (isinstance(error, OSError) and error.errno) or (int(match[1]) if match else 0)
    if code == errno.ENOMEM or (_NO_MEMORY.search(str(error)) and not _memory_left()):
        return MemoryError(f"{path}: {error}")
    if code:
        return error if isinstance(error, OSError) else OSError(code, os.strerror(code), str(path))
    return None


def _memory_left() -> bool:
    """True if there is memory for the largest pieces of a valid file: more was a false size."""
    try:
        bytearray(2 * MAX_CHUNK_BYTES)
    except MemoryError:
        return False
    return True


def check_type(name: str, array: object, dtypes: tuple[str, ...] = DTYPES) -> None:
    """Refuse anything but an array of one of these types with a TypeError."""
    kind = getattr(array, "dtype", type(array).__name__)
    if getattr(kind, "str", "") not in dtypes:
        known = " or ".join(np.dtype(dtype).name for dtype in dtypes)
        raise TypeError(f"{name} has type {kind}, must be {known}")


def check_format(path: Path, version: int) -> int:
    """Return a format version; refuse versions that this code does not know."""
    if version > FORMAT:
        raise RecordError(
            f"{path}: format version {version} is newer than {FORMAT}, the one that this version"
            " of granular reads; update granular"
        )
    if version < FORMAT:
        raise RecordError(f"{path}: format version {version} must be {FORMAT}")
    return version


def described(dtype: str, shape: tuple[int, ...], sums: bytes) -> bytes:
    """Return the bytes of `checksums` for an array of this type and shape."""
    return f"{dtype}{shape}".encode() + sums


class Rows(Protocol):
    """An array that is made, or read, row by row: of shape (k, n), k <= `MAX_COLUMNS`, or (n,)."""

    @property
    def dtype(self) -> np.dtype: ...
    @property
    def shape(self) -> tuple[int, ...]: ...
    def row(self, k: int) -> np.ndarray:
        """Return row k, contiguous; row 0 of an array that is none of rows is all of it."""


def count_of_rows(shape: tuple[int, ...]) -> int:
    """Number of rows of an array as `checksums` has them: a few long ones, else all in one."""
    return shape[0] if len(shape) == 2 and shape[0] <= MAX_COLUMNS else 1


def row_of(array: "np.ndarray | Rows", k: int) -> np.ndarray:
    """Return a row of an array, in one dimension and contiguous."""
    if not isinstance(array, np.ndarray):
        return array.row(k)
    row = array[k] if count_of_rows(array.shape) > 1 else array
    return np.ascontiguousarray(row).reshape(-1)


def checksums(
    array: "np.ndarray | Rows", use: Callable[[int, np.ndarray], object] = lambda _, __: None
) -> bytes:
    """Type and shape of an array, and the checksums of its rows, as what goes into a digest.

    A checksum is several times as fast as a digest. A few long rows have one each, so that one that
    is contiguous need not be copied; any other array has one. `use` is called with the number of
    each row and the row.
    """
    sums = b""
    for k in range(count_of_rows(array.shape)):
        row = row_of(array, k)
        sums += struct.pack("<L", zlib.crc32(row.view(np.uint8).data))
        use(k, row)
    return described(array.dtype.str, array.shape, sums)


def frame_digest(
    time: float, step: int, dt: float, mass: float, fields: Mapping[str, bytes]
) -> bytes:
    """Digest of one frame: its scalars, and name and `checksums` of the columns of every field."""
    digest = hashlib.blake2b(digest_size=DIGEST_SIZE)
    digest.update(struct.pack("<dqdd", time, step, dt, mass))
    for name in sorted(fields):
        digest.update(name.encode() + fields[name])
    return digest.digest()


def seal(*parts: str | bytes | np.ndarray) -> bytes:
    """Digest of a sequence of texts, byte strings and arrays (lengths included)."""
    digest = hashlib.blake2b(digest_size=DIGEST_SIZE)
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(checksums(part))
        else:
            raw = part.encode() if isinstance(part, str) else part
            digest.update(struct.pack("<q", len(raw)))
            digest.update(raw)
    return digest.digest()


def chunk_rows(n: int) -> int:
    """Rows per chunk if the first frame has ``n`` points: it is divided into few equal chunks."""
    n = max(n, 1)
    return -(-n // -(-n // MAX_CHUNK_ROWS))


def rows_of(n: int, chunk: int) -> int:
    """Rows of a frame of ``n`` points, rounded up to whole chunks."""
    return -(-n // chunk) * chunk


def write_text(group: h5py.Group, name: str, text: str) -> None:
    """Store ASCII text as a fixed-length string, which avoids the unchecked heap of HDF5."""
    raw = text.encode("ascii")
    group.create_dataset(name, data=np.bytes_(raw), dtype=h5py.string_dtype("ascii", len(raw)))


def has(group: h5py.Group, name: str) -> bool:
    """True if a group has a member or a link of this name; links are not followed."""
    return bool(group.id.links.exists(name.encode()))


def hard(group: h5py.Group, name: str, kind: type) -> h5py.Group | h5py.Dataset:
    """Return a member of a group that is in this file; soft and external links are refused."""
    # `get` of h5py would take an error of the system for a missing member.
    link = group.id.links.get_info(name.encode()) if has(group, name) else None
    if link is None or link.type != h5py.h5l.TYPE_HARD:
        raise KeyError(f"{group.name}/{name} is missing or a link")
    member = group[name]
    if not isinstance(member, kind):
        raise KeyError(f"{group.name}/{name} is not a {kind.__name__}")
    return member


def checked(
    group: h5py.Group, name: str, dtypes: tuple[str, ...], *ndims: int, packed: bool = False
) -> h5py.Dataset:
    """Return a dataset of expected type and rank, stored in the file, of a size the file can hold.

    Only the fields of points may be `packed`. All other datasets are read as a whole when a record
    is opened, and take no more memory than in the file.

    Raises
    ------
    KeyError, ValueError
        If it is missing, a link, stored externally or virtually, or its filter, type, rank or size
        is not allowed.
    """
    data = hard(group, name, h5py.Dataset)
    plist = data.id.get_create_plist()
    if plist.get_external_count() or plist.get_layout() == h5py.h5d.VIRTUAL:
        raise ValueError(f"{data.name} refers to data outside of the file")
    if data.dtype.str not in dtypes:
        raise ValueError(f"{data.name} has type {data.dtype.str}, not one of {dtypes}")
    if len(data.shape) not in ndims:
        raise ValueError(f"{data.name} has shape {data.shape}, expected rank in {ndims}")
    filters = tuple(plist.get_filter(i)[0] for i in range(plist.get_nfilters()))
    if filters and not (packed and filters == PIPELINE):
        raise ValueError(f"{data.name} uses unknown filters {filters}")
    if data.chunks and math.prod(data.chunks) * data.dtype.itemsize > MAX_CHUNK_BYTES:
        raise ValueError(f"{data.name} has chunks of {data.chunks}, larger than allowed")
    size = math.prod(data.shape) * data.dtype.itemsize
    factor = MAX_DEFLATE if filters else 1
    stored = min(data.id.get_storage_size(), data.file.id.get_filesize())
    if size > factor * stored + MAX_CHUNK_BYTES * bool(filters):
        raise ValueError(f"{data.name} has shape {data.shape}, more than the file can hold")
    return data


def read_text(group: h5py.Group, name: str) -> str:
    """Read a text stored by `write_text`."""
    data = hard(group, name, h5py.Dataset)
    if data.dtype.kind != "S" or data.shape != ():  # its length is part of its type
        raise ValueError(f"{data.name} is not a text")
    checked(group, name, (data.dtype.str,), 0)
    return bytes(data[()]).decode("ascii")


@overload
def attribute(group: h5py.Group | h5py.Dataset, name: str, kind: Literal["f"]) -> float: ...
@overload
def attribute(group: h5py.Group | h5py.Dataset, name: str, kind: Literal["i"]) -> int: ...
@overload
def attribute(group: h5py.Group | h5py.Dataset, name: str, kind: Literal["u"]) -> bytes: ...
def attribute(group: h5py.Group | h5py.Dataset, name: str, kind: str) -> float | int | bytes:
    """Read a scalar (``"f"`` or ``"i"``) or bytes (``"u"``) attribute and check its type first."""
    if name not in group.attrs:
        raise KeyError(f"{group.name} has no attribute {name}")
    stored = group.attrs.get_id(name)
    if stored.dtype.kind != kind or len(stored.shape) > 1 or math.prod(stored.shape) > 64:
        raise ValueError(f"attribute {name} of {group.name} has an unexpected type")
    value = group.attrs[name]
    if kind == "u":
        return np.asarray(value, dtype=np.uint8).tobytes()
    return float(value) if kind == "f" else int(value)


def as_attribute(raw: bytes) -> np.ndarray:
    """Convert bytes to the form in which `attribute` reads them."""
    return np.frombuffer(raw, dtype=np.uint8)
