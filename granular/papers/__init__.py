"""The four documents that the package implements, figure by figure.

Each is a module with one function for each figure or table that contains data:

- `dunatunga2015`: Dunatunga & Kamrin (2015), Continuum modelling and simulation of granular flows
  through their many phases, J. Fluid Mech. 779, 483-513;
- `silo_clogging`: Dunatunga & Kamrin, Modelling silo clogging with nonlocal granular rheology;
- `haeri2021`: Haeri & Skonieczny (2021), Three-dimensional granular flow continuum modeling via
  material point method with hyperelastic nonlocal granular fluidity, arXiv:2111.01523;
- `hurley_thesis`: Hurley, thesis on the inference of forces, the friction of inertial flows and
  dilative viscoplastic flow by SPH.

The command ``granular figure`` draws them: ``granular figure dunatunga2015 5``.
"""

from granular.papers.catalogue import DOCUMENTS as DOCUMENTS
from granular.papers.catalogue import document as document
from granular.papers.catalogue import draw as draw
from granular.papers.figure import Document as Document
from granular.papers.figure import Drawn as Drawn
from granular.papers.figure import Equation as Equation
from granular.papers.figure import Figure as Figure
from granular.papers.runs import Settings as Settings


def __getattr__(name: str) -> object:
    """Import the module of a document when it is used first."""
    from importlib import import_module

    if name in DOCUMENTS:
        return import_module(f"granular.papers.{name}")
    raise AttributeError(f"module 'granular.papers' has no attribute {name!r}")
