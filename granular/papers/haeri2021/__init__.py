"""Haeri & Skonieczny (2021), Three-dimensional granular flow continuum modeling via material point
method with hyperelastic nonlocal granular fluidity: `PAPER` has the figures, and these modules the
functions that draw them.
"""

from granular.papers.haeri2021 import blades as blades
from granular.papers.haeri2021 import buckets as buckets
from granular.papers.haeri2021 import convergence as convergence
from granular.papers.haeri2021 import cylinders as cylinders
from granular.papers.haeri2021 import equations as equations
from granular.papers.haeri2021 import excavation as excavation
from granular.papers.haeri2021 import failure as failure
from granular.papers.haeri2021 import parameters as parameters
from granular.papers.haeri2021 import profiles as profiles
from granular.papers.haeri2021 import published_step as published_step
from granular.papers.haeri2021 import silos as silos
from granular.papers.haeri2021 import strains as strains
from granular.papers.haeri2021 import wheels as wheels
from granular.papers.haeri2021.document import PAPER as PAPER

for _name, _title in {
    "2": "the steps of the method",
    "3": "the four states of a point, by its pressure before and after a step",
    "4": "the steps of the law, as a diagram and as pseudocode",
    "5": "trial state of the stress, and the states of a point on the curve of logarithmic strain",
    "11": "the excavation rig, a photograph",
    "16": "the wheel rig, a photograph, and its model",
}.items():
    PAPER.without(_name, _title, "diagram")
PAPER.order(
    *("1", "2", "3", "4", "5", "table_1", "table_2", "6", "7", "8", "9", "10", "11", "12", "13"),
    *("14", "15", "16", "17", "18", "19", "published_step"),
)
