"""Runs a command, and ends it with all it has started once the process that asked is gone.

A script for a process of its own: ``guard.py PARENT COMMAND...``. However PARENT goes, even if it
is killed and can clean up nothing, the command does not go on for nobody, and the folder it runs in
is taken away. Looking for the parent is portable and sees threads and forks rightly, which a signal
at the death of a parent (Linux: of the thread that started the child) and a pipe held open do not.
"""

import os
import shutil
import signal
import subprocess
import sys

UNSTARTED = "unstarted"
"""File that says why the command cannot be started."""

_LOOK = 0.2
"""Seconds between two looks for the parent."""
_GRACE = 2.0
"""Seconds to end in after SIGTERM."""


def main(parent: int, command: list[str]) -> int:
    """Status of the command; as shells have it, 128 and its number for a signal."""
    try:
        child = subprocess.Popen(command)
    except OSError as error:
        with open(UNSTARTED, "w", encoding="utf-8") as file:
            file.write(error.strerror or str(error))
        return 127
    while True:
        try:
            status = child.wait(_LOOK)
        except subprocess.TimeoutExpired:
            if os.getppid() != parent:
                _end(child)
        else:
            return status if status >= 0 else 128 - status


def _end(child: subprocess.Popen[bytes]) -> None:
    """End the whole process group, this process last; what was being computed nobody reads."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    os.killpg(0, signal.SIGTERM)
    try:
        child.wait(_GRACE)
    except subprocess.TimeoutExpired:
        child.kill()
    shutil.rmtree(os.getcwd(), ignore_errors=True)
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.argv[2:]))
