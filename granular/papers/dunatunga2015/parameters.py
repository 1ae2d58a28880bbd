"""Tables 1 and 2: parameters of the material and of the runs."""

from __future__ import annotations

from granular import scenes
from granular.materials import glass_beads
from granular.mpm import schemes
from granular.papers.dunatunga2015.document import PAPER
from granular.papers.figure import Drawn
from granular.papers.runs import Runs


@PAPER.figure(
    "table_1",
    "parameters of the material",
    seconds=0.0,
    paper={"E [Pa]": 1e9, "nu": 0.3, "xi [sqrt(m/kg)]": 1.1233, "mu_s": 0.3819, "mu_2": 0.6435}
    | {"rho_s [kg/m3]": 2450.0, "rho_c [kg/m3]": 1500.0},
)
def table_1(runs: Runs) -> Drawn:
    """Numbers of `materials.glass_beads`."""
    grains = runs.grains(glass_beads)
    numbers = {"E [Pa]": grains.E, "nu": grains.nu, "xi [sqrt(m/kg)]": grains.xi}
    numbers |= {"mu_s": grains.mu_s, "mu_2": grains.mu_2}
    return Drawn({}, numbers | {"rho_s [kg/m3]": grains.rho_s, "rho_c [kg/m3]": grains.rho_c})


@PAPER.figure(
    "table_2",
    "cells and time steps of the scenes",
    seconds=0.0,
    paper={
        "cell of column_collapse at a = 2 [m]": 0.0125,
        "cell of column_collapse at a = 0.5 [m]": 0.00625,
        "cell of silo [m]": 0.01,
        "cell of hourglass [m]": 0.01,
        "cell of incline [m]": 0.005,
        "cell of slug [m]": 0.0083,
        "time step of the published scheme [s]": 3e-6,
    },
)
def table_2(runs: Runs) -> Drawn:
    """Default cells of the scenes; the figures take those of the document."""
    made = {
        "column_collapse at a = 2": scenes.column_collapse(aspect=2.0),
        "column_collapse at a = 0.5": scenes.column_collapse(aspect=0.5),
        "silo": scenes.silo(),
        "hourglass": scenes.hourglass(),
        "incline": scenes.incline(),
        "slug": scenes.slug(),
    }
    numbers = {f"cell of {name} [m]": scene.grid.cell for name, scene in made.items()}
    step = float(schemes.dunatunga_kamrin_2015.dt or 0.0)
    return Drawn({}, numbers | {"time step of the published scheme [s]": step})
