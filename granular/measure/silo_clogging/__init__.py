"""Measures of Dunatunga & Kamrin, "Modelling silo clogging with nonlocal granular rheology".

Flowing or static, the arch over an opening, slices of the velocity, and the opening that lets
material flow.
"""

from granular.measure.silo_clogging.arch import Arch, arch_outline
from granular.measure.silo_clogging.flow import (
    FlowVerdict,
    SiloHistory,
    flow_verdict,
    silo_history,
)
from granular.measure.silo_clogging.threshold import FlowThreshold, flow_threshold, phase_points
from granular.measure.silo_clogging.velocity_slices import (
    GaussianFit,
    VelocitySlices,
    gaussian_fit,
    velocity_slices,
)

__all__ = [
    "Arch",
    "FlowThreshold",
    "FlowVerdict",
    "GaussianFit",
    "SiloHistory",
    "VelocitySlices",
    "arch_outline",
    "flow_threshold",
    "flow_verdict",
    "gaussian_fit",
    "phase_points",
    "silo_history",
    "velocity_slices",
]
