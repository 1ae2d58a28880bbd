"""Dunatunga & Kamrin (2015), Continuum modelling and simulation of granular flows through their
many phases: `PAPER` has the figures, and these modules the functions that draw them.
"""

from granular.papers.dunatunga2015 import columns as columns
from granular.papers.dunatunga2015 import equations as equations
from granular.papers.dunatunga2015 import hourglasses as hourglasses
from granular.papers.dunatunga2015 import inclines as inclines
from granular.papers.dunatunga2015 import parameters as parameters
from granular.papers.dunatunga2015 import silos as silos
from granular.papers.dunatunga2015 import slug as slug
from granular.papers.dunatunga2015 import stress_update as stress_update
from granular.papers.dunatunga2015 import volumes as volumes
from granular.papers.dunatunga2015.document import PAPER as PAPER

PAPER.without("1", "the steps of the explicit method", "diagram")
PAPER.without("8", "axes and boundaries of the inclines", "diagram")
PAPER.order(
    *("1", "table_1", "table_2", "2", "3", "table_3", "4", "5", "6", "7", "8", "9", "10"),
    *("11", "12", "13"),
)
