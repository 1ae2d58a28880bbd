"""Numbers from states and trajectories: run-out, repose, discharge, profiles, fields, energy.

Every function takes a `State` (or an iterable of states) and returns plain numbers, arrays or a
small frozen dataclass. No function changes its arguments.
"""

from granular.measure import silo_clogging, soil_tools
from granular.measure.averages import (
    Contour,
    GridField,
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
from granular.measure.stress import friction

__all__ = [
    "BeverlooFit",
    "BodyForce",
    "BodyMotion",
    "CellField",
    "Contour",
    "CylinderProfile",
    "Discharge",
    "Energy",
    "EnergyBudget",
    "GridField",
    "MassBalance",
    "MassHistory",
    "Opening",
    "Profile",
    "Repose",
    "Runout",
    "StepBudget",
    "StressFreeError",
    "Surface",
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
    "frame_average",
    "friction",
    "friction_profile",
    "gap_fraction",
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
    "silo_clogging",
    "smooth",
    "soil_tools",
    "speed_contours",
    "speed_percentile",
    "step_budget",
    "stress_free_error",
    "surface",
    "velocity_profile",
]
