"""Closed forms and reference solutions with which simulations are compared."""

from granular.theory.arching import CriticalOutlet as CriticalOutlet
from granular.theory.arching import arch_factor as arch_factor
from granular.theory.arching import critical_outlet as critical_outlet
from granular.theory.arching import flow_factor as flow_factor
from granular.theory.bearing import BearingCapacity as BearingCapacity
from granular.theory.bearing import bearing_capacity as bearing_capacity
from granular.theory.beverloo import beverloo_rate as beverloo_rate
from granular.theory.chute import ChuteFlow as ChuteFlow
from granular.theory.chute import chute_profile as chute_profile
from granular.theory.chute import chute_transient as chute_transient
from granular.theory.cohesion import CliffHeight as CliffHeight
from granular.theory.cohesion import UnconfinedStrength as UnconfinedStrength
from granular.theory.cohesion import cliff_height as cliff_height
from granular.theory.cohesion import unconfined_strength as unconfined_strength
from granular.theory.constitutive import APPENDIX_B_BREAKPOINTS as APPENDIX_B_BREAKPOINTS
from granular.theory.constitutive import ConstitutiveReference as ConstitutiveReference
from granular.theory.constitutive import Event as Event
from granular.theory.constitutive import (
    appendix_b_velocity_gradient as appendix_b_velocity_gradient,
)
from granular.theory.constitutive import elastic_stress_rate as elastic_stress_rate
from granular.theory.constitutive import plastic_shear_rate as plastic_shear_rate
from granular.theory.constitutive import reference as reference
from granular.theory.constitutive import stress_rate as stress_rate
from granular.theory.couette import CouetteFlow as CouetteFlow
from granular.theory.couette import couette_decay_length as couette_decay_length
from granular.theory.couette import couette_flow as couette_flow
from granular.theory.couette import couette_quasi_static as couette_quasi_static
from granular.theory.crater import crater_depth as crater_depth
from granular.theory.damped_waves import bar_restitution as bar_restitution
from granular.theory.damped_waves import wave_decay as wave_decay
from granular.theory.earth_pressure import EarthPressure as EarthPressure
from granular.theory.earth_pressure import earth_pressure as earth_pressure
from granular.theory.hencky import HenckyColumn as HenckyColumn
from granular.theory.hencky import StandingWave as StandingWave
from granular.theory.hencky import hencky_column as hencky_column
from granular.theory.hencky import standing_wave as standing_wave
from granular.theory.hopper import hourglass_rate as hourglass_rate
from granular.theory.hopper import janssen_pressure as janssen_pressure
from granular.theory.hopper import mass_flow_limit as mass_flow_limit
from granular.theory.hopper import rose_tanaka_factor as rose_tanaka_factor
from granular.theory.incline import InclineTransient as InclineTransient
from granular.theory.incline import bagnold_mean as bagnold_mean
from granular.theory.incline import bagnold_profile as bagnold_profile
from granular.theory.incline import bagnold_shape as bagnold_shape
from granular.theory.incline import transient as transient
from granular.theory.kinetic import CoupledShear as CoupledShear
from granular.theory.kinetic import compression_pressure as compression_pressure
from granular.theory.kinetic import compression_temperature as compression_temperature
from granular.theory.kinetic import coupled_shear as coupled_shear
from granular.theory.kinetic import gas_pressure as gas_pressure
from granular.theory.kinetic import granular_temperature as granular_temperature
from granular.theory.kinetic import (
    packing_fraction_of_inertial_number as packing_fraction_of_inertial_number,
)
from granular.theory.kinetic import radial_function as radial_function
from granular.theory.kinetic import shear_pressure as shear_pressure
from granular.theory.kinetic import shear_temperature as shear_temperature
from granular.theory.kinetic import temperature_coefficients as temperature_coefficients
from granular.theory.layer_waves import LayerWaves as LayerWaves
from granular.theory.layer_waves import layer_waves as layer_waves
from granular.theory.linear_waves import shear_wave_growth as shear_wave_growth
from granular.theory.linear_waves import shear_waves as shear_waves
from granular.theory.runout import RUNOUT_LAWS as RUNOUT_LAWS
from granular.theory.runout import Piece as Piece
from granular.theory.runout import RunoutLaw as RunoutLaw
from granular.theory.shallow import DamBreak as DamBreak
from granular.theory.shallow import SpreadingCap as SpreadingCap
from granular.theory.shallow import SpreadingEllipse as SpreadingEllipse
from granular.theory.shallow import dam_break as dam_break
from granular.theory.shallow import spreading_cap as spreading_cap
from granular.theory.shallow import spreading_ellipse as spreading_ellipse
from granular.theory.slide import block_runout as block_runout
from granular.theory.slide import sliding_earth_pressure as sliding_earth_pressure
from granular.theory.stopping import stopping_angle as stopping_angle
from granular.theory.stopping import stopping_height as stopping_height
from granular.theory.stopping import stopping_shape as stopping_shape
from granular.theory.well_posed import ill_posedness as ill_posedness
from granular.theory.well_posed import (
    scaled_inertial_number_of_slope as scaled_inertial_number_of_slope,
)
from granular.theory.well_posed import short_wave_growth as short_wave_growth
from granular.theory.well_posed import viscous_growth as viscous_growth
from granular.theory.well_posed import well_posed_range as well_posed_range
from granular.theory.well_posed import well_posed_slopes as well_posed_slopes
from granular.tools.docstrings import complete as _complete

_complete(
    __name__,
    {
        "gravity": "float\n    Magnitude of gravity [m/s2], > 0.",
        "restitution": "float\n    Effective coefficient of restitution, in [0, 1].",
    },
)
