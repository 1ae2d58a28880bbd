"""Ready scenes of particle hydrodynamics, with the numbers of the thesis as defaults."""

from granular.sph.scenes.collapse import column_collapse
from granular.sph.scenes.incline import incline
from granular.sph.scenes.inclined_collapse import inclined_collapse
from granular.sph.scenes.slump import slump

__all__ = ["column_collapse", "incline", "inclined_collapse", "slump"]
