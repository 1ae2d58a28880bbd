"""Dunatunga & Kamrin, Modelling silo clogging with nonlocal granular rheology.

`PAPER` has the figures. Measures of the document: flowing or static, the arch over an opening,
slices of the velocity, and the opening that lets material flow.
"""

from granular.papers.silo_clogging import chutes as chutes
from granular.papers.silo_clogging import departures as departures
from granular.papers.silo_clogging import diagram as diagram
from granular.papers.silo_clogging import equations as equations
from granular.papers.silo_clogging import flows as flows
from granular.papers.silo_clogging import parameters as parameters
from granular.papers.silo_clogging import refinement as refinement
from granular.papers.silo_clogging.arch import Arch as Arch
from granular.papers.silo_clogging.arch import arch_outline as arch_outline
from granular.papers.silo_clogging.document import PAPER as PAPER
from granular.papers.silo_clogging.flow import FlowVerdict as FlowVerdict
from granular.papers.silo_clogging.flow import SiloHistory as SiloHistory
from granular.papers.silo_clogging.flow import flow_verdict as flow_verdict
from granular.papers.silo_clogging.flow import silo_history as silo_history
from granular.papers.silo_clogging.phase_diagram import phase_diagram as phase_diagram
from granular.papers.silo_clogging.threshold import FlowThreshold as FlowThreshold
from granular.papers.silo_clogging.threshold import flow_threshold as flow_threshold
from granular.papers.silo_clogging.threshold import phase_points as phase_points
from granular.papers.silo_clogging.velocity_slices import GaussianFit as GaussianFit
from granular.papers.silo_clogging.velocity_slices import VelocitySlices as VelocitySlices
from granular.papers.silo_clogging.velocity_slices import gaussian_fit as gaussian_fit
from granular.papers.silo_clogging.velocity_slices import velocity_slices as velocity_slices

PAPER.without("1", "the steps of the method", "diagram")
PAPER.without("3", "geometry of the silo and its boundary conditions", "diagram")
PAPER.order(
    *("1", "2b", "2c", "2d", "table_1", "3", "4a", "4b", "5", "6", "7", "8", "table_2", "9", "10"),
    "departures",
)
