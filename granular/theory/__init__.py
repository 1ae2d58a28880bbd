"""Closed forms and reference solutions with which simulations are compared."""

from granular.theory.beverloo import beverloo_rate
from granular.theory.chute import ChuteFlow, chute_profile, chute_transient
from granular.theory.constitutive import (
    APPENDIX_B_BREAKPOINTS,
    ConstitutiveReference,
    Event,
    appendix_b_velocity_gradient,
    elastic_stress_rate,
    plastic_shear_rate,
    reference,
    stress_rate,
)
from granular.theory.couette import (
    CouetteFlow,
    couette_decay_length,
    couette_flow,
    couette_quasi_static,
)
from granular.theory.hencky import HenckyColumn, StandingWave, hencky_column, standing_wave
from granular.theory.incline import (
    InclineTransient,
    bagnold_mean,
    bagnold_profile,
    bagnold_shape,
    transient,
)
from granular.theory.kinetic import (
    CoupledShear,
    compression_pressure,
    compression_temperature,
    coupled_shear,
    gas_pressure,
    granular_temperature,
    packing_fraction_of_inertial_number,
    radial_function,
    shear_pressure,
    shear_temperature,
    temperature_coefficients,
)
from granular.theory.layer_waves import LayerWaves, layer_waves
from granular.theory.runout import RUNOUT_LAWS, Piece, RunoutLaw
from granular.theory.stopping import stopping_angle, stopping_height, stopping_shape
from granular.theory.well_posed import (
    ill_posedness,
    scaled_inertial_number_of_slope,
    well_posed_range,
    well_posed_slopes,
)

__all__ = [
    "APPENDIX_B_BREAKPOINTS",
    "RUNOUT_LAWS",
    "ChuteFlow",
    "ConstitutiveReference",
    "CouetteFlow",
    "CoupledShear",
    "Event",
    "HenckyColumn",
    "InclineTransient",
    "LayerWaves",
    "Piece",
    "RunoutLaw",
    "StandingWave",
    "appendix_b_velocity_gradient",
    "bagnold_mean",
    "bagnold_profile",
    "bagnold_shape",
    "beverloo_rate",
    "chute_profile",
    "chute_transient",
    "compression_pressure",
    "compression_temperature",
    "couette_decay_length",
    "couette_flow",
    "couette_quasi_static",
    "coupled_shear",
    "elastic_stress_rate",
    "gas_pressure",
    "granular_temperature",
    "hencky_column",
    "ill_posedness",
    "layer_waves",
    "packing_fraction_of_inertial_number",
    "plastic_shear_rate",
    "radial_function",
    "reference",
    "scaled_inertial_number_of_slope",
    "shear_pressure",
    "shear_temperature",
    "standing_wave",
    "stopping_angle",
    "stopping_height",
    "stopping_shape",
    "stress_rate",
    "temperature_coefficients",
    "transient",
    "well_posed_range",
    "well_posed_slopes",
]
