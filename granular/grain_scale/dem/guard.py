"""Run a command, and end it with all processes it has started when the parent process is gone.

This is a script for a separate process: ``guard.py PARENT COMMAND...``. However PARENT ends, even
if it is killed and cannot clean up, the command is ended and the folder in which it runs is
removed. The guard polls for its parent. This is portable and correct with threads and forks,
unlike a signal on the death of the parent (on Linux: of the thread that started the child) and
unlike a pipe that is held open.
"""

import os
import shutil
import signal
import subprocess
import sys

UNSTARTED = "unstarted"
"""Name of the file that holds the reason why the command cannot be started."""

_LOOK = 0.2
"""Interval at which the guard polls for the parent [s]."""
_GRACE = 2.0
"""Time that the command has to end after SIGTERM [s]."""


def main(parent: int, command: list[str]) -> int:
    """Run the command and return its exit status; as in shells, 128 plus the number of a signal."""
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
    """End the whole process group, this process last, and remove the folder of the run."""
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
