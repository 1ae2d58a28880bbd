"""Bodies that the grid cannot resolve: an error or a warning before a run."""

from __future__ import annotations

from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from granular.shapes.measures import mesh_size, mesh_thickness, thicknesses

if TYPE_CHECKING:
    from granular.mpm.scene import Scene
    from granular.mpm.schemes import Scheme


THIN = 2.0
"""Thickness of a body [cells] below which its sides are coupled, unless nodes are duplicated."""


def check_blades(scene: Scene) -> None:
    """Refuse thin bodies if the scheme has no duplicate nodes that separate their two sides."""
    scheme, least = scene.scheme, THIN * scene.grid.cell
    if keeps_sides(scheme):
        return
    for i, body in enumerate(scene.bodies):
        box, mesh = thicknesses(body.shape)[0], mesh_thickness(body.shape)
        if min(box, mesh) < least * (1 - 1e-9):
            remedy = "make it thicker, or take " + ("" if box <= mesh else "a Box, and ")
            raise ValueError(
                f"bodies[{i}] has parts of {min(box, mesh):.6g} m, must be >= {least:.6g} m, two "
                f"cells, with density = {type(scheme.density).__name__}() and transfer = "
                f"{scheme.transfer!r}: the material on its two sides would be coupled; {remedy}"
                'ParticleDensity() with "apic", "tpic" or "flip", which separates them'
            )


def keeps_sides(scheme: Scheme) -> bool:
    """True if nodes near thin bodies have a duplicate, one for each side."""
    return scheme.density.name == "particle" and scheme.transfer != "xpic"


def _reach(scheme: Scheme) -> float:
    """Thickness of a box [cells] below which points at its two faces share a node."""
    return THIN + 1 if scheme.basis == "quadratic" else THIN


def thin_parts(scene: Scene) -> str | None:
    """Bodies that are so thin or small that the grid hardly resolves them.

    The limits were measured with layers thrown at 0.8 m/s against a thin body and against discs.
    Without duplicate nodes, material behind a thin body of 2, 2.2 and 2.5 cells reaches 9, 4 and
    1.3 % of that speed with the default scheme; it stays at rest from 2.8 cells on, and with other
    bases than splines from 2 cells on. The impulse on a disc depends on its position in the grid
    and on the seeding, see `benchmarks/stability/stability_tables.py`.
    """
    reach = _reach(scene.scheme)
    for i, body in enumerate(scene.bodies):
        box, other = thicknesses(body.shape)
        if other < THIN * scene.grid.cell * (1 - 1e-9):
            return (
                f"bodies[{i}] has a part of {other:.4g} m: below 2 cells the force on it depends "
                "on its position in the grid, by a tenth, and material behind it is coupled to it"
            )
        mesh = mesh_thickness(body.shape)
        if min(box, mesh) >= reach * scene.grid.cell * (1 - 1e-9):
            continue
        thin = f"bodies[{i}] has parts of {min(box, mesh):.4g} m, thinner than {reach:.0f} cells: "
        if box <= mesh and keeps_sides(scene.scheme):
            return thin + (
                "their two sides are separated by duplicate nodes, but not within a cell of their "
                "edges"
            )
        return thin + (
            "the material on one side is coupled to that on the other through common nodes; make "
            f"it {reach:.0f} cells thick, or take {'' if box <= mesh else 'a Box, and '}"
            'ParticleDensity() with "apic", "tpic" or "flip", '
            "which separates them but is not suited to flow that varies in two directions"
        )
    return None


NEAR = 5.5
"""Distance of thin bodies [cells] up to which they may share duplicate nodes: twice the reach."""


def near_thin_parts(scene: Scene) -> str | None:
    """Thin bodies that are near each other at the start, each with a separate front and back.

    The two sides of a cell near several thin parts are those of a single body, with the fronts of
    all its parts. A bin of three plates one cell thick lost 60 % of its points in 0.3 s, and none
    as one body (ParticleDensity, 10 cells deep).
    """
    if not keeps_sides(scene.scheme):
        return None
    grid, reach = scene.grid, _reach(scene.scheme)
    thin = [
        i
        for i, body in enumerate(scene.bodies)
        if thicknesses(body.shape)[0] < reach * grid.cell * (1 - 1e-9)
    ]
    if len(thin) < 2:
        return None
    cells = np.argwhere(np.ones(grid.shape, dtype=bool))
    x = np.array(grid.lower) + grid.cell * (cells + 0.5)
    apart = {i: scene.bodies[i].distance(x)[0] for i in thin}
    for i, j in combinations(thin, 2):
        if (apart[i] + apart[j]).min() < NEAR * grid.cell:
            return (
                f"bodies[{i}] and bodies[{j}] have thin parts nearer than {NEAR:g} cells: material "
                "between them may be on the wrong side of one and leak; make them one body, a Union"
            )
    return None


MILLIMETRE = 1e-3


def mesh_scale(scene: Scene) -> str | None:
    """Meshes that are far too large or small for the domain, but not so in another unit."""
    cell, longest = scene.grid.cell, scene.grid.cell * max(scene.grid.shape)
    for i, body in enumerate(scene.bodies):
        size = mesh_size(body.shape)
        sentence = f"bodies[{i}] has a mesh of {size:.4g} m in a domain of {longest:.4g} m: "
        if size > 10 * longest and cell <= MILLIMETRE * size <= longest:
            return sentence + f"if its lengths are in millimetres, take scale = {MILLIMETRE}"
        if 0 < size < cell and cell <= size / MILLIMETRE <= longest:
            return (
                sentence
                + f"below a cell; if its lengths are in metres, take no scale = {MILLIMETRE}"
            )
    return None


LIGHTEST = 0.1
"""Least mass of a free body over that of a full cell, from `benchmarks/bodies/free_bodies.py`.

Contact computes impulses in 20 sweeps at most, in each of which a body of the mass M passes on the
part M/(M + m) of the impulse of nodes of the mass m, that of a cell at most. So M must exceed m/20.
The noise around a body at rest in a bed is 1.5 times that of a heavy one at a tenth of the mass of
a cell, and 6 to 50 times at a hundredth.
"""


def light_bodies(scene: Scene) -> str | None:
    """Free bodies that have hardly any mass compared with the nodes that press on them."""
    full = max(material.rho_c for material in scene.materials) * scene.grid.cell**scene.dim
    for i, body in enumerate(scene.bodies):
        if body.mass is not None and body.mass < LIGHTEST * full * (1 - 1e-9):
            return (
                f"bodies[{i}].mass = {body.mass:.4g} kg is below {LIGHTEST * full:.4g}, a tenth of "
                "the mass of a full cell: under load, noise of the contact accelerates it"
            )
    return None
