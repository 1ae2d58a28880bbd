"""Figures of Dunatunga & Kamrin 2015, Continuum modelling and simulation of granular flows."""

from granular.plot.dunatunga_kamrin_2015.curves import ConstitutivePath as ConstitutivePath
from granular.plot.dunatunga_kamrin_2015.curves import InclineFlow as InclineFlow
from granular.plot.dunatunga_kamrin_2015.curves import figure_3 as figure_3
from granular.plot.dunatunga_kamrin_2015.curves import figure_5 as figure_5
from granular.plot.dunatunga_kamrin_2015.curves import figure_9 as figure_9
from granular.plot.dunatunga_kamrin_2015.curves import figure_10 as figure_10
from granular.plot.dunatunga_kamrin_2015.curves import figure_13 as figure_13
from granular.plot.dunatunga_kamrin_2015.snapshots import figure_2 as figure_2
from granular.plot.dunatunga_kamrin_2015.snapshots import figure_4 as figure_4
from granular.plot.dunatunga_kamrin_2015.snapshots import figure_6 as figure_6
from granular.plot.dunatunga_kamrin_2015.snapshots import figure_7 as figure_7
from granular.plot.dunatunga_kamrin_2015.snapshots import figure_11 as figure_11
