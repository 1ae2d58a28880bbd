"""The document and the schemes with which its figures are drawn."""

from functools import partial

from granular.mpm.schemes import ParticleDensity, Scheme
from granular.papers.figure import Document
from granular.scenes.silo import linear_flip

PAPER = Document(
    "silo_clogging",
    "S. Dunatunga & K. Kamrin, Modelling silo clogging with nonlocal granular rheology",
    E=1e6,
)
"""The document, with its figures, tables and equations."""
SCHEMES = {
    "published": linear_flip,
    "splines": Scheme(basis="quadratic", transfer="tpic", density=ParticleDensity(), dt=1e-4),
}
E = 1e6
"""Young's modulus of the silos [Pa], that of the document."""
figure_of_runs = partial(PAPER.figure, E=E, schemes=SCHEMES)
"""Registers a figure whose runs may have another Young's modulus, or another of the schemes."""
