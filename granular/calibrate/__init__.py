"""Numbers of materials from data: the mu(I) rheology from shear tests, others by simulations."""

from granular.calibrate.invert import Calibrated as Calibrated
from granular.calibrate.invert import invert as invert
from granular.calibrate.mu_I import MuIFit as MuIFit
from granular.calibrate.mu_I import PackingFit as PackingFit
from granular.calibrate.mu_I import fit_mu_I as fit_mu_I
from granular.calibrate.mu_I import fit_packing as fit_packing
from granular.tools.docstrings import complete as _complete

_complete(__name__)
