"""Grain scale: discrete simulations, inference of contact forces, and the friction law."""

from granular.grain_scale import dem, friction_law, inference
from granular.grain_scale.dump import Dump, DumpFrame, read_dump
from granular.grain_scale.grain_averages import GrainAverages, average_grains

__all__ = [
    "Dump",
    "DumpFrame",
    "GrainAverages",
    "average_grains",
    "dem",
    "friction_law",
    "inference",
    "read_dump",
]
