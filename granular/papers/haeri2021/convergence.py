"""Figure 8: errors against the size of the cells, between cylinders and in excavation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from granular.materials import couette_beads, grc_1
from granular.papers.figure import Drawn
from granular.papers.haeri2021.blades import (
    BED,
    FINE,
    QUICK,
    THIN,
    blade_scene,
    forces_on_width,
)
from granular.papers.haeri2021.cylinders import COARSE, CylinderFlow, recorded_flow
from granular.papers.haeri2021.document import EVERY, PAPER, SCHEMES, chosen_scheme, soft_soil
from granular.papers.runs import Runs
from granular.plot.canvas import Picture
from granular.scenes import excavation

FLOW = {"height": 0.024, "duration": 0.7}
CELLS = {"quick": (0.012,), "normal": (0.012, 0.008, 0.006), "full": (0.012, 0.008, 0.006, 0.004)}
"""Cells between cylinders by the size of the figure [m]; the document's are the smallest."""
POINTS = 8
"""Points per cell."""


@PAPER.figure(
    "8",
    "error of the profile between cylinders and of the force on a blade, against dx/(d ppc)",
    seconds=185.0,
    paper={
        "mean error between cylinders at dx/(d ppc) = 0.25, against the experiment [%]": 0.9,
        "error of the force at dx/(d ppc) = 1.375, against the experiment [%]": -0.5,
        "error of the force at dx/(d ppc) = 13.3, against the experiment [%]": 15.8,
    },
    schemes=SCHEMES,
)
def convergence(runs: Runs) -> Drawn:
    """Measure the profile against the slow limit, and the force against that in the finest cells.

    The document measures both against experiments that it prints as figures; the abscissas of its
    errors are those of its table 2. The force is that of a blade between walls as it arrives at 5
    cm.
    """
    profile, force = flow_errors(runs), blade_errors(runs)
    numbers = {
        f"mean error between cylinders at dx/(d ppc) = {x:.3g} [%]": error
        for x, error in profile.items()
    }
    numbers |= {
        f"error of the force on the blade, {label}, at dx/(d ppc) = {x:.3g} [%]": error
        for label, (x, error) in force.items()
    }
    return Drawn({"": figure_8(profile, force)}, numbers)


def flow_errors(runs: Runs) -> dict[float, float]:
    """Mean errors of the profile [% of the speed of the wall] by dx/(d ppc)."""
    errors, size = {}, COARSE if runs.quick else FLOW
    for cell in CELLS[runs.settings.size]:
        name = f"couette_shallow_{1e3 * cell:g}"
        with recorded_flow(runs, name, **(size | {"cell": cell})) as record:
            flow = CylinderFlow.measured(record)
        errors[cell / (couette_beads.d * POINTS)] = 100 * float(flow.errors(flow.slow).mean())
    return errors


def blade_errors(runs: Runs) -> dict[str, tuple[float, float]]:
    """dx/(d ppc) and errors of the force [%], by what has changed from the finest cells."""
    coarse = {"cell": 2 * BED["cell"]}
    cases: dict[str, tuple[str, dict[str, Any], int]] = {
        "cells of 25 mm": ("thin_5_coarse", coarse, POINTS),
        "cells of 12.5 mm": ("thin_5", {}, POINTS),
        "one point a cell": ("thin_5_one", {"points_per_cell": 1}, 1),
        "finest": ("thin_5_fine", FINE, POINTS),
    }
    if runs.quick:  # the finest cells take twenty times as long as the next
        cases["finest"] = cases.pop("cells of 12.5 mm")
    forces = {}
    for label, (name, changes, ppc) in cases.items():
        scene = blade_scene(
            0.05,
            material=soft_soil(runs),
            scheme=chosen_scheme(runs, excavation().scheme),
            **(THIN | changes | (QUICK if runs.quick else {})),
        )
        with runs.record(scene, name, every=EVERY, precision="single") as record:
            size = scene.grid.cell / (grc_1.d * ppc)
            forces[label] = size, forces_on_width(record).arrival()[0]
    finest = forces.pop("finest")[1]
    return {label: (size, 100 * (force / finest - 1)) for label, (size, force) in forces.items()}


def figure_8(profile: Mapping[float, float], force: Mapping[str, tuple[float, float]]) -> Picture:
    """Absolute errors on logarithmic axes."""
    picture = Picture(figsize=(5.0, 3.4), layout="compressed")
    ax = picture.subplots()
    ax.loglog(list(profile), list(profile.values()), "s", label="between cylinders")
    for k, (label, (size, error)) in enumerate(force.items()):
        ax.loglog(size, np.abs(error), "dv^"[k], color="C1", label=f"blade, {label}")
    ax.set(xlabel="dx/(d ppc)", ylabel="error [%]")
    ax.legend()
    return picture
