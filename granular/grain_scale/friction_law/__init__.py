"""The friction law of steady shear flows, from the contacts of grains to the mu(I) rheology.

Hurley's thesis, chapter 4 (Hurley & Andrade 2015): the effective friction follows from the
dissipation at the contacts, ``mu = (Z phi/I) <Gamma>/Gamma~``. The frames come from
`granular.grain_scale.dem`, or from elsewhere as the same plain arrays.
"""

from granular.grain_scale.friction_law.contacts import Sample, dissipation, sample
from granular.grain_scale.friction_law.fits import (
    CoordinationFit,
    MuIFit,
    PackingFit,
    PowerFit,
    fit_coordination,
    fit_dissipation,
    fit_mu_I,
    fit_packing,
    fit_power,
    fit_rheology,
)
from granular.grain_scale.friction_law.steady import SteadyShear, average, steady_shear

__all__ = [
    "CoordinationFit",
    "MuIFit",
    "PackingFit",
    "PowerFit",
    "Sample",
    "SteadyShear",
    "average",
    "dissipation",
    "fit_coordination",
    "fit_dissipation",
    "fit_mu_I",
    "fit_packing",
    "fit_power",
    "fit_rheology",
    "sample",
    "steady_shear",
]
