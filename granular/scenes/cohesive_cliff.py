"""A vertical cliff of cohesive material, in 2D."""

from __future__ import annotations

from typing import Any

from granular.materials import DruckerPrager, Material
from granular.model.fill import Fill
from granular.model.grid import Grid
from granular.mpm import schemes
from granular.mpm.schemes import Scheme
from granular.mpm.walls import Wall
from granular.scenes._build import HEADROOM, Parts, enough_cells, whole_cells
from granular.scenes._registry import scene_function
from granular.shapes import Box
from granular.tools.checks import positive

cohesive_soil = DruckerPrager(E=1e6, cohesion=400.0)
"""Soil whose cliffs fail between 16 and 18 cm of height by limit analysis."""


@scene_function("mpm")
def cohesive_cliff(
    *,
    height: float = 0.3,
    width: float = 0.3,
    floor: float = 0.3,
    cell: float = 0.0125,
    points_per_cell: int = 4,
    jitter: float = 0.0,
    gravity: float = 9.8,
    ramp: float = 0.2,
    duration: float = 1.0,
    material: Material = cohesive_soil,
    scheme: Scheme = schemes.default,
    seed: int = 0,
    **material_numbers: Any,
) -> Parts:
    """Vertical cliff of cohesive material on a rough floor, as gravity grows.

    All numbers are chosen here. The cliff has a smooth wall at its back, x = 0, and its face at
    x = `width`. It stands if it is low enough (`granular.theory.cliff_height`); else a wedge slides
    out of it. For experiments of this kind see Gans et al. 2023 (J. Fluid Mech. 959, A41).

    Parameters
    ----------
    height, width : float
        Height of the cliff and its extent from the wall to its face [m], whole cells. A wedge that
        slides is ``height tan(45 deg - phi/2)`` wide.
    floor : float
        Length of floor in front of the cliff [m]. Material beyond it leaves.
    gravity, ramp : float
        Magnitude [m/s2], which grows linearly from 0 in the time `ramp` [s]. The ramp should be
        longer than several periods of elastic waves, 4 height/c_w.
    {common}.
    """
    cell = positive("cell", cell)
    n_x, n_y = whole_cells("width", width, cell), whole_cells("height", height, cell)
    columns = n_x + enough_cells(positive("floor", floor), cell)
    return Parts(
        grid=Grid((0.0, 0.0), cell, (columns, n_y + HEADROOM), open_sides=frozenset({"x+"})),
        fills=(Fill(Box((0.0, 0.0), (n_x * cell, n_y * cell)), points_per_cell, jitter=jitter),),
        walls=(Wall(0, 0.0, kind="free_slip"), Wall(1, 0.0, kind="no_slip")),
    )
