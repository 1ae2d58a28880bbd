"""Python code that tests run in other processes."""

import sys
import textwrap
from pathlib import Path

TESTS = Path(__file__).parents[1]


def command(code, *arguments):
    """Command that runs code, which finds what the tests find, and the file `conftest`."""
    path = f"import sys; sys.path[:] = {[str(TESTS), *sys.path]!r}\n"
    return [sys.executable, "-c", path + textwrap.dedent(code), *map(str, arguments)]
