"""Table 1: parameters of the material."""

from __future__ import annotations

from granular.materials import silo_grains
from granular.papers.figure import Drawn
from granular.papers.runs import Runs
from granular.papers.silo_clogging.document import PAPER

PUBLISHED = {
    "E [Pa]": 1e6,
    "nu": 0.45,
    "mu_s": 0.3819,
    "mu_2": 50.0,
    "t0 [s]": 1e-3,
    "rho_s [kg/m3]": 2450.0,
    "rho_c [kg/m3]": 1500.0,
    "b": 1.0,
}


@PAPER.figure("table_1", "parameters of the material", seconds=0.0, paper=PUBLISHED)
def table_1(runs: Runs) -> Drawn:
    """Numbers of the default material of `scenes.clogging_silo`."""
    grains = runs.grains(silo_grains)
    return Drawn({}, {name: getattr(grains, name.partition(" ")[0]) for name in PUBLISHED})
