"""Grain scale: discrete simulations, inference of contact forces, and the friction law."""

from granular.grain_scale import dem as dem
from granular.grain_scale import friction_law as friction_law
from granular.grain_scale import inference as inference
from granular.grain_scale.dump import Dump as Dump
from granular.grain_scale.dump import DumpFrame as DumpFrame
from granular.grain_scale.dump import read_dump as read_dump
from granular.grain_scale.grain_averages import GrainAverages as GrainAverages
from granular.grain_scale.grain_averages import average_grains as average_grains
from granular.tools.docstrings import complete as _complete

_complete(__name__)
