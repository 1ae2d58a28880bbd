"""HDF5 record of a run: append, read, resume, provenance; readable by ParaView.

A record is one file per run. While the run is going on, its frames are small files beside it, each
written completely or not at all. A full disk therefore loses no frame that was stored, and killing
the run loses only frames of about the last second.
"""

from granular.record.checkpoint import Checkpoint as Checkpoint
from granular.record.layout import RecordError as RecordError
from granular.record.reader import Trajectory as Trajectory
from granular.record.reader import info as info
from granular.record.reader import open_trajectory as open_trajectory
from granular.record.writer import TrajectoryWriter as TrajectoryWriter
