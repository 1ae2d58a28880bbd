"""Hurley's thesis on forces between grains, the friction of inertial flows, and dilative flow by
SPH: `PAPER` has the figures, and these modules the functions that draw them.
"""

from granular.papers.hurley_thesis import channels as channels
from granular.papers.hurley_thesis import columns as columns
from granular.papers.hurley_thesis import dynamic_forces as dynamic_forces
from granular.papers.hurley_thesis import equations as equations
from granular.papers.hurley_thesis import friction as friction
from granular.papers.hurley_thesis import inclines as inclines
from granular.papers.hurley_thesis import intruder as intruder
from granular.papers.hurley_thesis import jet as jet
from granular.papers.hurley_thesis import parameters as parameters
from granular.papers.hurley_thesis import repose as repose
from granular.papers.hurley_thesis import static_forces as static_forces
from granular.papers.hurley_thesis import studies as studies
from granular.papers.hurley_thesis.document import PAPER as PAPER

PAPER.without("1.1", "the three length scales", "diagram")
PAPER.without("2.1", "the steps of the inference of forces", "diagram")
PAPER.without("2.2", "camera and loading device", "diagram")
PAPER.without(
    "2.3", "rubber cylinders under load, and their outlines", "not reproducible",
    "the images of the experiment are not published as data",
)  # fmt: skip
PAPER.without(
    "2.4", "centroids and contacts of the 34 cylinders", "not reproducible",
    "the 78 contacts were found in an image that is not published as data",
)  # fmt: skip
PAPER.without(
    "2.5", "strains of the cylinders by image correlation", "not reproducible",
    "the images of the experiment are not published as data",
)  # fmt: skip
PAPER.without(
    "2.6", "forces between the cylinders", "not reproducible",
    "they follow from the strains of figure 2.5, which are not published as data",
)  # fmt: skip
PAPER.without("2.7", "contacts between grains and with the boundary", "diagram")
PAPER.without("2.8", "unit vectors of a contact", "diagram")
PAPER.without("3.1", "terms of the balance of a grain", "diagram")
PAPER.without("3.3", "air table, discs and impactor", "diagram")
PAPER.without(
    "3.4", "strains of six discs by image correlation and by finite elements", "not reproducible",
    "neither the images nor the results of the finite elements are published as data, and the "
    "package has no deformable grains",
)  # fmt: skip
PAPER.without("3.6", "bed of discs and intruder", "diagram")
PAPER.without("4.1", "what the friction of a flow encodes", "diagram")
PAPER.without("4.2", "the two times of the inertial number", "diagram")
PAPER.without("5.1", "kernel, and particles of a boundary", "diagram")
PAPER.order(
    *("1.1", *(f"2.{k}" for k in range(1, 12))),
    *("3.1", "3.2", "3.3", "3.4", "3.5", "table_3.1", *(f"3.{k}" for k in range(6, 11))),
    *(f"4.{k}" for k in range(1, 9)),
    *("5.1", "5.2", "table_5.1", "5.3", "table_5.2", "5.4", "5.5", "table_5.3", "5.6"),
    *("table_5.4", "5.7", "table_5.5", "5.8", "5.9", "table_5.6", "5.10", "6.1", "6.2"),
)
