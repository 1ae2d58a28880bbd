"""One run on several processes, on one machine or many, with the same bits.

``granular.Simulation(scene, comm=MPI.COMM_WORLD)`` shares a run with all ranks of a communicator of
mpi4py (``pip install 'granular-flow[ranks]'``); see `RankedSimulation`. `threads` makes ranks of
the threads of one process, to try it without MPI.
"""

from granular.ranks.communicator import Communicator, LostRankError, MpiCommunicator
from granular.ranks.in_threads import threads
from granular.ranks.launched import attended
from granular.ranks.simulation import RankedSimulation

__all__ = [
    "Communicator",
    "LostRankError",
    "MpiCommunicator",
    "RankedSimulation",
    "attended",
    "threads",
]
