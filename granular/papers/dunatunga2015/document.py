"""The document and the schemes with which its figures are drawn."""

from functools import partial

from granular.mpm import schemes
from granular.papers.figure import Document

PAPER = Document(
    "dunatunga2015",
    "S. Dunatunga & K. Kamrin (2015), Continuum modelling and simulation of granular flows through "
    "their many phases, J. Fluid Mech. 779, 483-513",
    E=1e9,
)
"""The document, with its figures, tables and equations."""
SCHEMES = {
    "default": schemes.default,
    # The published step of 3e-6 s is for 1 GPa; softer material does not need so small a one.
    "published": schemes.dunatunga_kamrin_2015.replace(dt=None),
}
E = 1e7
"""Young's modulus of the figures [Pa]: that of the document is a hundred times as large."""
QUICK_E = 1e6
figure_of_runs = partial(PAPER.figure, E=E, quick_E=QUICK_E, schemes=SCHEMES)
"""Registers a figure whose runs may have another Young's modulus, or another of the schemes."""
