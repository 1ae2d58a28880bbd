"""Durable writing: after a call the bytes are on the disk, or an OSError was raised."""

import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py

from granular.record.layout import RecordError, reading
from granular.tools.files import check_file

SIGNATURE = b"\x89HDF\r\n\x1a\n"


def write_all(fd: int, data: bytes | memoryview) -> None:
    """Write all of ``data``; a single os.write may write only part of it."""
    view = memoryview(data).cast("B")
    while view:
        view = view[os.write(fd, view) :]


def fsync_folder(folder: Path) -> None:
    """Make renames and removals in a folder durable; does nothing on Windows."""
    if os.name == "nt":
        return
    fd = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def followed(path: str | os.PathLike[str]) -> Path:
    """Return the path of a record; of a symbolic link the path of its target, existing or not.

    Raises
    ------
    IsADirectoryError, ValueError
        If a folder, a pipe or a device is there: a record would replace it.
    """
    path = Path(path)
    with suppress(FileNotFoundError):
        check_file(path)
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def identity(path: Path) -> tuple[int, int] | None:
    """Size [bytes] and time of modification [ns] of a file, which identify it; or None."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        return None
    return status.st_size, status.st_mtime_ns


def permissions(path: Path) -> int | None:
    """Permissions of a file; None if there is none."""
    with suppress(FileNotFoundError):
        return stat.S_IMODE(os.stat(path).st_mode)
    return None


def create(temporary: Path, mode: int | None) -> int:
    """Open a new file that is never more public than these permissions."""
    flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    try:
        fd = os.open(temporary, flags, 0o666 if mode is None else mode & 0o777)
    except FileExistsError:  # of a run that was killed
        os.unlink(temporary)
        return create(temporary, mode)
    if mode is not None:
        with suppress(OSError):  # a file system without permissions
            os.fchmod(fd, mode)  # the umask does not count for a file that has permissions
    return fd


@contextmanager
def replacing(path: Path, temporary: Path, mode: int | None = None) -> Iterator[int]:
    """Yield the descriptor of a temporary file that is renamed to ``path`` on success only.

    It gets the permissions of the file that it replaces, or those given if there is none.

    Raises
    ------
    OSError
        If the write, the fsync or the rename fails; ``path`` is then as before, and the temporary
        file is removed.
    """
    before = permissions(path)
    fd = create(temporary, mode if before is None else before)
    try:
        try:
            yield fd
            os.fsync(fd)
        finally:
            os.close(fd)
        os.replace(temporary, path)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary)
        raise
    fsync_folder(path.parent)


class Sink:
    """File object for HDF5 that stores the first error, which HDF5 would lose.

    HDF5 ignores errors that occur while it closes a file. After a failure this sink therefore
    accepts all further writes without effect, HDF5 goes on normally, and `check` raises the error.
    In a process forked from the one that made it, no write has an effect.

    Attributes
    ----------
    place : int
        Position of the last write [bytes].
    """

    def __init__(self, fd: int) -> None:
        self.fd, self.place, self._process = fd, 0, os.getpid()
        self.error: BaseException | None = None

    def _guard(self, action: Callable[[], None]) -> None:
        if self.error is None and os.getpid() == self._process:
            try:
                action()
            except BaseException as error:  # a KeyboardInterrupt must not be lost either
                self.error = error

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Set the position, as io.RawIOBase.seek."""
        return os.lseek(self.fd, offset, whence)

    def tell(self) -> int:
        """Return the position, as io.RawIOBase.tell."""
        return os.lseek(self.fd, 0, os.SEEK_CUR)

    def read(self, size: int) -> bytes:
        """Read as io.RawIOBase.read, but the whole size unless the file ends."""
        data = b""
        while len(data) < size and (more := os.read(self.fd, size - len(data))):
            data += more
        return data

    def readinto(self, buffer: memoryview) -> int:
        """Read as io.RawIOBase.readinto, but the whole buffer unless the file ends."""
        data = self.read(len(buffer))
        buffer[: len(data)] = data
        return len(data)

    def write(self, data: memoryview) -> int:
        """Write all of ``data``, or store the error."""
        self.place = self.tell()
        self._guard(lambda: write_all(self.fd, data))
        return memoryview(data).nbytes

    def truncate(self, size: int) -> int:
        """Set the length, or store the error."""
        self._guard(lambda: os.ftruncate(self.fd, size))
        return size

    def flush(self) -> None:
        """Do nothing, because there is no buffer."""

    def check(self) -> None:
        """Raise the stored error; writes have an effect again."""
        error, self.error = self.error, None
        if error is not None:
            raise error


def open_hdf5(path: Path) -> h5py.File:
    """Open a file for reading, without locks.

    Raises
    ------
    RecordError
        If it is not an HDF5 file, or is damaged.
    FileNotFoundError, PermissionError, IsADirectoryError
        If the system cannot open it.
    """
    with open(path, "rb") as file:
        start = file.read(len(SIGNATURE))
    if start != SIGNATURE:
        raise RecordError(f"{path}: not an HDF5 file")
    with reading(path):
        return h5py.File(path, "r", locking=False)
