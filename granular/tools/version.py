"""Version of the package, and the commit that it was built from."""

from __future__ import annotations

import functools
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
STORED = PACKAGE / "commit.txt"
"""File in a wheel with the commit that it was built from (written by setup.py)."""


def package_version() -> str:
    """Version of the installed package."""
    try:
        return version("granular-flow")
    except PackageNotFoundError:  # compiled in the folder of the sources
        return "not installed"


@functools.cache
def commit(*paths: str) -> str:
    """Commit of the sources, with a + if they have changed since; "unknown" without one.

    Parameters
    ----------
    *paths : str
        Patterns of paths in the repository whose changes count, in addition to those of csrc and
        granular.
    """
    root = PACKAGE.parent
    if not (root / ".git").exists():
        return STORED.read_text(encoding="ascii").strip() if STORED.exists() else "unknown"

    def git(*words: str) -> str:
        command = ["git", "-C", str(root), *words]
        try:
            return subprocess.run(command, capture_output=True, text=True).stdout.strip()
        except OSError:  # no git
            return ""

    head = git("rev-parse", "--short=8", "HEAD")
    if not head:
        return "unknown"
    return head + "+" * bool(git("status", "--porcelain", "--", "csrc", "granular", *paths))
