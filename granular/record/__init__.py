"""HDF5 record of a run: append, read, resume, provenance; readable by ParaView.

One file a run. While the run lives, its frames are small files beside it, each written whole
or not at all: a full disk costs no frame that was stored, and a kill none that was made more than
about a second before.
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
