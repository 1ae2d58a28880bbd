"""Numbers from states and trajectories: run-out, repose, discharge, profiles, fields, energy.

Every function takes a `State` (or an iterable of states) and returns plain numbers, arrays or a
small frozen dataclass. No function changes its arguments.
"""

from granular.measure import soil_tools as soil_tools
from granular.measure.averages import Contour as Contour
from granular.measure.averages import GridField as GridField
from granular.measure.averages import centre_line_pressure as centre_line_pressure
from granular.measure.averages import contours as contours
from granular.measure.averages import frame_average as frame_average
from granular.measure.averages import speed_contours as speed_contours
from granular.measure.body import BodyMotion as BodyMotion
from granular.measure.body import MeanForce as MeanForce
from granular.measure.body import body_force as body_force
from granular.measure.body import body_motion as body_motion
from granular.measure.budget import StepBudget as StepBudget
from granular.measure.budget import step_budget as step_budget
from granular.measure.bulk import density_drift as density_drift
from granular.measure.bulk import disconnected_fraction as disconnected_fraction
from granular.measure.bulk import gap_fraction as gap_fraction
from granular.measure.bulk import ill_posed_fraction as ill_posed_fraction
from granular.measure.bulk import string_fraction as string_fraction
from granular.measure.cylinder import CylinderProfile as CylinderProfile
from granular.measure.cylinder import cylinder_profile as cylinder_profile
from granular.measure.discharge import BeverlooFit as BeverlooFit
from granular.measure.discharge import Discharge as Discharge
from granular.measure.discharge import MassHistory as MassHistory
from granular.measure.discharge import beverloo as beverloo
from granular.measure.discharge import discharge as discharge
from granular.measure.discharge import mass_history as mass_history
from granular.measure.displacement import displacement as displacement
from granular.measure.drum import DrumFlow as DrumFlow
from granular.measure.drum import drum_flow as drum_flow
from granular.measure.effective_opening import EffectiveOpening as EffectiveOpening
from granular.measure.energy import Energy as Energy
from granular.measure.energy import EnergyBudget as EnergyBudget
from granular.measure.energy import energy as energy
from granular.measure.energy import energy_budget as energy_budget
from granular.measure.fields import CellField as CellField
from granular.measure.fields import cell_average as cell_average
from granular.measure.fields import cell_density as cell_density
from granular.measure.fields import cell_density_percentile as cell_density_percentile
from granular.measure.fields import nodal_density as nodal_density
from granular.measure.fields import phase as phase
from granular.measure.fields import smooth as smooth
from granular.measure.heap import Repose as Repose
from granular.measure.heap import Runout as Runout
from granular.measure.heap import Surface as Surface
from granular.measure.heap import repose_angle as repose_angle
from granular.measure.heap import runout as runout
from granular.measure.heap import surface as surface
from granular.measure.hopper import HopperFlow as HopperFlow
from granular.measure.hopper import hopper_flow as hopper_flow
from granular.measure.kinetic import MassBalance as MassBalance
from granular.measure.kinetic import StressFreeError as StressFreeError
from granular.measure.kinetic import mass_balance_error as mass_balance_error
from granular.measure.kinetic import packing_fraction as packing_fraction
from granular.measure.kinetic import stress_free_error as stress_free_error
from granular.measure.layers import layer_height as layer_height
from granular.measure.layers import mean_pressure_error as mean_pressure_error
from granular.measure.layers import occupied_area as occupied_area
from granular.measure.layers import speed_percentile as speed_percentile
from granular.measure.opening import Opening as Opening
from granular.measure.profiles import Profile as Profile
from granular.measure.profiles import depth_average as depth_average
from granular.measure.profiles import friction_profile as friction_profile
from granular.measure.profiles import inertial_number as inertial_number
from granular.measure.profiles import profile as profile
from granular.measure.profiles import scaled_inertial_number as scaled_inertial_number
from granular.measure.profiles import velocity_profile as velocity_profile
from granular.measure.refinement import Extrapolation as Extrapolation
from granular.measure.refinement import richardson as richardson
from granular.measure.result import Result as Result
from granular.measure.slide import Deposit as Deposit
from granular.measure.slide import SlideHistory as SlideHistory
from granular.measure.slide import deposit as deposit
from granular.measure.slide import slide_history as slide_history
from granular.measure.stress import friction as friction
from granular.measure.traction import TractionProfile as TractionProfile
from granular.measure.traction import WallTraction as WallTraction
from granular.measure.traction import wall_traction as wall_traction
from granular.measure.wall import wall_force as wall_force
from granular.tools.docstrings import complete as _complete

_complete(
    __name__,
    {
        "opening": "Opening, optional\n    By default the opening of the scene.",
        "d": "float, optional\n    Grain diameter [m]; by default the material's.",
    },
)
