"""Memory of this machine that a run may use."""

from __future__ import annotations

import math
import os
from pathlib import Path

__all__ = ["available_memory"]


def available_memory() -> float:
    """Memory that this process may still take [bytes]; inf where the system does not tell.

    The least of what the system calls available, what is left of the limit of a container (cgroup,
    version 2 or 1), and what is left of the limit on the address space of the process.
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
