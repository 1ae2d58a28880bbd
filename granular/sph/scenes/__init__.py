"""Ready scenes of particle hydrodynamics, with the numbers of the thesis as defaults."""

from granular.sph.scenes.collapse import column_collapse
from granular.sph.scenes.gas import fluidised_bed, jet_on_bed
from granular.sph.scenes.incline import incline
from granular.sph.scenes.inclined_collapse import inclined_collapse
from granular.sph.scenes.slump import slump

__all__ = [
    "column_collapse",
    "fluidised_bed",
    "incline",
    "inclined_collapse",
    "jet_on_bed",
    "slump",
]
