"""Packages that an extra of the package brings, see docs/tutorials/install.md."""

from importlib import import_module
from typing import Any


def imported(package: str, extra: str) -> Any:
    """Import a package that an extra brings.

    Raises
    ------
    ModuleNotFoundError
        With the command that installs it.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{error}: this needs {package}: pip install 'granular-flow[{extra}]'"
        ) from error
