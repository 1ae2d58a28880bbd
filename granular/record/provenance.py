"""Where a record comes from: versions, build, machine, start, parent."""

import json
import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import h5py
import numpy as np


def _granular_version() -> str:
    try:
        return version("granular")
    except PackageNotFoundError:
        return "not installed"


def _build() -> dict[str, Any] | None:
    """Compiler, flags and instruction set, if the core is there (records do without it)."""
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
    """Provenance of a run that begins now.

    Parameters
    ----------
    extra
        More entries, JSON-compatible; they win over the collected ones (``threads`` for one). A
        simulation adds ``every``, the time between its frames [s].
    parent
        Digest (hex) of the checkpoint or frame that the run continues from.
    """
    return {
        "granular": _granular_version(),
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


def to_json(provenance: Mapping[str, Any]) -> str:
    """ASCII JSON of a provenance.

    Raises
    ------
    TypeError
        An entry that JSON cannot hold.
    """
    return json.dumps(provenance, sort_keys=True)
