"""Processes that `mpiexec` has started together."""

from __future__ import annotations

import os
from typing import Any

from granular.ranks.team import attend

SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
"""Environment variables with the number of processes, of MPICH, Open MPI, MVAPICH and SLURM."""


def attended() -> Any:
    """Return the communicator of the processes started together, on rank 0; None for one alone.

    All other ranks work for rank 0, and exit when it ends.
    """
    comm = launched()
    return None if comm is None else attend(comm)


def launched() -> Any:
    """Return the communicator of mpi4py of the processes started together; None for one alone.

    Raises
    ------
    ImportError
        If there are several, but not mpi4py.
    """
    sizes = [os.environ[name] for name in SIZES if name in os.environ]
    if not any(size.isdecimal() and int(size) > 1 for size in sizes):
        return None
    try:
        from mpi4py import MPI
    except ImportError:
        raise ImportError(
            "ranks of mpiexec share a run by mpi4py: pip install 'granular-flow[ranks]'"
        ) from None
    return MPI.COMM_WORLD if MPI.COMM_WORLD.size > 1 else None
