"""Numbers from states and trajectories: run-out, repose, discharge, profiles, fields, energy.

Every function takes a `State` (or an iterable of states) and returns plain numbers, arrays or a
small frozen dataclass. No function changes its arguments.
"""

from granular.measure.arch import Arch, arch_outline
from granular.measure.averages import (
    Contour,
    LatticeField,
    centre_line_pressure,
    contours,
    frame_average,
    speed_contours,
)
from granular.measure.body import BodyForce, BodyMotion, body_force, body_motion
from granular.measure.budget import StepBudget, step_budget
from granular.measure.bulk import (
    density_drift,
    disconnected_fraction,
    gap_fraction,
    ill_posed_fraction,
)
from granular.measure.cylinder import CylinderProfile, cylinder_profile
from granular.measure.discharge import (
    BeverlooFit,
    Discharge,
    MassHistory,
    beverloo,
    discharge,
    mass_history,
)
from granular.measure.energy import Energy, EnergyBudget, energy, energy_budget
from granular.measure.fields import (
    CellField,
    cell_average,
    cell_density,
    cell_density_percentile,
    nodal_density,
    phase,
    smooth,
)
from granular.measure.flow_threshold import FlowThreshold, flow_threshold
from granular.measure.heap import Repose, Runout, Surface, repose_angle, runout, surface
from granular.measure.kinetic import (
    MassBalance,
    StressFreeError,
    mass_balance_error,
    packing_fraction,
    stress_free_error,
)
from granular.measure.layers import (
    layer_height,
    mean_pressure_error,
    occupied_area,
    speed_percentile,
)
from granular.measure.opening import Opening
from granular.measure.profiles import (
    Profile,
    depth_average,
    friction_profile,
    inertial_number,
    profile,
    scaled_inertial_number,
    velocity_profile,
)
from granular.measure.silo_flow import FlowVerdict, SiloHistory, flow_verdict, silo_history
from granular.measure.stress import friction
from granular.measure.tools import (
    FailureSurface,
    StrainHistory,
    ToolForce,
    WheelHistory,
    failure_surface,
    strain_history,
    tool_force,
    wheel_history,
)
from granular.measure.velocity_slices import (
    GaussianFit,
    VelocitySlices,
    gaussian_fit,
    velocity_slices,
)

__all__ = [
    "Arch",
    "BeverlooFit",
    "BodyForce",
    "BodyMotion",
    "CellField",
    "Contour",
    "CylinderProfile",
    "Discharge",
    "Energy",
    "EnergyBudget",
    "FailureSurface",
    "FlowThreshold",
    "FlowVerdict",
    "GaussianFit",
    "LatticeField",
    "MassBalance",
    "MassHistory",
    "Opening",
    "Profile",
    "Repose",
    "Runout",
    "SiloHistory",
    "StepBudget",
    "StrainHistory",
    "StressFreeError",
    "Surface",
    "ToolForce",
    "VelocitySlices",
    "WheelHistory",
    "arch_outline",
    "beverloo",
    "body_force",
    "body_motion",
    "cell_average",
    "cell_density",
    "cell_density_percentile",
    "centre_line_pressure",
    "contours",
    "cylinder_profile",
    "density_drift",
    "depth_average",
    "discharge",
    "disconnected_fraction",
    "energy",
    "energy_budget",
    "failure_surface",
    "flow_threshold",
    "flow_verdict",
    "frame_average",
    "friction",
    "friction_profile",
    "gap_fraction",
    "gaussian_fit",
    "ill_posed_fraction",
    "inertial_number",
    "layer_height",
    "mass_balance_error",
    "mass_history",
    "mean_pressure_error",
    "nodal_density",
    "occupied_area",
    "packing_fraction",
    "phase",
    "profile",
    "repose_angle",
    "runout",
    "scaled_inertial_number",
    "silo_history",
    "smooth",
    "speed_contours",
    "speed_percentile",
    "step_budget",
    "strain_history",
    "stress_free_error",
    "surface",
    "tool_force",
    "velocity_profile",
    "velocity_slices",
    "wheel_history",
]
