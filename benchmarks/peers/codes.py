"""Other codes on the same scenes. Each takes a scene and has the API of `granular.Simulation`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

MODULES = {
    "taichi": "taichi_mpm",
    "taichi_sand": "taichi_sand",
    "newton": "newton_mpm",
    "kratos": "kratos_mpm",
}


class Missing(Exception):
    """Error of a peer that is not installed, or cannot run a scene."""


def simulation(name: str) -> Callable[..., Any]:
    """Class that makes a simulation of a scene with the peer.

    Raises
    ------
    Missing
        If the peer cannot be imported.
    """
    try:
        return import_module(f"peers.{MODULES[name]}").Simulation
    except ImportError as error:
        raise Missing(f"{name} cannot be imported: {error}") from error
