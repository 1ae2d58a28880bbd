"""Provenance of a record: versions, build, machine, start, parent."""

import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from granular.tools.version import commit, package_version


def _build() -> dict[str, Any] | None:
    """Compiler, flags and instruction set; None without the core, which records do not need."""
    try:
        return dict(import_module("granular._core").build_info())
    except ImportError:
        return None


def cpu_name() -> str:
    """Name of the processor; never the name of the host."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def collect(extra: Mapping[str, Any] | None = None, *, parent: str | None = None) -> dict[str, Any]:
    """Collect the provenance of a run that begins now.

    Parameters
    ----------
    extra
        Additional JSON-compatible entries, which replace collected ones of the same name (for
        example ``threads``). A simulation adds ``every``, the time between its frames [s].
    parent
        Digest (hex) of the checkpoint or frame that the run continues from.
    """
    return {
        "granular": package_version(),
        "commit": commit(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "h5py": h5py.__version__,
        "hdf5": h5py.version.hdf5_version,
        "build": _build(),
        "cpu": cpu_name(),
        "cpus": os.cpu_count(),
        "threads": None,
        "start": datetime.now(UTC).isoformat(timespec="seconds"),
        "parent": parent,
        **(extra or {}),
    }
