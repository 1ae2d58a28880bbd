"""Tables 1 and 2: parameters of the materials, and specifications of the runs."""

from __future__ import annotations

from collections.abc import Mapping

from granular import scenes
from granular.economy.cost import time_step
from granular.materials import NGF, couette_beads, grc_1
from granular.mpm.scene import Scene
from granular.papers.figure import Drawn, Number, labelled
from granular.papers.haeri2021 import wheels
from granular.papers.haeri2021.blades import BED
from granular.papers.haeri2021.buckets import excavator_scene
from granular.papers.haeri2021.cylinders import COARSE, LOW
from granular.papers.haeri2021.document import PAPER, soft_soil, softened
from granular.papers.haeri2021.silos import silo_scene
from granular.papers.runs import Runs

MATERIALS: Mapping[str, NGF] = {"soil": grc_1, "beads": couette_beads}
PRINTED = {
    "soil": {
        **{"S [MPa]": 5.8, "B [MPa]": 12.5, "rho_s [kg/m3]": 2583.0, "d [mm]": 0.3, "t0 [s]": 1e-4},
        **{"A": 0.48, "I0": 0.278, "mu_s": 0.70, "mu_2": 0.96},
    },
    "beads": {
        **{"S [MPa]": 1.0, "B [MPa]": 10.0, "rho_s [kg/m3]": 2550.0, "d [mm]": 4.0, "t0 [s]": 1e-4},
        **{"A": 0.48, "I0": 0.278, "mu_s": 0.38, "mu_2": 0.64},
    },
}
"""Table 1: its first and second set."""
RUNS = {
    "cylinders": {"E [MPa]": 3.0, "dt [s]": 1e-4, "dx [mm]": 4.0, "points": 500e3, "in a cell": 4},
    "excavation": {
        "E [MPa]": 15.0,
        "dt [s]": 4e-5,
        "dx [mm]": 3.3,
        "points": 230e3,
        "in a cell": 8,
    },
    "wheel": {"E [MPa]": 15.0, "dt [s]": 1e-5, "dx [mm]": 3.3, "points": 50e3, "in a cell": 4},
    "excavator": {"E [MPa]": 0.15, "dt [s]": 1e-4, "dx [mm]": 3.3, "points": 256e3, "in a cell": 8},
    "silo": {"E [MPa]": 0.15, "dt [s]": 1e-4, "dx [mm]": 4.0, "points": 32e3, "in a cell": 8},
}
"""Table 2, without its times."""


@PAPER.figure(
    "table_1",
    "parameters of soil and beads",
    seconds=0.0,
    paper=labelled(PRINTED),
)
def table_1(runs: Runs) -> Drawn:
    """Numbers of `materials.grc_1` and `couette_beads`, and what is different in the figures."""
    numbers: dict[str, Number] = {}
    for label, material in MATERIALS.items():
        values = (
            *(material.G / 1e6, material.K / 1e6, material.rho_s, 1e3 * material.d, material.t0),
            *(material.A, material.I0, material.mu_s, material.mu_2),
        )
        names = PRINTED[label]
        numbers |= {f"{n}, {label}": float(v) for n, v in zip(names, values, strict=True)}
        soft = soft_soil(runs) if material is grc_1 else softened(runs, material)
        numbers[f"S in the figures, {label} [MPa]"] = soft.G / 1e6
        numbers[f"B in the figures, {label} [MPa]"] = soft.K / 1e6
        numbers[f"t0 in the figures, {label} [s]"] = soft.t0
    return Drawn({}, numbers)


@PAPER.figure(
    "table_2",
    "modulus, time step, cells and points of the runs",
    seconds=15.0,
    paper=labelled(RUNS),
)
def table_2(runs: Runs) -> Drawn:
    """Specifications of the figures in their normal size.

    The cells and moduli of the document's excavation, wheel and excavator are those of a model at a
    quarter of the size: 3.3 mm are 13.2 mm of the experiment, which the scenes here have. Its times
    are those of four cores; figures 8, 9 and 13 have its errors.
    """
    soil, cell = soft_soil(runs), COARSE if runs.quick else LOW
    made = {
        "cylinders": scenes.couette(material=softened(runs, couette_beads), **cell),
        "excavation": scenes.excavation(material=soil, cell=BED["cell"]),
        "wheel": wheels.wheel_scene(20, material=soil, **wheels.COARSE),
        "excavator": excavator_scene(runs),
        "silo": silo_scene(runs),
    }
    return Drawn({}, labelled({label: specifications(scene) for label, scene in made.items()}))


def specifications(scene: Scene) -> dict[str, float]:
    """Numbers of table 2 of a scene."""
    return {
        "E [MPa]": scene.material.E / 1e6,
        "dt [s]": time_step(scene),
        "dx [mm]": 1e3 * scene.grid.cell,
        "points": float(scene.n_points),
        "in a cell": float(scene.parameters["points_per_cell"] or 2**scene.dim),
    }
