"""Comparison with data of other authors: experiments, other methods and closed forms.

Each case is a module with a function that runs it and one that draws it, registered by `case`.
The data are in `granular/verify/data`; the header of each file has source, units and uncertainties.
Numbers that a header calls inferred or recalled are only reported.
"""

# The modules register their cases on import; this is the order of the table.
from granular.verify.external import bagnold, columns, runout_laws, shallow, limit_analysis, hstop  # isort: skip  # noqa: F401
from granular.verify.external.frame import Case as Case
from granular.verify.external.frame import Comparison as Comparison
from granular.verify.external.frame import Data as Data
from granular.verify.external.frame import Outcome as Outcome
from granular.verify.external.frame import below as below
from granular.verify.external.frame import case as case
from granular.verify.external.frame import cases as cases
from granular.verify.external.frame import load as load
from granular.verify.external.frame import main as main
from granular.verify.external.frame import near as near
