"""The friction law of steady shear flows, from the contacts of grains to the mu(I) rheology.

Hurley's thesis, chapter 4 (Hurley & Andrade 2015): the effective friction follows from the
dissipation at the contacts, ``mu = (Z phi/I) <Gamma>/Gamma~``. The frames come from
`granular.grain_scale.dem`, or from elsewhere as the same plain arrays.
"""

from granular.grain_scale.friction_law.contacts import Sample as Sample
from granular.grain_scale.friction_law.contacts import dissipation as dissipation
from granular.grain_scale.friction_law.contacts import sample as sample
from granular.grain_scale.friction_law.fits import CoordinationFit as CoordinationFit
from granular.grain_scale.friction_law.fits import PowerFit as PowerFit
from granular.grain_scale.friction_law.fits import fit_coordination as fit_coordination
from granular.grain_scale.friction_law.fits import fit_dissipation as fit_dissipation
from granular.grain_scale.friction_law.fits import fit_power as fit_power
from granular.grain_scale.friction_law.fits import fit_rheology as fit_rheology
from granular.grain_scale.friction_law.steady import SteadyShear as SteadyShear
from granular.grain_scale.friction_law.steady import average as average
from granular.grain_scale.friction_law.steady import steady_shear as steady_shear
from granular.tools.docstrings import complete as _complete

_complete(__name__, {"confidence": "float\n    Of the intervals, in (0, 1)."})
