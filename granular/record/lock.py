"""The right to write a record, which one run at a time holds."""

import errno
import os
import warnings
from contextlib import suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None  # type: ignore[assignment]  # the name of a module

NAME = "lock"
ATTEMPTS = 100
"""Number of folders that may vanish, each with the run that removes it, before a run gives up."""

_HELD = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES)
_UNKNOWN = (errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP)


class Lock:
    """Exclusive right to write into a folder of parts; the end of the process releases it too.

    It is taken before anything is written or removed. The file ``lock`` in the folder is locked,
    which nothing replaces. It is removed only by its holder, and only if the folder is otherwise
    empty; a process that has opened a removed one detects this and begins again.

    Parameters
    ----------
    folder
        The folder; it is made if there is none.
    mode
        Permissions of a new folder, before the umask.

    Raises
    ------
    BlockingIOError
        If another run holds the lock.
    OSError
        If the folder cannot be made or written.

    Warns
    -----
    RuntimeWarning
        If the file system does not support locks. The run then goes on without one.
    """

    def __init__(self, folder: Path, mode: int = 0o777) -> None:
        self.folder, self._file = folder, folder / NAME
        for _ in range(ATTEMPTS):
            folder.mkdir(mode, exist_ok=True)
            if fcntl is None:
                self._fd: int | None = None
                return
            with suppress(FileNotFoundError):  # the folder was removed meanwhile
                self._fd = os.open(self._file, os.O_RDWR | os.O_CREAT, 0o666)
                try:
                    self._take(self._fd)
                    if self._is_current(self._fd):
                        return
                except BaseException:
                    os.close(self._fd)
                    raise
                os.close(self._fd)
        raise BlockingIOError(f"{folder}: other runs begin and end here all the time")

    def _take(self, fd: int) -> None:
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in _HELD:
                raise BlockingIOError(
                    f"{self.folder}: the record is being written by a live run"
                ) from None
            if error.errno not in _UNKNOWN:
                raise
            text = f"{self.folder}: the file system has no locks; start one run at a time"
            warnings.warn(text, RuntimeWarning, stacklevel=5)

    def _is_current(self, fd: int) -> bool:
        """True if the locked file is still the one in the folder."""
        with suppress(FileNotFoundError):
            return os.path.samestat(os.fstat(fd), os.stat(self._file))
        return False

    def release(self) -> None:
        """Release the lock, and remove the folder if it is then empty."""
        fd = self._fd
        with suppress(OSError):
            if fd is not None and os.listdir(self.folder) == [NAME] and self._is_current(fd):
                os.unlink(self._file)
        if fd is not None:
            self._fd = None
            with suppress(OSError):
                # Closing would not do it while a forked process has the descriptor too.
                fcntl.flock(fd, fcntl.LOCK_UN)
            os.close(fd)
        with suppress(OSError):  # it is not empty, or another run begins in it
            os.rmdir(self.folder)
