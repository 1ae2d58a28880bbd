"""Figures of Dunatunga & Kamrin 2015, Continuum modelling and simulation of granular flows."""

from granular.plot.dunatunga_kamrin_2015.curves import (
    ConstitutivePath,
    InclineFlow,
    figure_3,
    figure_5,
    figure_9,
    figure_10,
    figure_13,
)
from granular.plot.dunatunga_kamrin_2015.snapshots import (
    figure_2,
    figure_4,
    figure_6,
    figure_7,
    figure_11,
)

__all__ = [
    "ConstitutivePath",
    "InclineFlow",
    "figure_2",
    "figure_3",
    "figure_4",
    "figure_5",
    "figure_6",
    "figure_7",
    "figure_9",
    "figure_10",
    "figure_11",
    "figure_13",
]
