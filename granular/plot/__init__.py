"""Pictures and movies with matplotlib: figures are objects, no global state is changed.

`view` draws 3D pictures with pyvista, if it is installed.
"""

from granular.plot.canvas import Picture
from granular.plot.curves import (
    ConstitutivePath,
    InclineFlow,
    figure_3,
    figure_5,
    figure_9,
    figure_10,
    figure_13,
)
from granular.plot.fields import QUANTITIES, Quantity
from granular.plot.forces import (
    force_distances,
    force_distribution,
    force_histories,
    force_networks,
    pareto_front,
)
from granular.plot.frame import frame
from granular.plot.friction import (
    friction_and_packing,
    friction_by_law,
    friction_shares,
    scaling_of_dilation,
    scaling_of_dissipation,
)
from granular.plot.movie import check_movie, movie
from granular.plot.phase_diagram import phase_diagram
from granular.plot.snapshots import figure_2, figure_4, figure_6, figure_7, figure_11
from granular.plot.space import view

__all__ = [
    "QUANTITIES",
    "ConstitutivePath",
    "InclineFlow",
    "Picture",
    "Quantity",
    "check_movie",
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
    "force_distances",
    "force_distribution",
    "force_histories",
    "force_networks",
    "frame",
    "friction_and_packing",
    "friction_by_law",
    "friction_shares",
    "movie",
    "pareto_front",
    "phase_diagram",
    "scaling_of_dilation",
    "scaling_of_dissipation",
    "view",
]
