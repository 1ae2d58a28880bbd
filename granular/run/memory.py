"""Memory of this machine that a run may use, and the refusal of scenes that need more."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from pathlib import Path

from granular.model.inflow import Inflow, points_between, standing_points
from granular.model.scene import BaseScene

MARGIN = 1.12
"""Factor by which an estimate exceeds the fits, which a peak exceeded by 1.1 at most."""

BASE = 72 * 2**20
"""Memory of the interpreter and the package in a small run with a record [bytes]. Parts of SciPy
that a script loads as well take up to 40 MB."""


def available_memory() -> float:
    """Memory that this process may still allocate [bytes]; inf where the system does not report it.

    The least of the memory that the system reports as available, the rest of the limit of a
    container (cgroup, version 2 or 1), and the rest of the limit on the address space of the
    process.
    """
    return min(_of_system(), _of_container(), _of_process())


def _of_system() -> float:
    for line in _text(Path("/proc/meminfo")).splitlines():
        if line.startswith("MemAvailable:"):
            return 1024.0 * float(line.split()[1])
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):  # not on every system
        return math.inf


def _of_container() -> float:
    folder = Path("/sys/fs/cgroup")
    pairs = (
        ("memory.max", "memory.current"),
        ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"),
    )
    for limit, used in pairs:
        most, now = _text(folder / limit).strip(), _text(folder / used).strip()
        if most.isdigit() and now.isdigit():  # "max": no limit
            return max(float(most) - float(now), 0.0)
    return math.inf


def _of_process() -> float:
    try:
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    except (ImportError, AttributeError):  # not POSIX
        return math.inf
    if limit == resource.RLIM_INFINITY:
        return math.inf
    pages = _text(Path("/proc/self/statm")).split()
    used = float(pages[0]) * os.sysconf("SC_PAGE_SIZE") if pages else 0.0
    return max(limit - used, 0.0)


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:
        return ""


def entering(scene: BaseScene, inflows: Iterable[Inflow]) -> list[int]:
    """Numbers of points that inflows bring, at the start and in the run.

    The first of them are those of the scene; others bring another medium.
    """
    return [
        points_between(inflow, scene.grid, 0.0, scene.duration)
        + (len(standing_points(scene, i).x) if inflow.driven and i < len(scene.inflows) else 0)
        for i, inflow in enumerate(inflows)
    ]


def refuse(scene: BaseScene, points: int, memory: float, available: float | None = None) -> None:
    """Refuse a scene of so many points that needs more memory [bytes] than is available.

    That is by default what this machine has.

    Raises
    ------
    ValueError
        Naming the number of points, the cells, and the memory needed and available.
    """
    available = available_memory() if available is None else available
    if memory <= available:
        return
    cells = " x ".join(map(str, scene.grid.shape))
    raise ValueError(
        f"scene {scene.name!r} with about {points:.3g} points in {cells} cells needs about "
        f"{gigabytes(memory)} of memory, must be at most the {gigabytes(available)} that are "
        "available: take larger cells or fewer points per cell, or force=True"
    )


def gigabytes(memory: float) -> str:
    """Return a number of bytes in words."""
    return f"{memory / 2**30:.2g} GB"
