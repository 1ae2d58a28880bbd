"""The indicators of failure that runs of all methods have: names, limits and meanings."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple

from granular.materials.own import OwnLaw

if TYPE_CHECKING:
    from granular.model.scene import BaseScene


class Row(NamedTuple):
    """An indicator of a scene.

    Attributes
    ----------
    name : str
    how : {"later", "largest"}
        Its value is the median of the later half of the samples, or the largest number so far.
    limit : float or None
        The largest value that is "ok"; None for an indicator that is only reported.
    doc : str
        Definition, and the meaning of a value beyond the limit.
    """

    name: str
    how: str
    limit: float | None
    doc: str


MACH = 0.5
"""Ratio of the largest speed to that of waves above which a run is suspect. Where such material is
stopped the density rises by about this fraction; in SPH, as
(v/c)^2/2 = (2 sqrt(r) + 1/r - 3)/1.5 for the ratio r of the densities. The ready scenes have 0.1
at most."""

DENSEST = 0.3
"""Largest log-density of grains: ln(0.74/0.55), from the random loose to the densest packing of
spheres. That of the ready scenes is 0.15 at most, under a wheel on sand of E = 0.15 MPa."""

TWICE = math.log(2.0)
"""Largest log-density of other materials, and the least of elastic bodies: twice or half of the
density at rest. The meaning of rho_c in a user-defined law depends on the law."""

LOOSEST = math.log(1e6)
"""Largest negative log-density of material that may fly apart: the density of air over that of sand
is 1e-3, that of a spray that has become a hundred times as wide 1e-6. The ready scenes have 2.5."""

ENERGY = 0.05
"""Largest energy created that is ok, over the first energy and the sum of all work.

The limit separates sound runs from unsound ones: linear FLIP on an incline has 1e-6 up to c dt/dx =
0.7 and 0.006 at 0.85, but 0.3 from 0.9 on, where it is unstable; ready scenes have up to 0.04. By
an account of every step, the sources there are the relaxation of the density, p dc, of
over-compressed material (obstacle, 0.04), and quadrature weights whose descent overshoots in cells
that hold half as much again as a full cell."""


def common(scene: BaseScene, limited: Collection[str]) -> tuple[Row, ...]:
    """Indicators of any scene; those that are not `limited`, by their names, have no limit."""
    materials = scene.materials
    flies = any(material.granular for material in materials)
    packs = not any(isinstance(m, OwnLaw) or not m.granular for m in materials)
    rows = (
        Row(
            "disconnected",
            "later",
            0.1,
            "stress-free share of the packed bulk, among points that bear the weight of a cell and "
            "more: beyond the limit the flow is an artefact of the scheme",
        ),
        Row(
            "density_drift",
            "later",
            0.05,
            "volume of the points over the volume they occupy, minus one, without its sign: beyond "
            "the limit points have collapsed into one another, or drifted apart",
        ),
        Row(
            "ill_posed",
            "later",
            None,
            "share of the flowing points at which the mu(I) law is ill posed: no refinement need "
            "converge where it is large",
        ),
        Row("gaps", "largest", 0.0, "empty cells in a stressed body: torn by the discretisation"),
        Row(
            "courant",
            "largest",
            scene.courant_limit,
            "(c + max speed) dt/dx: beyond the limit a run may fail without a NaN",
        ),
        Row(
            "mach",
            "largest",
            MACH,
            "largest speed over that of waves: beyond the limit densities are off where material "
            "is stopped",
        ),
        Row(
            "compression",
            "largest",
            DENSEST if packs else TWICE,
            "largest ln(rho/rho_c): beyond the limit no such material is so dense",
        ),
        Row(
            "dilution",
            "largest",
            LOOSEST if flies else TWICE,
            "largest -ln(rho/rho_c): beyond the limit no such material is so loose",
        ),
        Row(
            "energy_created",
            "largest",
            ENERGY,
            "energy created over the sum of all work and the energy at the beginning",
        ),
    )
    return tuple(row if row.name in limited else row._replace(limit=None) for row in rows)
