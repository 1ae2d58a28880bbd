"""Tables 5.1 to 5.3, 5.5 and 5.6: parameters of the simulations by SPH."""

from __future__ import annotations

import math
from collections.abc import Sequence

from granular import scenes, sph
from granular.papers.figure import Drawn, Number
from granular.papers.hurley_thesis import columns
from granular.papers.hurley_thesis.document import PAPER
from granular.papers.hurley_thesis.repose import PHIS
from granular.papers.hurley_thesis.studies import FRICTIONS, KAPPAS, SPACINGS
from granular.papers.runs import Runs
from granular.sph import Scene

GAMMA = 1.5
"""Exponent of the equation of state, which is fixed in the code (eq. 5.5)."""


def common(scene: Scene) -> dict[str, Number]:
    """Parameters that all tables list."""
    material = scene.material
    return {
        "rho0 [kg/m3]": material.rho0,
        "kappa [Pa]": material.kappa,
        "gamma": GAMMA,
        "cohesion [Pa]": material.cohesion,
        "spacing [m]": scene.grid.cell,
    }


THESIS: dict[str, Number] = {
    "rho0 [kg/m3]": 1550.0,
    "kappa [Pa]": 1e5,
    "gamma": GAMMA,
    "cohesion [Pa]": 0.0,
    "spacing [m]": 0.01,
}
"""Of tables 5.1, 5.2 and 5.6. Some tables print spacings in cm that are metres in the text."""


@PAPER.figure(
    "table_5.1",
    "parameters of the slopes",
    seconds=0.0,
    paper=THESIS | {"least friction": 0.364, "largest friction": 0.839},
)
def table_5_1(runs: Runs) -> Drawn:
    """Numbers of `scenes.slump_sph`; the friction at walls is that of the material."""
    least, largest = (scenes.slump_sph(phi_deg=phi) for phi in (PHIS[0], PHIS[-1]))
    frictions: dict[str, Number] = {
        "least friction": least.material.mu_l,
        "largest friction": largest.material.mu_l,
    }
    return Drawn({}, common(least) | frictions)


@PAPER.figure(
    "table_5.2",
    "parameters of the layers on inclines",
    seconds=0.0,
    paper=THESIS | {"mu_l": 0.268, "mu_h": 0.577, "D_star [1/s]": 20.0},
)
def table_5_2(runs: Runs) -> Drawn:
    """Numbers of `scenes.incline_sph`; the friction at walls is that of the material."""
    scene = scenes.incline_sph()
    rates: dict[str, Number] = {
        "mu_l": scene.material.mu_l,
        "mu_h": scene.material.mu_h,
        "D_star [1/s]": scene.material.D_star,
    }
    return Drawn({}, common(scene) | rates)


@PAPER.figure(
    "table_5.3",
    "parameters of the columns",
    seconds=0.0,
    paper={
        f"{name}, {material}": value
        for material, values in {
            "grit": (1404.0, 0.74, 0.335, 0.01),
            "glass": (1450.0, 0.456, 0.263, 0.005),
        }.items()
        for name, value in zip(
            ("rho0 [kg/m3]", "friction", "friction at walls", "spacing [m]"), values, strict=True
        )
    },
)
def table_5_3(runs: Runs) -> Drawn:
    """Numbers of `sph.grit` and `sph.glass`, and the spacings of figure 5.6."""
    numbers: dict[str, Number] = {}
    for name, grains in (("grit", sph.grit), ("glass", sph.glass)):
        numbers |= {
            f"rho0 [kg/m3], {name}": grains.rho0,
            f"friction, {name}": grains.mu_l,
            f"friction at walls, {name}": grains.mu_wall or math.nan,
            f"spacing [m], {name}": columns.SPACINGS[name],
        }
    return Drawn({}, numbers)


@PAPER.figure(
    "table_5.5",
    "parameters of the studies",
    seconds=0.0,
    paper={
        "rho0 [kg/m3]": 1404.0,
        "kappas [Pa]": "100000, 1e+06, 1e+07",
        "frictions": "0.74, 0.87, 0.625",
        "frictions at walls": "0.335, 0.364, 0.305",
        "spacings [m]": "0.01, 0.005, 0.0025",
    },
)
def table_5_5(runs: Runs) -> Drawn:
    """Parameters of figure 5.7, which changes one at a time."""
    frictions, at_walls = zip(*FRICTIONS, strict=True)
    return Drawn(
        {},
        {
            "rho0 [kg/m3]": sph.grit.rho0,
            "kappas [Pa]": listed(KAPPAS),
            "frictions": listed(frictions),
            "frictions at walls": listed(at_walls),
            "spacings [m]": listed(SPACINGS),
        },
    )


def listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


@PAPER.figure(
    "table_5.6",
    "parameters of the inclined collapses",
    seconds=0.0,
    paper=THESIS | {"friction": 0.435, "friction at walls": 0.435},
)
def table_5_6(runs: Runs) -> Drawn:
    """Numbers of `scenes.inclined_collapse`."""
    scene = scenes.inclined_collapse()
    material = scene.material
    at_walls = material.mu_l if material.mu_wall is None else material.mu_wall
    frictions: dict[str, Number] = {"friction": material.mu_l, "friction at walls": at_walls}
    return Drawn({}, common(scene) | frictions)
