"""Pictures and movies with matplotlib: figures are objects, no global state is changed.

`view` and `view_movie` draw in 3D with pyvista, if it is installed.
"""

from granular.plot.canvas import Picture as Picture
from granular.plot.encoding import Movie as Movie
from granular.plot.encoding import check_movie as check_movie
from granular.plot.fields import QUANTITIES as QUANTITIES
from granular.plot.fields import Quantity as Quantity
from granular.plot.forces import force_distances as force_distances
from granular.plot.forces import force_distribution as force_distribution
from granular.plot.forces import force_histories as force_histories
from granular.plot.forces import force_networks as force_networks
from granular.plot.forces import pareto_front as pareto_front
from granular.plot.frame import frame as frame
from granular.plot.friction import friction_and_packing as friction_and_packing
from granular.plot.friction import friction_by_law as friction_by_law
from granular.plot.friction import friction_shares as friction_shares
from granular.plot.friction import scaling_of_dilation as scaling_of_dilation
from granular.plot.friction import scaling_of_dissipation as scaling_of_dissipation
from granular.plot.live import Live as Live
from granular.plot.movie import movie as movie
from granular.plot.scene import scene as scene
from granular.plot.view_3d import view as view
from granular.plot.view_3d import view_movie as view_movie
from granular.tools.docstrings import complete as _complete

_complete(__name__)
