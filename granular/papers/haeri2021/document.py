"""The document, and the materials and schemes with which its figures are drawn."""

from __future__ import annotations

from functools import partial
from typing import TypeVar

from granular.materials import NGF, HardeningDruckerPrager, couette_beads, grc_1
from granular.mpm.schemes import ParticleDensity, Scheme
from granular.papers.figure import Document
from granular.papers.runs import Runs
from granular.scenes._build import PROMPT

PAPER = Document(
    "haeri2021",
    "A. Haeri & K. Skonieczny (2021), Three-dimensional granular flow continuum modeling via "
    "material point method with hyperelastic nonlocal granular fluidity, arXiv:2111.01523",
    E=grc_1.E,
)
SOFTER = 100.0
"""Young's moduli of the document divided by those of the figures. The document itself takes a
hundredth in its fast excavation, whose force has an error of 15.8 %."""
SOIL_E, BEADS_E = grc_1.E / SOFTER, couette_beads.E / SOFTER
SCHEMES = ("default", "published")
figure_of_runs = partial(PAPER.figure, E=SOIL_E, schemes=SCHEMES)
"""Registers a figure whose runs may have another Young's modulus, or another of the schemes."""
EVERY = 0.1
"""Time between the frames of records [s]."""
M = TypeVar("M", NGF, HardeningDruckerPrager)


def softened(runs: Runs, published: M) -> M:
    """Material with the modulus of the figure: by default a hundredth of the document's.

    A tolerance starts from the published modulus.
    """
    if runs.settings.tolerance is not None and runs.settings.E is None:
        runs.materials.append(published)
        return published
    return runs.grains(published.replace(E=published.E / SOFTER))


def soft_soil(runs: Runs, published: NGF = grc_1) -> NGF:
    """The same of the soil, whose fluidity then responds within a step.

    The time steps, which become ten times as long, do not resolve the document's 1e-4 s. A time t0
    far below a step is of no harm here, where A d is a ninetieth of a cell. Between cylinders,
    where it is half a cell, the steps of diffusion and reaction would no longer add up to a flow of
    the law: the error of the profile becomes ten times as large.
    """
    soil = softened(runs, published)
    return soil if soil.E == published.E else soil.replace(t0=PROMPT)


def chosen_scheme(runs: Runs, own: Scheme) -> Scheme:
    """Scheme of a scene, or the published one: APIC, with the density of each point by itself."""
    published = own.replace(transfer="apic", density=ParticleDensity())
    return runs.choose(dict(zip(SCHEMES, (own, published), strict=True)))
