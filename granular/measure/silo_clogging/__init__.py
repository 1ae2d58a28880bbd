"""Measures of Dunatunga & Kamrin, "Modelling silo clogging with nonlocal granular rheology".

Flowing or static, the arch over an opening, slices of the velocity, and the opening that lets
material flow.
"""

from granular.measure.silo_clogging.arch import Arch as Arch
from granular.measure.silo_clogging.arch import arch_outline as arch_outline
from granular.measure.silo_clogging.flow import FlowVerdict as FlowVerdict
from granular.measure.silo_clogging.flow import SiloHistory as SiloHistory
from granular.measure.silo_clogging.flow import flow_verdict as flow_verdict
from granular.measure.silo_clogging.flow import silo_history as silo_history
from granular.measure.silo_clogging.threshold import FlowThreshold as FlowThreshold
from granular.measure.silo_clogging.threshold import flow_threshold as flow_threshold
from granular.measure.silo_clogging.threshold import phase_points as phase_points
from granular.measure.silo_clogging.velocity_slices import GaussianFit as GaussianFit
from granular.measure.silo_clogging.velocity_slices import VelocitySlices as VelocitySlices
from granular.measure.silo_clogging.velocity_slices import gaussian_fit as gaussian_fit
from granular.measure.silo_clogging.velocity_slices import velocity_slices as velocity_slices
