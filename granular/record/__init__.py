"""HDF5 record of a run: append, read, resume, provenance; readable by ParaView.

A record is one file per run. While the run is going on, its frames are written to an unfinished
file, and a log contains their positions. A frame is stored completely or not at all, and killing
the run loses none.
"""

from granular.record.checkpoint import Checkpoint as Checkpoint
from granular.record.layout import RecordError as RecordError
from granular.record.reader import Trajectory as Trajectory
from granular.record.reader import info as info
from granular.record.reader import open_trajectory as open_trajectory
from granular.record.writer import TrajectoryWriter as TrajectoryWriter
