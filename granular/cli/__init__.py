"""The command `granular`: new, run, resume, info, open, compare, plot, verify, answer,
figure, list, completion.

Exit codes: 0 all is well, 1 the run or a check failed, or two records differ, 2 an argument or a
file cannot be used (one line on stderr says which), 3 with `--strict`: the run ended, but an
indicator of failure is suspect (stderr says which, and what to do), 4 a time limit ended the run,
or a budget the search for an answer, 130 Ctrl-C.
"""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence

from granular.cli.commands import FAILED, INTERRUPTED, REFUSED
from granular.cli.parser import command_parser as command_parser
from granular.tools.shown_code import MARK, escaped

USER_ERRORS = (
    ValueError,
    TypeError,
    FileNotFoundError,
    FileExistsError,
    PermissionError,
    IsADirectoryError,
    NotADirectoryError,
    BlockingIOError,
)
"""Exceptions raised for arguments and files that cannot be used."""
WRONG_PATHS = (errno.ENAMETOOLONG, errno.ELOOP)
"""Numbers of other errors of paths."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with arguments (by default those of the process); return the exit code."""
    try:
        words = sys.argv[1:] if argv is None else argv
        arguments = command_parser(words).parse_args(words)
    except SystemExit as stop:  # --help, --version, or a refused argument
        return int(stop.code or 0)
    try:
        return arguments.command(arguments)
    except KeyboardInterrupt:
        print("granular: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # the reader of the output has closed it, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except USER_ERRORS as error:
        return _complain(error, REFUSED)
    except OSError as error:
        return _complain(error, REFUSED if error.errno in WRONG_PATHS else FAILED)
    except ImportError as error:  # of an extra, with the command that installs it
        return _complain(error, REFUSED)
    except (RuntimeError, MemoryError) as error:  # SimulationError is a RuntimeError
        return _complain(error, FAILED)


def _complain(error: BaseException, code: int) -> int:
    """Print an error with its notes in one line, below it source code; return the exit code."""
    text, *source = (str(error) or type(error).__name__).split(f"\n{MARK}")
    message = "; ".join([text, *getattr(error, "__notes__", ())])
    lines = [f"granular: error: {' '.join(message.split())}", *(MARK + line for line in source)]
    print(escaped("\n".join(lines)), file=sys.stderr)
    return code
