"""Pictures and movies with matplotlib: figures are objects, no global state is changed.

`view` draws 3D pictures with pyvista, if it is installed.
"""

from granular.plot import dunatunga_kamrin_2015, silo_clogging
from granular.plot.canvas import Picture
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
from granular.plot.view_3d import view

__all__ = [
    "QUANTITIES",
    "Picture",
    "Quantity",
    "check_movie",
    "dunatunga_kamrin_2015",
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
    "scaling_of_dilation",
    "scaling_of_dissipation",
    "silo_clogging",
    "view",
]
