"""HDF5 record of a run: append, read, resume, provenance; readable by ParaView.

A record is one file per run. While the run is going on, its frames are small files beside it, each
written completely or not at all. A full disk therefore loses no frame that was stored, and killing
the run loses only frames of about the last second.
"""

from granular.record.checkpoint import Checkpoint
from granular.record.layout import RecordError
from granular.record.reader import Trajectory, info, open_trajectory
from granular.record.writer import TrajectoryWriter

__all__ = [
    "Checkpoint",
    "RecordError",
    "Trajectory",
    "TrajectoryWriter",
    "info",
    "open_trajectory",
]
